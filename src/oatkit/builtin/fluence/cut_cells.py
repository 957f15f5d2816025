"""The cells of a grid as the wall of the body cuts them: volumes, open parts of faces, pieces of wall."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from oatkit.api import Grid


@dataclass(frozen=True)
class CutCells:
    """The part of each pixel that lies in the body.

    A pixel is divided into four triangles that meet at its centre; in each, the signed distance is linear between the
    value at the centre and those at two corners (each corner the mean of the four pixels around it). Whatever the wall
    does, the outward normals of the pieces of wall in a cell, times their lengths, then sum up to the difference of
    the open parts of its faces: the divergence theorem holds in every cell.

    At the edge of the grid the distance is continued linearly by half a pixel, and what is open there is closed.
    """

    cells: np.ndarray
    """Raveled index of each pixel with a part in the body, shape ``(cell,)``, rising."""
    position: np.ndarray
    """Where each pixel is in `cells`, -1 for one outside, shape ``(y, x)``."""
    pixel_size: float
    """m."""
    volume: np.ndarray
    """Area in the body, shape ``(cell,)``, m2."""
    pairs: np.ndarray
    """The two cells of each open face, positions in `cells`, shape ``(2, face)``."""
    opening: np.ndarray
    """Open part of each face over the distance of the centres, shape ``(face,)``, a pure number."""
    wall_cell: np.ndarray
    """Position in `cells` of each piece of wall, shape ``(piece,)``."""
    wall_length: np.ndarray
    """Shape ``(piece,)``, m."""
    wall_depth: np.ndarray
    """Distance of the centre of the pixel from the line of the piece, m, negative where the centre is outside."""
    wall_middle: np.ndarray
    """Middle of each piece, ``(y, x)`` from the centre of pixel (0, 0), shape ``(piece, 2)``, m."""
    wall_normal: np.ndarray
    """Outward unit normal ``(y, x)``, shape ``(piece, 2)``."""
    n_cut_off: int
    """Number of pixels at the edge of the grid where the body goes on beyond it."""

    def wall_points(self, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
        """Return y and x of the middles of the pieces of wall, m."""
        return self.wall_middle[:, 0] + grid.y_m[0], self.wall_middle[:, 1] + grid.x_m[0]

    @classmethod
    def of(cls, distance: np.ndarray, h: float) -> Self:
        """Cut pixels of side `h` (m) by the zero line of `distance`, shape ``(y, x)``, m, negative inside."""
        distance, corners = _settled(distance, h), _settled(corner_values(distance), h)
        share, wall = _cut(distance, corners)
        cells = np.flatnonzero(share.ravel() > 0)
        position = np.full(distance.size, -1)
        position[cells] = np.arange(len(cells))
        openings = [
            _open_part(corners[1:-1, :-1], corners[1:-1, 1:]),
            _open_part(corners[:-1, 1:-1], corners[1:, 1:-1]),
        ]
        index = position.reshape(distance.shape)
        sides = [(index[:-1], index[1:]), (index[:, :-1], index[:, 1:])]
        pairs = np.concatenate([np.array([a.ravel(), b.ravel()]) for a, b in sides], axis=1)
        opening = np.concatenate([part.ravel() for part in openings])
        kept = opening > 0
        edges = [corners[0], corners[-1], corners[:, 0], corners[:, -1]]
        n_cut_off = sum(int((_open_part(edge[:-1], edge[1:]) > 0).sum()) for edge in edges)
        return cls(
            cells, index, h, share.ravel()[cells] * h**2, pairs[:, kept], opening[kept], position[wall.pixel],
            wall.length * h, wall.depth * h, wall.middle * h, wall.normal, n_cut_off,
        )  # fmt: skip


@dataclass(frozen=True)
class _Wall:
    """Pieces of wall, lengths in pixels."""

    pixel: np.ndarray
    length: np.ndarray
    depth: np.ndarray
    middle: np.ndarray
    normal: np.ndarray


def _settled(values: np.ndarray, h: float) -> np.ndarray:
    """Return `values` with those next to zero at zero: a wall through a corner cuts no sliver off by rounding."""
    return np.where(abs(values) < 1e-9 * h, 0, values)


def corner_values(distance: np.ndarray) -> np.ndarray:
    """Return the signed distance at the corners of the pixels, shape ``(y + 1, x + 1)``."""
    padded = _continued(_continued(distance).T).T
    return (padded[:-1, :-1] + padded[1:, :-1] + padded[:-1, 1:] + padded[1:, 1:]) / 4


def _continued(values: np.ndarray) -> np.ndarray:
    """Return `values` with a row before and one after, continued linearly, but not into a body that is not seen."""
    if len(values) == 1:
        return np.repeat(values, 3, axis=0)
    before, after = 2 * values[:1] - values[1:2], 2 * values[-1:] - values[-2:-1]
    before, after = (
        np.where(seen < 0, new, np.maximum(new, 0)) for new, seen in ((before, values[:1]), (after, values[-1:]))
    )
    return np.concatenate([before, values, after])


def _open_part(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the part of the line from value `a` to value `b` on which the linear function is negative."""
    inside = np.minimum(a, b)
    cut = (a < 0) != (b < 0)
    return np.where(cut, inside / np.where(cut, inside - np.maximum(a, b), 1), inside < 0)


