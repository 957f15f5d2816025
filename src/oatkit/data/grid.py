"""The pixels of an image."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from oatkit.content import ByContent, check_range, read_only
from oatkit.errors import ValidationError


@dataclass(frozen=True, eq=False)
class Grid(ByContent):
    """Square pixels in the image plane.

    Raises `ValidationError` for an empty shape or a pixel that is not between 1 um and 10 mm.
    """

    shape: tuple[int, int]
    """Rows and columns, ``(ny, nx)``."""
    pixel_size_m: float
    """Side of a pixel, m."""
    centre_m: tuple[float, float] = (0.0, 0.0)
    """Where the middle of the image lies, ``(y, x)``, m."""

    def __post_init__(self) -> None:
        if len(self.shape) != 2 or not all(n >= 1 and int(n) == n for n in self.shape):
            raise ValidationError(f"grid shape: expected (ny, nx) of at least (1, 1), got {self.shape}")
        object.__setattr__(self, "shape", (int(self.shape[0]), int(self.shape[1])))
        object.__setattr__(self, "pixel_size_m", float(self.pixel_size_m))
        object.__setattr__(self, "centre_m", (float(self.centre_m[0]), float(self.centre_m[1])))
        check_range("pixel_size_m", self.pixel_size_m, 1e-6, 1e-2, "the unit is m, so 0.1 mm is 1e-4")
        check_range("centre_m", self.centre_m, -1.0, 1.0, "the unit is m, so 10 mm is 0.01")

    @cached_property
    def y_m(self) -> np.ndarray:
        """Pixel centres along y, shape ``(ny,)``, m, rising with the row."""
        return self._centres(0)

    @cached_property
    def x_m(self) -> np.ndarray:
        """Pixel centres along x, shape ``(nx,)``, m, rising with the column."""
        return self._centres(1)

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Outer edges ``(left, right, bottom, top)``, m, as matplotlib's ``extent`` wants them."""
        half_y, half_x = (0.5 * n * self.pixel_size_m for n in self.shape)
        y, x = self.centre_m
        return (x - half_x, x + half_x, y - half_y, y + half_y)

    def _centres(self, axis: int) -> np.ndarray:
        n = self.shape[axis]
        return read_only(self.centre_m[axis] + (np.arange(n) - (n - 1) / 2) * self.pixel_size_m)
