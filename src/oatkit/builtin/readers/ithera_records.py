"""Images in the binary files of an iThera scan: planes of floating point numbers one after another."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.stored_images import StoredImages, refuse
from oatkit.content import read_only
from oatkit.data import Grid, Image
from oatkit.errors import ReadError, ValidationError

MAX_PIXELS = 4096


@dataclass(frozen=True)
class Planes:
    """How the planes lie in a file."""

    pixels: tuple[int, int]
    """Number along the slow and the fast axis of a plane."""
    pixel_size_m: tuple[float, float]
    dtype: str
    upright: bool
    """Whether the slow axis is y, pointing up; else the slow one is x and the fast one y, pointing down."""

    def grid(self) -> Grid:
        """Return the grid of an image about the origin. Raises `ValidationError` where pixels are not square."""
        if not all(0 < n <= MAX_PIXELS for n in self.pixels):
            raise ValidationError(f"expected 1 .. {MAX_PIXELS} pixels along a side, found {self.pixels}")
        if not abs(self.pixel_size_m[0] - self.pixel_size_m[1]) <= 1e-4 * self.pixel_size_m[0]:
            raise ValidationError(f"expected square pixels, found {self.pixel_size_m} m")
        return Grid(self.pixels if self.upright else self.pixels[::-1], self.pixel_size_m[0])


@dataclass(frozen=True)
class _Stack:
    """The records of a file that make up images, one row of indices for each frame."""

    path: Path
    records: np.ndarray
    """Which record is which plane, shape ``(frame, plane)``; below 0 where there is none."""
    planes: Planes
    quantity: str
    unit: str
    wavelengths_nm: tuple[float, ...]
    history: tuple[Mapping[str, Any], ...]

    def image(self, frame: int) -> Image:
        """Return the image of a frame."""
        chosen = self.records[frame]
        if chosen.min() < 0:
            raise ReadError(f"{self.path}: there is no image with frame {frame}")
        values = _mapped(self.path, self.planes, int(self.records.max()) + 1)[chosen]
        values = values if self.planes.upright else values.swapaxes(1, 2)[:, ::-1]
        grid = self.planes.grid()
        return Image(np.array(values), self.quantity, self.unit, grid, self.wavelengths_nm, self.history)


def stack(
    path: Path,
    records: np.ndarray,
    planes: Planes,
    quantity: str,
    unit: str,
    wavelengths_nm: tuple[float, ...],
    history: Mapping[str, Any],
) -> StoredImages:
    """Return images out of the records of a file; ones that refuse to be read where they do not lie in it."""
    if not records.size:
        return StoredImages(0, partial(refuse, f"{path}: no frames"))
    try:
        planes.grid()
        _mapped(path, planes, int(records.max()) + 1)
    except (ReadError, ValidationError) as error:
        message = str(error) if isinstance(error, ReadError) else f"{path}: {error}"
        return StoredImages(len(records), partial(refuse, message))
    made = _Stack(path, read_only(records), planes, quantity, unit, wavelengths_nm, ({"step": "stored", **history},))
    return StoredImages(len(records), made.image)


def _mapped(path: Path, planes: Planes, count: int) -> np.ndarray:
    """Return the first records of a file as a read-only memory map, shape ``(record, slow, fast)``."""
    dtype = np.dtype(planes.dtype)
    needed = count * planes.pixels[0] * planes.pixels[1] * dtype.itemsize
    try:
        found = path.stat().st_size if path.is_file() else -1
        if found < max(needed, 1):
            held = f"{found} bytes" if found >= 0 else "no file"
            raise ReadError(
                f"{path}: expected {count} images of {planes.pixels} pixels in {needed} bytes, found {held}"
            )
        return np.memmap(path, dtype, mode="r", shape=(count, *planes.pixels))
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror})") from None
