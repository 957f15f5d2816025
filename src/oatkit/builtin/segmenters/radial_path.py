"""The outline as a function of the angle about a centre."""

import numpy as np

from oatkit.api import Grid
from oatkit.builtin.segmenters.contours import inward_normals, smoothed
from oatkit.builtin.segmenters.strips import Strip
from oatkit.builtin.segmenters.walls import Walls, no_body
from oatkit.polygons import centroid

RAYS = 360
STEP_PX = 0.25
BENDING = 0.1
MAX_SLOPE = 1.6
"""Largest slope of the path, as change of radius along the arc at a third of the image's diagonal."""
MOST_CENTRES = 5
CENTRE_SETTLED_M = 3e-4
LEAST_SEEN = 0.3
"""A contour of which a smaller share lies on a visible wall is none."""
SPACING_M = 2e-4
"""Distance of the points of a contour."""


def radial_contour(walls: Walls, grid: Grid, rigidity_mm: float) -> np.ndarray:
    """Return the outline found along rays from a centre, anticlockwise, shape ``(n, 2)``, m.

    The centre starts as that of the image's brightness above the mean and is moved to the centroid of each outline
    until it stays. Raises `SolverError` where less than `LEAST_SEEN` of the contour lies on a wall.
    """
    centre = _bright_centre(walls, grid)
    for _ in range(MOST_CENTRES):
        points = _rays(centre, grid).wall(walls, BENDING, MAX_SLOPE)
        moved = centroid(points) - centre
        if not np.hypot(*moved) > CENTRE_SETTLED_M:
            break
        centre = centre + moved
    contour = smoothed(points, SPACING_M, rigidity_mm)
    check_seen(seen_share(contour, walls))
    return contour


def seen_share(contour_m: np.ndarray, walls: Walls) -> float:
    """Return the share of a contour that lies on a visible wall."""
    rise = walls.rise(contour_m, inward_normals(contour_m))
    return float((walls.evidence(rise) >= 0.5).mean())


def check_seen(share: float) -> None:
    """Raise `SolverError` for a contour of which less than `LEAST_SEEN` lies on a visible wall."""
    if not share >= LEAST_SEEN:
        raise no_body("no closed wall stands out of its noise and streaks")


def _bright_centre(walls: Walls, grid: Grid) -> np.ndarray:
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    points = np.stack([y, x], axis=-1)
    brightness = walls.brightness(points)
    # The root keeps one bright vessel from pulling the centre to its side.
    weight = np.sqrt(np.maximum(brightness - brightness.mean(), 0.0))
    return (weight[..., None] * points).sum((0, 1)) / max(weight.sum(), 1e-300)


def _rays(centre_m: np.ndarray, grid: Grid) -> Strip:
    """Return rays that start on a circle around the whole grid and end just before the centre."""
    left, right, bottom, top = grid.extent_m
    corners = np.array([(y, x) for y in (bottom, top) for x in (left, right)])
    radius = float(np.hypot(*(corners - centre_m).T).max())
    angle = np.arange(RAYS) * 2 * np.pi / RAYS
    outward = np.column_stack([np.sin(angle), np.cos(angle)])
    step = STEP_PX * grid.pixel_size_m
    expected = np.hypot(right - left, top - bottom) / 3
    return Strip(
        centre_m + radius * outward, -outward, step, max(8, int(radius / step) - 8), expected * 2 * np.pi / RAYS
    )
