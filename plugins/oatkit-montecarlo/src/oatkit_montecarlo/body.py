"""The body as light sees it: where its wall is, and how much of each pixel lies within."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from oatkit.api import Image, SolverError, ValidationError


@dataclass(frozen=True)
class Body:
    """A body bounded by straight pieces of wall, all lengths in pixels.

    A pixel is divided into four triangles that meet at its centre; in each, the signed distance is linear between the
    value at the centre and those at two corners, each corner being the mean of the four pixels around it. The wall is
    where that is zero, so it has no gap. At the edge of the grid the distance is continued by half a pixel; a body
    that goes on beyond it is mirrored there.
    """

    centre: np.ndarray
    """Signed distance at the centres of the pixels, shape ``(y, x)``."""
    corner: np.ndarray
    """The same at the corners, shape ``(y + 1, x + 1)``."""
    walled: np.ndarray
    """Whether the pixel is not wholly in the body, shape ``(y, x)``."""
    share: np.ndarray
    """Share of the pixel that lies in the body, shape ``(y, x)``."""
    wall: "Wall"

    @property
    def inside(self) -> np.ndarray:
        """Whether the centre lies in the body, shape ``(y, x)``."""
        return np.asarray(self.centre < 0)

    @property
    def n_cut_off(self) -> int:
        """Number of pixels at the edge of the grid where the body goes on beyond it."""
        edges = (self.corner[0], self.corner[-1], self.corner[:, 0], self.corner[:, -1])
        return sum(int((np.minimum(edge[:-1], edge[1:]) < 0).sum()) for edge in edges)

    @classmethod
    def of(cls, boundary: Image) -> Self:
        """Return the body within a boundary.

        Raises `ValidationError` where the image holds no signed distance, `SolverError` where there is no body.
        """
        distance = _signed_distance(boundary) / boundary.grid.pixel_size_m
        centre, corner = _settled(distance), _settled(_corners(distance))
        ny, nx = centre.shape
        at = [corner[y : y + ny, x : x + nx].ravel() for y, x in CORNERS]
        walled = np.max([centre.ravel(), *at], axis=0) >= 0
        share = np.zeros(centre.size)
        pieces = []
        for first, second in SIDES:
            values = np.array([centre.ravel(), at[first], at[second]])
            share += _share(values) / 4
            points = np.array([(0.5, 0.5), CORNERS[first], CORNERS[second]])
            pieces.append(Wall.in_triangle(values, points, nx))
        wall = Wall(*(np.concatenate([getattr(p, name) for p in pieces]) for name in Wall.__dataclass_fields__))
        return cls(centre, corner, walled.reshape(ny, nx), share.reshape(ny, nx), wall)


@dataclass(frozen=True)
class Wall:
    """Straight pieces of wall, in pixels from the corner of pixel (0, 0)."""

    cell: np.ndarray
    """The pixel ``(y, x)`` of each, shape ``(piece, 2)``."""
    start: np.ndarray
    """``(y, x)``, shape ``(piece, 2)``."""
    end: np.ndarray
    """``(y, x)``, shape ``(piece, 2)``."""
    outwards: np.ndarray
    """Unit normal ``(y, x)``, shape ``(piece, 2)``."""

    @property
    def length(self) -> np.ndarray:
        """Shape ``(piece,)``."""
        return np.asarray(np.hypot(*(self.end - self.start).T))

    @property
    def middle(self) -> np.ndarray:
        """``(y, x)``, shape ``(piece, 2)``."""
        return np.asarray((self.start + self.end) / 2)

    @classmethod
    def in_triangle(cls, values: np.ndarray, points: np.ndarray, nx: int) -> Self:
        """Return the zero line in one triangle of every pixel; `values` (3, pixel) stand at `points` (3, 2)."""
        crossed = [(values[a] < 0) != (values[b] < 0) for a, b in EDGES]
        pixel = np.flatnonzero(np.any(crossed, axis=0))
        values = values[:, pixel]
        ends = np.full((2, len(pixel), 2), np.nan)
        for (a, b), hit in zip(EDGES, crossed, strict=True):
            hit = hit[pixel]
            part = values[a, hit] / (values[a, hit] - values[b, hit])
            slot = np.isfinite(ends[0, hit, 0]).astype(int)
            ends[slot, np.flatnonzero(hit)] = points[a] + part[:, None] * (points[b] - points[a])
        kept = np.hypot(*(ends[1] - ends[0]).T) > 0
        gradient = np.linalg.solve(points[1:] - points[0], values[1:] - values[0])[:, kept]
        cell = np.column_stack(np.divmod(pixel[kept], nx))
        start, end = ends[:, kept] + cell
        return cls(cell, start, end, (gradient / np.hypot(*gradient)).T)


# Corners of a pixel (y, x), the two of each of its triangles, and the edges of a triangle.
CORNERS = ((0, 0), (0, 1), (1, 1), (1, 0))
SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))
EDGES = ((0, 1), (1, 2), (2, 0))


def _signed_distance(boundary: Image) -> np.ndarray:
    """Return the signed distance, shape ``(y, x)``, m, checked."""
    if boundary.unit != "m" or len(boundary.values) != 1:
        raise ValidationError(
            f"boundary: expected one plane of signed distance in m, negative inside, got {len(boundary.values)} "
            f"planes of {boundary.quantity} in '{boundary.unit}'"
        )
    distance = boundary.values[0].astype(float)
    if not np.isfinite(distance).all():
        raise ValidationError("boundary: the signed distance must be finite in every pixel")
    if not (distance < 0).any():
        raise SolverError("fluence: no pixel lies inside the boundary (signed distance below 0 m); there is no body")
    return distance


def _settled(values: np.ndarray) -> np.ndarray:
    """Return `values` with those next to zero at zero: a wall through a corner cuts no sliver off by rounding."""
    return np.where(abs(values) < 1e-9, 0, values)


def _corners(distance: np.ndarray) -> np.ndarray:
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


def _share(values: np.ndarray) -> np.ndarray:
    """Return the share of a triangle in which the linear function with these `values` (3, pixel) is negative."""
    n_inside = (values < 0).sum(axis=0)
    order = np.argsort(values, axis=0)
    low, middle, high = np.take_along_axis(values, order, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one = low**2 / ((low - middle) * (low - high))
        two = 1 - high**2 / ((high - middle) * (high - low))
    return np.select([n_inside == 0, n_inside == 1, n_inside == 2], [0.0, one, two], 1.0)
