"""Where in an image the wall of the body may be: edges that rise inwards, with the noise they stand out of."""

from dataclasses import dataclass

import numpy as np

from oatkit.api import Grid, Image, SolverError, ValidationError

LEAST_BLUR_PX = 1.0
"""A derivative needs the image smoothed by at least this much."""
NOISE_FACTOR = 3.0
"""An edge counts half where it is this many standard deviations of the noise's derivative steep."""
STEEPEST_SHARE = 0.97
"""Quantile of all slopes that stands for the slope of a typical wall, which covers a few percent of an image."""
DIMMEST_SHARE = 0.1
"""A typical wall is at least this steep, relative to the steepest slope: a small body covers less than its share."""


@dataclass(frozen=True, eq=False)
class Walls:
    """The slope of a smoothed image, and how steep a wall is at least.

    The slope is that of the image itself, not of its logarithm: there the steepest point of a blurred step lies on the
    step, while a logarithm moves it outwards into the skirt of the blur.
    """

    plane: np.ndarray
    """The smoothed image with a margin of zeros around it, so that a body cut by the field of view ends at its edge."""
    slope_y: np.ndarray
    slope_x: np.ndarray
    """Its derivatives, per pixel."""
    half_slope: float
    """Slope at which the evidence for a wall is 1/2."""
    edge_width_m: float
    """Width that a sharp edge has in the smoothed image, m."""
    grid: Grid
    """That of `plane`, margin included."""

    @classmethod
    def of(cls, image: Image, blur_mm: float, sensitivity: float) -> "Walls":
        """Return the walls of an image.

        Raises `ValidationError` for an image that is not finite, `SolverError` for one that shows nothing.
        """
        from scipy.ndimage import gaussian_filter

        pixel = image.grid.pixel_size_m
        blur = max(LEAST_BLUR_PX, 1e-3 * blur_mm / pixel)
        margin = int(np.ceil(4 * blur)) + 1
        plane = np.pad(combined(image), margin)
        slope_y, slope_x = (gaussian_filter(plane, blur, order=order) for order in ((1, 0), (0, 1)))
        body = (slice(margin, -margin),) * 2
        slopes = np.hypot(slope_y, slope_x)[body]
        # A quarter of all normal deviates are smaller than 0.3186 sigma: low enough to be the background's.
        noise = float(np.quantile(np.abs(np.stack([slope_y[body], slope_x[body]])), 0.25)) / 0.3186
        typical = max(float(np.quantile(slopes, STEEPEST_SHARE)), DIMMEST_SHARE * float(slopes.max()))
        grid = Grid(plane.shape, pixel, image.grid.centre_m)
        half = max(NOISE_FACTOR * noise, sensitivity * typical, np.finfo(float).tiny)
        width = np.sqrt(2 * np.pi) * blur * pixel
        return cls(gaussian_filter(plane, blur), slope_y, slope_x, half, width, grid)

    def rise(self, points_m: np.ndarray, inward: np.ndarray) -> np.ndarray:
        """Return the slope at points of shape ``(..., 2)`` in the directions `inward` (unit vectors), per pixel."""
        slope = np.stack([self._at(self.slope_y, points_m), self._at(self.slope_x, points_m)], axis=-1)
        return (slope * inward).sum(-1)

    def evidence(self, rise: np.ndarray) -> np.ndarray:
        """Return how much a rise speaks for a wall, 0 .. 1: a dim part of the wall counts nearly as much as others."""
        relative = (np.maximum(rise, 0.0) / self.half_slope) ** 4
        return relative / (1 + relative)

    def brightness(self, points_m: np.ndarray) -> np.ndarray:
        """Return the smoothed image at points of shape ``(..., 2)``."""
        return self._at(self.plane, points_m)

    def _at(self, values: np.ndarray, points_m: np.ndarray) -> np.ndarray:
        from scipy.ndimage import map_coordinates

        origin = (self.grid.y_m[0], self.grid.x_m[0])
        where = np.moveaxis((points_m - origin) / self.grid.pixel_size_m, -1, 0)
        return map_coordinates(values, where, order=1, mode="nearest")


def combined(image: Image) -> np.ndarray:
    """Return one plane of shape ``(y, x)``, its largest magnitude 1: the mean over wavelengths.

    Each wavelength is first scaled to unit norm, so that none outweighs the others; signs are kept, since noise then
    averages out. The background, read off the rim of the image, is subtracted.

    Raises `ValidationError` for an image that is not finite, `SolverError` for one that shows nothing.
    """
    if not np.isfinite(image.values).all():
        raise ValidationError(f"image {image.quantity}: it holds values that are not finite; no body can be found")
    planes = image.values.astype(float)
    peaks = abs(planes).max((1, 2), keepdims=True)
    # By the peak first: the square of a large number may not exist.
    planes = (planes / np.where(peaks > 0, peaks, 1.0))[peaks[:, 0, 0] > 0]
    mean = (planes / np.sqrt((planes**2).sum((1, 2), keepdims=True))).sum(0)
    if not np.ptp(mean) > 0:
        raise no_body("all of its pixels are equal")
    # The lower quartile: a body that is cut by the field of view may cover most of the rim.
    mean = mean - np.quantile(np.concatenate([mean[0], mean[-1], mean[:, 0], mean[:, -1]]), 0.25)
    return mean / abs(mean).max()


def no_body(why: str) -> SolverError:
    """Return the error for an image without a body."""
    return SolverError(
        f"segment: no body stands out of the image, {why}; hand in its outline with the segmenter 'mask' or 'polygon'"
    )
