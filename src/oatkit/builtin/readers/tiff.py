"""Stacks of pages in TIFF files, uncompressed, of which only the tags are read."""

import struct
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.array_signals import Pages, check_numbers
from oatkit.builtin.readers.tiff_chain import count_pages
from oatkit.errors import ReadError
from oatkit.hostile import printable

Page = tuple[int, tuple[int, ...], np.dtype]
VENDORS: dict[str, Any] = dict.fromkeys(("is_lsm", "is_scanimage", "is_ndpi", "is_ome"), False)
"""Dialects that would make the library look for pages elsewhere."""
DAMAGE = (ValueError, LookupError, TypeError, ArithmeticError, RuntimeError, AttributeError, MemoryError, struct.error)
"""What the library may raise on a damaged file."""
SEPARATE = 2
"""Value of the tag PlanarConfiguration where each colour has a plane of its own."""


def tiff_pages(path: Path, axes: tuple[str, ...], known: Mapping[str, int]) -> Pages:
    """Return where the pages of a file lie; rows and columns are the last two of `axes`, the others count the pages.

    A TIFF knows the number of its pages only, so of two axes that count them, one must have its length in `known`.
    What programs write beside the pages (OME-XML, ImageJ's description) is not looked at: it may point to other files.
    Raises `ReadError`.
    """
    found = _all_pages(path)
    kinds = {(shape, dtype) for _, shape, dtype in found}
    if len(kinds) != 1:
        raise ReadError(f"{path}: expected pages of one shape and type, found {len(kinds)} kinds")
    ((shape, dtype),) = kinds
    if len(axes) < len(shape):
        raise ReadError(
            f"{path}: its pages have {len(shape)} axes {shape}, 'axes' names {len(axes)}: {', '.join(axes)}"
        )
    offsets = np.array([offset for offset, _, _ in found])
    return Pages(offsets.reshape(_counted(path, len(found), axes[: -len(shape)], known)), shape, dtype, axes)


def _all_pages(path: Path) -> list[Page]:
    import tifffile

    n_pages = count_pages(path)
    try:
        with tifffile.TiffFile(path, mode="r", _multifile=False, **VENDORS) as file:
            return [p for index in range(n_pages) for p in _planes(path, file.pages[index], file.byteorder)]
    except ReadError:
        raise
    except (OSError, tifffile.TiffFileError, *DAMAGE) as error:
        raise ReadError(f"{path}: not a TIFF file, or damaged ({printable(str(error), 200)})") from None


def _planes(path: Path, page: Any, byteorder: str) -> list[Page]:
    """Return offset, shape and type of a page, or of each colour plane. Raises `ReadError` for one in pieces."""
    where = f"{path} page {page.index}"
    if page.compression != 1:
        raise ReadError(f"{where}: expected no compression, found {_name(page.compression)}; save it without")
    if not page.is_final or page.dtype is None or len(page.shape) > 3:
        raise ReadError(f"{where}: expected numbers of 8, 16, 32 or 64 bits in one block, found another layout")
    dtype = page.dtype.newbyteorder(byteorder)
    check_numbers(path, dtype)
    shape, start = tuple(map(int, page.shape)), int(page.dataoffsets[0])
    # Some programs take three or four pages for the colours of one, in planes, and three or four columns for a pixel's.
    if len(shape) == 3 and page.planarconfig == SEPARATE:
        size = prod(shape[1:]) * dtype.itemsize
        return [(start + plane * size, shape[1:], dtype) for plane in range(shape[0])]
    return [(start, shape, dtype)]


def _name(compression: Any) -> str:
    return str(getattr(compression, "name", compression))


def _counted(path: Path, n_pages: int, axes: tuple[str, ...], known: Mapping[str, int]) -> tuple[int, ...]:
    """Return the lengths of the axes that count the pages."""
    unknown = [axis for axis in axes if axis not in known]
    if len(unknown) > 1:
        raise ReadError(
            f"{path}: a TIFF does not say how its pages divide into {' and '.join(unknown)}; save a page as "
            "(detector, sample), or take a .npy file"
        )
    of_known = prod(known[axis] for axis in axes if axis in known)
    if n_pages % of_known or not (unknown or n_pages == of_known):
        counts = " x ".join(f"{known[axis]} ({axis})" if axis in known else axis for axis in axes) or "one page"
        raise ReadError(f"{path}: expected {counts}, found {n_pages} pages")
    lengths = dict(known) | dict.fromkeys(unknown, n_pages // of_known)
    return tuple(lengths[axis] for axis in axes)
