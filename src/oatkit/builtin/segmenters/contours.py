"""Closed contours as polygons of evenly spaced points: smoothing, normals, and the strip on both sides."""

import numpy as np

from oatkit.builtin.segmenters.strips import Strip
from oatkit.polygons import area, resampled


def smoothed(points_m: np.ndarray, spacing_m: float, rigidity_mm: float) -> np.ndarray:
    r"""Return a closed contour resampled at `spacing_m` and smoothed as a thin rod of the rigidity r would be.

    It minimises :math:`\int |c - c_0|^2 + r^4 |c''|^2\,ds`: features shorter than 2 pi r vanish, a circle of radius
    R shrinks by the fraction (r / R)^4 alone. For evenly spaced points this is a division in Fourier space.
    """
    even = resampled(points_m, spacing_m)
    wave_number = 2 * np.pi * np.fft.rfftfreq(len(even), spacing(even))
    gain = 1 / (1 + (1e-3 * rigidity_mm * wave_number) ** 4)
    return np.fft.irfft(np.fft.rfft(even, axis=0) * gain[:, None], len(even), axis=0)


def distances(points_m: np.ndarray, contour_m: np.ndarray) -> np.ndarray:
    """Return how far points are from a closed contour, to a sixteenth of its spacing, m."""
    from scipy.spatial import cKDTree

    return cKDTree(resampled(contour_m, spacing(contour_m) / 8)).query(points_m)[0]


def spacing(points_m: np.ndarray) -> float:
    """Return the mean distance of neighbouring points of a closed contour, m."""
    return float(np.hypot(*(np.roll(points_m, -1, axis=0) - points_m).T).mean())


def inward_normals(points_m: np.ndarray) -> np.ndarray:
    """Return the unit normals of an anticlockwise contour (x right, y up), pointing inwards, ``(n, 2)``."""
    along = np.roll(points_m, -1, axis=0) - np.roll(points_m, 1, axis=0)
    length = np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    # A quarter turn to the left of (dy, dx) is (dx, -dy).
    return np.column_stack([along[:, 1], -along[:, 0]]) / length


def anticlockwise(points_m: np.ndarray) -> np.ndarray:
    """Return the contour in anticlockwise order."""
    return points_m if area(points_m) > 0 else points_m[::-1]


def strip_around(points_m: np.ndarray, outward_m: float, inward_m: float, step_m: float) -> Strip:
    """Return the strip that reaches `outward_m` and `inward_m` to either side of an anticlockwise contour."""
    inward = inward_normals(points_m)
    n_steps = int(np.ceil((outward_m + inward_m) / step_m)) + 1
    return Strip(points_m - outward_m * inward, inward, step_m, n_steps, spacing(points_m))
