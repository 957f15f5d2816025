"""Regions of interest: shapes in the image plane, and which pixels lie in them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from oatkit.content import ByContent, check_range, read_only
from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.polygons import contains

CORNERS = 256
"""Of the polygon that stands for an ellipse where one is asked for: within 0.02 % of its size."""


class Region(ByContent, ABC):
    """A named part of the image plane. A pixel belongs to it where its centre lies inside."""

    name: str

    @abstractmethod
    def mask(self, grid: Grid) -> np.ndarray:
        """Return which pixels of `grid` belong to the region: bool, shape ``(ny, nx)``."""

    @property
    @abstractmethod
    def outline_m(self) -> np.ndarray:
        """A closed polygon around the region, shape ``(n, 2)``, each ``(y, x)``, m; empty for one without a shape."""


@dataclass(frozen=True, eq=False)
class PolygonRegion(Region):
    """A closed polygon. Sides may cross, as in outlines drawn by hand.

    Inside is what a ray to infinity leaves through an odd number of sides. Raises `ValidationError` for fewer than
    three corners.
    """

    name: str
    vertices_m: np.ndarray
    """Shape ``(n, 2)``, each ``(y, x)``, m; the last is joined to the first."""

    def __post_init__(self) -> None:
        vertices = read_only(self.vertices_m, float)
        if vertices.ndim != 2 or vertices.shape[1] != 2 or len(vertices) < 3:
            raise ValidationError(
                f"region '{self.name}': expected three corners (y, x) or more, got the shape {vertices.shape}"
            )
        check_range(f"region '{self.name}'", vertices, -1.0, 1.0, "the unit is m, so 10 mm is 0.01")
        object.__setattr__(self, "vertices_m", vertices)

    def mask(self, grid: Grid) -> np.ndarray:
        """Return which pixels lie inside: bool, shape ``(ny, nx)``."""
        return contains(self.vertices_m, grid)

    @property
    def outline_m(self) -> np.ndarray:
        """The polygon itself."""
        return self.vertices_m


@dataclass(frozen=True, eq=False)
class _Centred(Region):
    """A shape given by its centre, its half axes, and the angle by which it is turned."""

    name: str
    centre_m: tuple[float, float]
    """(y, x), m."""
    half_axes_m: tuple[float, float]
    """Along y and x before the shape is turned, m."""
    angle_rad: float = 0.0
    """Turn about the centre, anticlockwise (x right, y up)."""

    def __post_init__(self) -> None:
        hint = "the unit is m, so 10 mm is 0.01"
        check_range(f"region '{self.name}': centre_m", self.centre_m, -1.0, 1.0, hint)
        check_range(f"region '{self.name}': half_axes_m", self.half_axes_m, 1e-6, 1.0, hint)
        check_range(
            f"region '{self.name}': angle_rad", self.angle_rad, -7.0, 7.0, "the unit is rad, so 90 degrees is 1.57"
        )
        object.__setattr__(self, "centre_m", tuple(map(float, self.centre_m)))
        object.__setattr__(self, "half_axes_m", tuple(map(float, self.half_axes_m)))
        object.__setattr__(self, "angle_rad", float(self.angle_rad))

    def _relative(self, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
        """Return the pixels' centres along the axes of the shape, in half axes."""
        y, x = np.meshgrid(grid.y_m - self.centre_m[0], grid.x_m - self.centre_m[1], indexing="ij")
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return (c * y - s * x) / self.half_axes_m[0], (s * y + c * x) / self.half_axes_m[1]

    def _placed(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return points given in half axes where they lie in the plane, shape ``(n, 2)``."""
        y, x = y * self.half_axes_m[0], x * self.half_axes_m[1]
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return np.column_stack([c * y + s * x, c * x - s * y]) + self.centre_m


@dataclass(frozen=True, eq=False)
class EllipseRegion(_Centred):
    """An ellipse. Raises `ValidationError` for values out of range."""

    def mask(self, grid: Grid) -> np.ndarray:
        """Return which pixels lie inside: bool, shape ``(ny, nx)``."""
        y, x = self._relative(grid)
        return np.asarray(y**2 + x**2 <= 1)

    @property
    def outline_m(self) -> np.ndarray:
        """A polygon of `CORNERS` corners on the ellipse."""
        angle = np.arange(CORNERS) * (2 * np.pi / CORNERS)
        return self._placed(np.sin(angle), np.cos(angle))


@dataclass(frozen=True, eq=False)
class RectangleRegion(_Centred):
    """A rectangle. Raises `ValidationError` for values out of range."""

    def mask(self, grid: Grid) -> np.ndarray:
        """Return which pixels lie inside: bool, shape ``(ny, nx)``."""
        y, x = self._relative(grid)
        return np.asarray((abs(y) <= 1) & (abs(x) <= 1))

    @property
    def outline_m(self) -> np.ndarray:
        """The four corners, anticlockwise from the lower left one."""
        return self._placed(np.array([-1.0, -1.0, 1.0, 1.0]), np.array([-1.0, 1.0, 1.0, -1.0]))


@dataclass(frozen=True, eq=False)
class MaskRegion(Region):
    """Pixels of one grid. Raises `ValidationError` where the mask does not have the shape of the grid."""

    name: str
    pixels: np.ndarray
    """Bool, shape ``(ny, nx)``, row 0 at the bottom."""
    grid: Grid

    def __post_init__(self) -> None:
        pixels = read_only(self.pixels, bool)
        if pixels.shape != self.grid.shape:
            raise ValidationError(
                f"region '{self.name}': a mask of shape {pixels.shape} does not fit a grid of {self.grid.shape}"
            )
        object.__setattr__(self, "pixels", pixels)

    def mask(self, grid: Grid) -> np.ndarray:
        """Return the mask. Raises `ValidationError` for another grid than its own."""
        if grid != self.grid:
            raise ValidationError(
                f"region '{self.name}': the mask belongs to {_words(self.grid)}, the image has {_words(grid)}; "
                "draw the mask anew"
            )
        return self.pixels

    @property
    def outline_m(self) -> np.ndarray:
        """Nothing: a mask has no shape but its pixels."""
        return np.zeros((0, 2))


def rim(boundary: Image, depth_m: float, name: str = "rim") -> MaskRegion:
    """Return what lies inside of a boundary and less than `depth_m` below it."""
    depth = _depth(boundary, depth_m)
    return MaskRegion(name, (depth > 0) & (depth <= depth_m), boundary.grid)


def core(boundary: Image, depth_m: float, name: str = "core") -> MaskRegion:
    """Return what lies deeper than `depth_m` below a boundary."""
    return MaskRegion(name, _depth(boundary, depth_m) > depth_m, boundary.grid)


def _words(grid: Grid) -> str:
    return f"{grid.shape[0]} x {grid.shape[1]} pixels of {1e3 * grid.pixel_size_m:.4g} mm"


def _depth(boundary: Image, depth_m: float) -> np.ndarray:
    if boundary.quantity != "boundary":
        raise ValidationError(f"rim and core need the image 'boundary', got '{boundary.quantity}'")
    check_range("depth_m", depth_m, 1e-6, 1.0, "the unit is m, so 1 mm is 1e-3")
    return -boundary.values[0]
