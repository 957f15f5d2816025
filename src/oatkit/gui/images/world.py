"""Where things lie: y points up in oatkit and down in viewers, which count in mm."""

from typing import Any

import numpy as np

from oatkit.data import Image

TOLERANCE = 0.1
"""How far an outline may leave the contour, pixels."""


def upright(image: Image) -> np.ndarray:
    """Return the values as viewers draw them: row 0, which lies at the bottom, last."""
    return np.asarray(image.values[:, ::-1])


def to_world(points_m: np.ndarray) -> np.ndarray:
    """Turn points ``(y, x)`` in m, y upwards, into those of the viewer: ``(y, x)`` in mm, y downwards."""
    return np.asarray(points_m, float) * (-1e3, 1e3)


def from_world(points_mm: np.ndarray) -> np.ndarray:
    """Turn points of the viewer, ``(y, x)`` in mm with y downwards, into m with y upwards; other axes are dropped."""
    return np.asarray(points_mm, float)[..., -2:] * (-1e-3, 1e-3)


def place(image: Image, ndim: int) -> dict[str, Any]:
    """Return where a layer of `ndim` axes lies: y and x in mm, wavelength and frame by their number."""
    pixel = 1e3 * image.grid.pixel_size_m
    corner = to_world(np.array([image.grid.y_m[-1], image.grid.x_m[0]]))
    more = ndim - 2
    return {
        "scale": (*[1.0] * more, pixel, pixel),
        "translate": (*[0.0] * more, *corner),
        # With "nm" for the wavelength napari would show lengths in nm, too.
        "units": (*["pixel"] * more, "mm", "mm"),
        "axis_labels": ("frame", "wavelength", "y", "x")[-ndim:],
    }


def outlines(boundary: Image) -> list[np.ndarray]:
    """Return the closed contours of a signed distance at zero, each of shape ``(n, 2)``, in the viewer's mm."""
    from skimage.measure import find_contours

    grid = boundary.grid
    corner = np.array([grid.y_m[0], grid.x_m[0]])
    curves = find_contours(boundary.values[0].astype(float), 0.0)
    lines = [thinned(curve, TOLERANCE)[:-1] for curve in curves]
    return [to_world(corner + grid.pixel_size_m * line) for line in lines if len(line) >= 3]


def thinned(curve: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the points of a curve, its ends among them, that keep it within a tolerance: Douglas and Peucker, 1973.

    As `skimage.measure.approximate_polygon`, whose import alone takes longer than to show a whole result.
    """
    kept, pieces = {0, len(curve) - 1}, [(0, len(curve) - 1)]
    while pieces:
        start, end = pieces.pop()
        if end - start > 1:
            off = _distances(curve[start + 1 : end], curve[start], curve[end])
            if off.max() > tolerance:
                middle = start + 1 + int(off.argmax())
                kept.add(middle)
                pieces += [(start, middle), (middle, end)]
    return curve[sorted(kept)]


def _distances(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return how far points lie from a straight piece."""
    along, off = end - start, points - start
    length = float(along @ along)
    share = np.clip(off @ along / length, 0, 1) if length > 0 else np.zeros(len(points))
    return np.hypot(*(off - share[:, None] * along).T)