# Corners of a pixel (y, x), and the two of each of its four triangles.
_CORNERS = ((0, 0), (0, 1), (1, 1), (1, 0))
_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))


def _cut(distance: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, _Wall]:
    """Return the share of each pixel in the body, and all pieces of wall."""
    ny, nx = distance.shape
    at = [corners[y : y + ny, x : x + nx].ravel() for y, x in _CORNERS]
    share = np.zeros(distance.size)
    pieces = []
    for first, second in _SIDES:
        values = np.array([distance.ravel(), at[first], at[second]])
        points = np.array([(0, 0), np.subtract(_CORNERS[first], 0.5), np.subtract(_CORNERS[second], 0.5)])
        share += _triangle_share(values) / 4
        pixel = np.flatnonzero((values.min(axis=0) < 0) & (values.max(axis=0) >= 0))
        pieces.append(_triangle_wall(pixel, values[:, pixel], points))
    wall = _Wall(*(np.concatenate([getattr(p, name) for p in pieces]) for name in _Wall.__dataclass_fields__))
    pixels = np.column_stack(np.divmod(wall.pixel, nx))
    return share.reshape(distance.shape), _Wall(wall.pixel, wall.length, wall.depth, wall.middle + pixels, wall.normal)


def _triangle_share(values: np.ndarray) -> np.ndarray:
    """Return the share of a triangle in which the linear function with these `values` (3, n) is negative."""
    n_inside = (values < 0).sum(axis=0)
    cut = (n_inside == 1) | (n_inside == 2)
    # The corner that the wall cuts off is similar to the triangle.
    lone, b, c = np.take_along_axis(values, _lone_first(values), axis=0)
    corner = np.where(cut, lone**2 / np.where(cut, (lone - b) * (lone - c), 1), 0)
    return np.where(n_inside == 1, corner, np.where(n_inside == 2, 1 - corner, n_inside == 3))


def _lone_first(values: np.ndarray) -> np.ndarray:
    """Return the order of vertices, turned so that the first is the one whose sign the other two do not have."""
    lone = np.where((values < 0).sum(axis=0) == 1, np.argmin(values, axis=0), np.argmax(values, axis=0))
    return (lone + np.arange(3)[:, None]) % 3


def _triangle_wall(pixel: np.ndarray, values: np.ndarray, points: np.ndarray) -> _Wall:
    """Return the piece of the zero line in each triangle of vertices `points` (3, 2), where it is no mere point."""
    order = _lone_first(values)
    lone, b, c = np.take_along_axis(values, order, axis=0)
    p, q, r = points[order]
    start = p + (lone / (lone - b))[:, None] * (q - p)
    end = p + (lone / (lone - c))[:, None] * (r - p)
    along = end - start
    length = np.hypot(*along.T)
    kept = length > 0
    outwards = np.where(lone < 0, 1, -1)[kept]
    middle = ((start + end) / 2)[kept]
    normal = (outwards / length[kept])[:, None] * np.column_stack([along[kept, 1], -along[kept, 0]])
    # Turned so that it points away from the lone vertex where that is inside, towards it where it is outside.
    normal *= np.sign(((middle - p[kept]) * normal).sum(axis=1) * outwards)[:, None]
    return _Wall(pixel[kept], length[kept], (middle * normal).sum(axis=1), middle, normal)
