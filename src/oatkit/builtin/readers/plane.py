"""The plane in which the detectors of a file lie, out of points in space."""

import numpy as np

from oatkit.data import Detectors
from oatkit.errors import ReadError

PLANE_TOLERANCE_M = 1e-4


def flat_axes(points_m: np.ndarray, where: str) -> list[int]:
    """Return the axes along which points ``(n, 3)`` do not extend, at least one: z first, then y, then x.

    Raises `ReadError`, which begins with `where`, for points that extend along all of them.
    """
    spread = np.ptp(points_m, axis=0)
    flat = [axis for axis in (2, 1, 0) if spread[axis] <= PLANE_TOLERANCE_M]
    if not flat:
        size = " x ".join(f"{1e3 * length:.3g}" for length in spread)
        raise ReadError(
            f"{where}: expected detectors in a plane of constant x, y or z (3-D arrays are not supported), found an "
            f"array of {size} mm"
        )
    return flat


def seen_along(points_m: np.ndarray, across: int) -> Detectors:
    """Return points ``(n, 3)`` as detectors in the plane across an axis; the later axis of the two points up."""
    x, y = points_m[:, axes_in_plane(across)].T
    return Detectors(np.stack([y, x], axis=1))


def axes_in_plane(across: int) -> tuple[int, int]:
    """Return the axes that point to the right and up in the plane across an axis."""
    right, up = (axis for axis in range(3) if axis != across)
    return right, up
