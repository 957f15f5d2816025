"""Closed polygons in the image plane, and the signed distance to them."""

import numpy as np

from oatkit.data import Grid

PIECES_PER_PIXEL = 8
"""How finely a polygon is cut to find the nearest part of it."""


def signed_distance(vertices_m: np.ndarray, grid: Grid) -> np.ndarray:
    """Return the distance of each pixel's centre from a closed polygon, m, negative inside, shape ``(ny, nx)``.

    `vertices_m` has the shape ``(n, 2)``, each ``(y, x)``; the last is joined to the first. Inside is what a ray to
    infinity leaves through an odd number of sides. The distance is exact but for points with two nearest sides: there
    it may be too large by less than 1/16 of a pixel, and by s^2 / 8 d (s = 1/8 of a pixel) at a distance d.
    """
    distance = _distance(vertices_m, grid)
    return np.where(contains(vertices_m, grid), -distance, distance)


def contains(vertices_m: np.ndarray, grid: Grid) -> np.ndarray:
    """Say which pixels have their centre inside a closed polygon of shape ``(n, 2)``, by the number of crossings."""
    y0, x0 = vertices_m.T
    y1, x1 = np.roll(vertices_m, -1, axis=0).T
    inside = np.zeros(grid.shape, bool)
    for row, y in enumerate(grid.y_m):
        crossed = (y0 <= y) != (y1 <= y)
        across = x0[crossed] + (y - y0[crossed]) / (y1 - y0)[crossed] * (x1 - x0)[crossed]
        inside[row] = np.searchsorted(np.sort(across), grid.x_m) % 2 == 1
    return inside


def area(vertices_m: np.ndarray) -> float:
    """Return the area inside a simple closed polygon, positive where it runs anticlockwise (x right, y up)."""
    y, x = (vertices_m - vertices_m.mean(0)).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def centroid(vertices_m: np.ndarray) -> np.ndarray:
    """Return the centre ``(y, x)`` of the area inside a simple closed polygon."""
    middle = vertices_m.mean(0)
    (y0, x0), (y1, x1) = (vertices_m - middle).T, (np.roll(vertices_m, -1, axis=0) - middle).T
    parts = x0 * y1 - x1 * y0
    return middle + np.array([((y0 + y1) * parts).sum(), ((x0 + x1) * parts).sum()]) / (3 * parts.sum())


def crossings(vertices_m: np.ndarray) -> np.ndarray:
    """Return the pairs of sides of a closed polygon that cross, shape ``(n, 2)``, each ``i < j``; side i starts at i.

    Sides that only touch at their ends do not cross.
    """
    start, end = vertices_m, np.roll(vertices_m, -1, axis=0)
    side_of_start = _side(start[:, None], end[:, None], start[None, :])
    side_of_end = _side(start[:, None], end[:, None], end[None, :])
    parts = side_of_start * side_of_end < 0
    return np.argwhere(np.triu(parts & parts.T))


def without_loops(vertices_m: np.ndarray) -> np.ndarray:
    """Return a closed polygon without the smaller part of each figure of eight that it makes."""
    while len(pairs := crossings(vertices_m)):
        first, last = min(pairs, key=lambda pair: min(pair[1] - pair[0], len(vertices_m) - (pair[1] - pair[0])))
        inner = np.arange(len(vertices_m))
        looped = (inner > first) & (inner <= last)
        vertices_m = vertices_m[~looped if 2 * looped.sum() <= len(vertices_m) else looped]
    return vertices_m


def resampled(vertices_m: np.ndarray, spacing_m: float) -> np.ndarray:
    """Return points at equal spacing, `spacing_m` or a little less, along a closed polygon; at least eight."""
    closed = np.vstack([vertices_m, vertices_m[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    n = max(8, int(np.ceil(along[-1] / spacing_m)))
    at = np.arange(n) * along[-1] / n
    return np.column_stack([np.interp(at, along, closed[:, axis]) for axis in (0, 1)])


def _side(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Say on which side of a line points lie: positive, negative, or zero on it."""
    along, off = end - start, point - start
    return np.sign(along[..., 0] * off[..., 1] - along[..., 1] * off[..., 0])


def _distance(vertices_m: np.ndarray, grid: Grid) -> np.ndarray:
    from scipy.spatial import cKDTree

    points = _cut(vertices_m, grid.pixel_size_m / PIECES_PER_PIXEL)
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    centres = np.column_stack([y.ravel(), x.ravel()])
    nearest = cKDTree(points).query(centres)[1]
    before, at, after = (points[(nearest + step) % len(points)] for step in (-1, 0, 1))
    return np.minimum(_to_piece(centres, before, at), _to_piece(centres, at, after)).reshape(grid.shape)


def _cut(vertices_m: np.ndarray, spacing_m: float) -> np.ndarray:
    """Return the vertices with points between them, none further than `spacing_m` from the next."""
    sides = np.roll(vertices_m, -1, axis=0) - vertices_m
    counts = np.maximum(1, np.ceil(np.hypot(*sides.T) / spacing_m).astype(int))
    start = np.repeat(np.arange(len(vertices_m)), counts)
    part = np.arange(len(start)) - np.repeat(np.cumsum(counts) - counts, counts)
    return vertices_m[start] + (part / counts[start])[:, None] * sides[start]


def _to_piece(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distance of each point from its own straight piece."""
    along, off = end - start, points - start
    length = np.einsum("ij,ij->i", along, along)
    share = np.einsum("ij,ij->i", off, along) / np.where(length > 0, length, 1)
    return np.hypot(*(off - np.clip(share, 0, 1)[:, None] * along).T)
