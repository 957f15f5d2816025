"""The plane in which the detectors of a file lie, out of points in space."""

import numpy as np

from oatkit.data import Detectors

PLANE_TOLERANCE_M = 1e-4


def flat_axes(points_m: np.ndarray) -> list[int]:
    """Return the axes along which points ``(n, 3)`` do not extend: z first, then y, then x."""
    spread = np.ptp(points_m, axis=0)
    return [axis for axis in (2, 1, 0) if spread[axis] <= PLANE_TOLERANCE_M]


def seen_along(points_m: np.ndarray, across: int) -> Detectors:
    """Return points ``(n, 3)`` as detectors in the plane across an axis; the later axis of the two points up."""
    x, y = points_m[:, [axis for axis in range(3) if axis != across]].T
    return Detectors(np.stack([y, x], axis=1))


def extent(points_m: np.ndarray) -> str:
    """Return the size of the box around points ``(n, 3)`` in words."""
    return " x ".join(f"{1e3 * size:.3g}" for size in np.ptp(points_m, axis=0)) + " mm"
