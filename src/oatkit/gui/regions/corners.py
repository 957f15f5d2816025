"""Regions of interest as the shapes of a viewer, and back: no viewer is needed for it."""

from functools import lru_cache
from typing import Any

import numpy as np

from oatkit.errors import ValidationError
from oatkit.gui.images.world import from_world, to_world
from oatkit.shapes import EllipseRegion, MaskRegion, PolygonRegion, RectangleRegion, Region

SKEW = 1e-5
"""Cosine between the sides of a rectangle below which it is one: what single precision leaves of a right angle."""


def shape_of(region: Region) -> tuple[str, np.ndarray]:
    """Return the type of a shape and its corners, shape ``(n, 2)``, in the viewer's mm.

    An ellipse is given by the rectangle around it, anticlockwise from the corner that is lower left before it is
    turned. Pixels are given by the lines around them. Raises `ValidationError` for pixels that are none.
    """
    if isinstance(region, EllipseRegion):
        around = RectangleRegion(region.name, region.centre_m, region.half_axes_m, region.angle_rad)
        return "ellipse", to_world(around.outline_m)
    if isinstance(region, RectangleRegion):
        return "rectangle", to_world(region.outline_m)
    if isinstance(region, MaskRegion):
        return "polygon", to_world(_around(region))
    return "polygon", to_world(region.outline_m)


def region_of(kind: str, corners_mm: np.ndarray, name: str) -> Region:
    """Return the region that a shape of the viewer stands for.

    A rectangle that was drawn out along the axes has no angle; one that was pulled askew is a polygon, an ellipse is an
    ellipse then, too. Raises `ValidationError` for a shape that encloses nothing, and where the region does.
    """
    corners = from_world(corners_mm)
    if kind == "polygon":
        return PolygonRegion(name, corners)
    if kind not in ("rectangle", "ellipse"):
        raise ValidationError(f"region '{name}': a line encloses nothing; draw a polygon, a rectangle or an ellipse")
    centre = corners.mean(axis=0)
    along_x = (corners[1] - corners[0] + corners[2] - corners[3]) / 4
    along_y = (corners[3] - corners[0] + corners[2] - corners[1]) / 4
    askew = abs(along_x @ along_y) > SKEW * np.hypot(*along_x) * np.hypot(*along_y)
    if askew and kind == "rectangle":
        return PolygonRegion(name, corners)
    if askew:
        axes, sizes, _ = np.linalg.svd(np.column_stack([along_x, along_y]))
        along_x, along_y = (axes * sizes).T
    if along_x[1] == 0:  # drawn from the corner that makes the first side an upright one
        along_x, along_y = along_y, along_x
    along_x = along_x * (-1 if along_x[1] < 0 else 1)
    half_axes = (float(np.hypot(*along_y)), float(np.hypot(*along_x)))
    cls: Any = RectangleRegion if kind == "rectangle" else EllipseRegion
    return cls(name, (float(centre[0]), float(centre[1])), half_axes, float(np.arctan2(along_x[0], along_x[1])))


@lru_cache(maxsize=64)
def _around(region: MaskRegion) -> np.ndarray:
    """Return one closed line around all pixels of a mask, holes left out, m.

    Several contours are joined by ways that are gone to and fro, so that they enclose nothing.
    """
    from skimage.measure import find_contours

    if not region.pixels.any():
        raise ValidationError(f"region '{region.name}': no pixel belongs to it")
    grid = region.grid
    curves = find_contours(np.pad(region.pixels, 1).astype(float), 0.5)
    corner = np.array([grid.y_m[0], grid.x_m[0]]) - grid.pixel_size_m
    line = curves[0] if len(curves) > 1 else curves[0][:-1]
    for curve in curves[1:]:
        line = np.vstack([line, curve, line[:1]])
    return corner + grid.pixel_size_m * line
