"""Reads a picture of labels from a file that may be damaged or hostile."""

import io
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.errors import OatkitError, ReadError
from oatkit.hostile import printable, read_at_most

MOST_BYTES = 256 * 2**20
MOST_PIXELS = 10_000**2
PICTURES = (".png", ".tif", ".tiff")
"""Endings of those whose row 0 lies at the top, as viewers draw them; it lies at the bottom in ``.npy`` files."""
LABEL_FILES = (".npy", *PICTURES)


def read_labels(path: Path) -> np.ndarray:
    """Return the labels in a ``.npy``, ``.png``, ``.tif`` or ``.tiff`` file, two-dimensional, rows as in the file.

    Pickled objects are refused, sizes are compared with the limits above before pixels are read. Raises `ReadError`.
    """
    suffix = path.suffix.lower()
    if suffix not in LABEL_FILES:
        raise ReadError(f"{path}: a mask is read from .npy, .png, .tif or .tiff, not from '{printable(suffix)}'")
    content = read_at_most(path, MOST_BYTES)
    reader = {".npy": _npy, ".png": _png}.get(suffix, _tiff)
    try:
        labels = reader(content, path)
    except OatkitError:
        raise
    except Exception as error:  # the libraries raise whatever a damaged file makes them stumble over
        raise ReadError(
            f"{path}: not a complete {suffix[1:]} file, or damaged ({printable(str(error), 200)})"
        ) from None
    _check(labels.shape, labels.dtype, path)
    return labels


def _check(shape: tuple[int, ...], dtype: Any, path: Path) -> None:
    if len(shape) != 2:
        raise ReadError(f"{path}: expected a mask of shape (rows, columns), one value a pixel, found the shape {shape}")
    if not 1 <= prod(shape) <= MOST_PIXELS:
        raise ReadError(f"{path}: the mask has the shape {shape}; expected 1 .. {MOST_PIXELS} pixels")
    if np.dtype(dtype).kind not in "biuf":
        raise ReadError(f"{path}: expected numbers as labels, found the type {dtype}")


def _npy(content: bytes, path: Path) -> np.ndarray:
    from numpy.lib import format as npy

    stream = io.BytesIO(content)
    version = npy.read_magic(stream)
    header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if header is None:
        raise ReadError(f"{path}: version {version} of the .npy format is not read")
    shape, _, dtype = header(stream)
    _check(shape, dtype, path)
    stream.seek(0)
    return np.load(stream, allow_pickle=False)


def _png(content: bytes, path: Path) -> np.ndarray:
    from PIL import Image as Picture

    with Picture.open(io.BytesIO(content), formats=["PNG"]) as picture:
        if picture.mode not in ("1", "L", "P", "I", "I;16", "F"):
            raise ReadError(
                f"{path}: expected one channel of labels (grey, palette or black and white), found {picture.mode}"
            )
        _check((picture.height, picture.width), np.uint8, path)
        return np.asarray(picture)


def _tiff(content: bytes, path: Path) -> np.ndarray:
    from tifffile import TiffFile

    with TiffFile(io.BytesIO(content)) as file:
        if len(file.pages) != 1:
            raise ReadError(f"{path}: expected one page, found {len(file.pages)}")
        page: Any = file.pages[0]
        _check(page.shape, page.dtype, path)
        return page.asarray()
