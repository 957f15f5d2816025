"""Values along a straight line through an image, and the width of a peak among them."""

from dataclasses import dataclass

import numpy as np

from oatkit.content import check_range
from oatkit.data import Grid, Image
from oatkit.errors import ValidationError

Point = tuple[float, float]
"""(y, x), m."""

STEPS_PER_PIXEL = 2
MOST_POINTS = 100_000
ROUNDING = 1e-6
"""How near to the centre of a pixel is on it, pixels: a neighbour that has no value does not count there."""


@dataclass(frozen=True, eq=False)
class LineProfile:
    """The values of an image along a line."""

    distance_m: np.ndarray
    """From the start of the line, shape ``(n,)``, m."""
    values: np.ndarray
    """Shape ``(wavelength, n)``, in the unit of the image; NaN where it has no value."""


@dataclass(frozen=True)
class Peak:
    """The highest value of a profile, and where it has fallen to half of it on either side."""

    at_m: float
    height: float
    left_m: float
    right_m: float

    @property
    def width_m(self) -> float:
        """Full width at half maximum, m."""
        return self.right_m - self.left_m


def line_profile(image: Image, start_m: Point, end_m: Point, step_m: float | None = None) -> LineProfile:
    """Return the values of an image at equal steps along a line, both ends included.

    The steps are `step_m` or a little less; without it, half a pixel. Between the centres of four pixels values are
    bilinear. Beyond the outermost centres, and beside a pixel without a value, there is none. Raises `ValidationError`
    for ends that are no length apart or beyond 1 m, and for more than `MOST_POINTS` steps.
    """
    ends = np.array([start_m, end_m], float)
    check_range("line", ends, -1.0, 1.0, "the unit is m, so 10 mm is 0.01")
    length = float(np.hypot(*(ends[1] - ends[0])))
    steps = np.ceil(length / (step_m or image.grid.pixel_size_m / STEPS_PER_PIXEL) - ROUNDING)
    if not 0 < steps <= MOST_POINTS:
        raise ValidationError(f"line: expected 1 .. {MOST_POINTS} steps, got {steps:g} on {1e3 * length:g} mm")
    along = np.linspace(0, 1, int(steps) + 1)
    points = ends[0] + along[:, None] * (ends[1] - ends[0])
    return LineProfile(along * length, _bilinear(image.values, image.grid, points))


def highest_peak(distance_m: np.ndarray, values: np.ndarray) -> Peak | None:
    """Return the highest peak of a profile with its full width at half maximum, counted from zero.

    The flanks are linear between points. None where nothing is above zero, or where the profile ends, or has no value,
    before it has fallen to the half on either side.

    >>> highest_peak(np.arange(5.0), np.array([0.0, 1.0, 2.0, 0.0, 0.0])).width_m
    1.5
    """
    if not np.nanmax(values, initial=-np.inf) > 0:
        return None
    top = int(np.nanargmax(values))
    half = float(values[top]) / 2
    left = _falls_to(half, distance_m[top::-1], values[top::-1])
    right = _falls_to(half, distance_m[top:], values[top:])
    return None if left is None or right is None else Peak(float(distance_m[top]), float(values[top]), left, right)


def _falls_to(level: float, distance: np.ndarray, values: np.ndarray) -> float | None:
    """Return where values, the first of which is above a level, reach it."""
    fallen = np.flatnonzero(~(values > level))
    if not len(fallen) or not np.isfinite(values[fallen[0]]):
        return None
    i = fallen[0]
    part = (values[i - 1] - level) / (values[i - 1] - values[i])
    return float(distance[i - 1] + part * (distance[i] - distance[i - 1]))


def _bilinear(planes: np.ndarray, grid: Grid, points: np.ndarray) -> np.ndarray:
    """Return the values of planes at points of shape ``(n, 2)``: shape ``(plane, n)``."""
    (y0, y1, part_y, in_y), (x0, x1, part_x, in_x) = (
        _between(points[:, axis], centres, grid.pixel_size_m) for axis, centres in enumerate((grid.y_m, grid.x_m))
    )
    found = np.zeros((len(planes), len(points)))
    for rows, share_y in ((y0, 1 - part_y), (y1, part_y)):
        for columns, share_x in ((x0, 1 - part_x), (x1, part_x)):
            share = share_y * share_x
            # What has no weight must not bring in its NaN.
            found += np.where(share > 0, share * planes[:, rows, columns], 0)
    return np.where(in_y & in_x, found, np.nan)


def _between(at_m: np.ndarray, centres_m: np.ndarray, pixel_m: float) -> tuple[np.ndarray, ...]:
    """Return the pixels on both sides of each coordinate, how far from the first it is, and whether it lies within."""
    last = len(centres_m) - 1
    at = (at_m - centres_m[0]) / pixel_m
    at = np.where(abs(at - np.round(at)) < ROUNDING, np.round(at), at)
    first = np.clip(np.floor(at), 0, max(last - 1, 0)).astype(int)
    return first, np.minimum(first + 1, last), np.clip(at - first, 0, 1), (at >= 0) & (at <= last)
