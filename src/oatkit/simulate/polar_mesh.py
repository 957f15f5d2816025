"""Triangles that follow the outline of a star-shaped body."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Self

import numpy as np

from oatkit.content import check_range
from oatkit.errors import ValidationError

Reach = Callable[[np.ndarray], np.ndarray]
"""How far an outline is from the origin in each direction (radians from the x axis towards y), m."""

PARTS = 3
"""A triangle is sampled in the middle of each of `PARTS`^2 equal parts of it."""


@dataclass(frozen=True, eq=False)
class PolarMesh:
    """A body cut into triangles between rings around the origin.

    Ring i of n has 6 i nodes at equal angles, each at i / n of the way to the outline: in every sixth of a turn the
    nodes are a triangular lattice, bent to the body. In a disc all sides are 1 to 1.45 times the distance of the rings.
    Coordinates on that lattice are known in closed form, so no search is needed to find the triangle of a point.

    Raises `ValidationError` where the outline goes back on itself so sharply that triangles turn over.
    """

    reach: Reach
    n_rings: int

    def __post_init__(self) -> None:
        check_range("n_rings", self.n_rings, 1, 2000, "a mesh of n rings has 3 n (n + 1) + 1 nodes")
        if not (self.areas_m2 > 0).all():
            raise ValidationError(f"outline: too jagged for a mesh of {self.n_rings} rings about the origin")

    @classmethod
    def with_spacing(cls, reach: Reach, spacing_m: float) -> Self:
        """Return the coarsest mesh with rings at most `spacing_m` apart in every direction."""
        check_range("spacing_m", spacing_m, 1e-6, 1e-2, "the unit is m, so 0.1 mm is 1e-4")
        farthest = reach(np.linspace(0, 2 * np.pi, 4096)).max()
        return cls(reach, ceil(farthest / spacing_m - 1e-9))

    @cached_property
    def points_m(self) -> np.ndarray:
        """The nodes, shape ``(node, 2)``, each ``(y, x)``, m: the origin, then ring after ring, anticlockwise."""
        counts = 6 * np.arange(1, self.n_rings + 1)
        ring = np.repeat(np.arange(1, self.n_rings + 1), counts)
        angle = (np.arange(len(ring)) - _first(ring) + 1) * (np.pi / 3) / ring
        radius = ring / self.n_rings * self.reach(angle)
        return np.concatenate([np.zeros((1, 2)), radius[:, None] * np.column_stack([np.sin(angle), np.cos(angle)])])

    @cached_property
    def triangles(self) -> np.ndarray:
        """The three nodes of each triangle, anticlockwise, shape ``(triangle, 3)``."""
        ring, along = np.array([(i, j) for i in range(self.n_rings) for j in range(i + 1)]).T
        found = []
        for sector in range(6):
            outwards = _triangle(sector, ring, along, False)
            inwards = _triangle(sector, ring, along, True)
            found += [outwards, inwards[along < ring]]
        return np.concatenate(found)

    @cached_property
    def wall(self) -> np.ndarray:
        """The two nodes of each side on the outline, anticlockwise, shape ``(side, 2)``."""
        n = 6 * self.n_rings
        last = np.arange(len(self.points_m) - n, len(self.points_m))
        return np.column_stack([last, np.roll(last, -1)])

    @cached_property
    def sides_m(self) -> np.ndarray:
        """The side opposite to each node of each triangle as a vector ``(y, x)``, shape ``(triangle, 3, 2)``, m."""
        corners = self.points_m[self.triangles]
        return np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)

    @cached_property
    def areas_m2(self) -> np.ndarray:
        """Area of each triangle, shape ``(triangle,)``, m2; negative where it is turned over."""
        y, x = np.moveaxis(self.sides_m, 2, 0)
        return (x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]) / 2

    @cached_property
    def samples_m(self) -> np.ndarray:
        """Points that cut each triangle into equal parts, shape ``(part, triangle, 2)``, each ``(y, x)``, m."""
        return np.einsum("pc,tcd->ptd", _middles(PARTS), self.points_m[self.triangles])

    def interpolate(self, values: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return values at nodes, shape ``(..., node)``, at the points of broadcast `y` and `x` (m).

        Linear between nodes in the coordinates of the lattice; beyond the outline, the value of the wall in that
        direction.
        """
        nodes, shares = self._located(y, x)
        return sum(values[..., node] * share for node, share in zip(nodes, shares, strict=True))

    def _located(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the three nodes around each point and their shares, each of shape ``(3, ...)``."""
        angle = np.arctan2(y, x) % (2 * np.pi)
        depth = np.minimum(np.hypot(y, x) / self.reach(angle), 1) * self.n_rings
        sector = np.minimum(angle // (np.pi / 3), 5).astype(int)
        across = np.clip(angle / (np.pi / 3) - sector, 0, 1) * depth
        # A point on the wall belongs to the last ring of triangles.
        ring = np.minimum(depth.astype(int), self.n_rings - 1)
        along = np.minimum(across.astype(int), ring)
        a, b = depth - ring, across - along
        inwards = b > a
        nodes = np.moveaxis(_triangle(sector, ring, along, inwards), -1, 0)
        outer = np.where(inwards, a - b, b - a)
        shares = np.where(inwards, [1 - b, a, -outer], [1 - a, -outer, b])
        return nodes, shares


def _first(ring: np.ndarray) -> np.ndarray:
    """Return the index of the first node of a ring from 1."""
    return 1 + 3 * ring * (ring - 1)


def _node(sector: np.ndarray | int, ring: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Return the index of a node by its place on the lattice of a sector; ring 0 is the origin."""
    return np.where(ring == 0, 0, _first(ring) + (sector * ring + along) % np.maximum(6 * ring, 1))


def _triangle(
    sector: np.ndarray | int, ring: np.ndarray, along: np.ndarray, inwards: np.ndarray | bool
) -> np.ndarray:  # fmt: skip
    """Return the nodes of the triangle that starts at a place of the lattice: one side outside, or one inside."""
    start, beside = _node(sector, ring, along), _node(sector, ring, along + 1)
    below, beyond = _node(sector, ring + 1, along), _node(sector, ring + 1, along + 1)
    return np.stack(
        [start, np.where(inwards, beyond, below), np.where(inwards, beside, beyond)], axis=-1
    )  # fmt: skip


def _middles(parts: int) -> np.ndarray:
    """Return the barycentric coordinates of the middles of the `parts`^2 equal parts of a triangle, shape (n, 3)."""
    outwards = [(i + 1 / 3, j + 1 / 3) for i in range(parts) for j in range(parts - i)]
    inwards = [(i + 2 / 3, j + 2 / 3) for i in range(parts - 1) for j in range(parts - 1 - i)]
    first, second = np.array(outwards + inwards).T / parts
    return np.column_stack([first, second, 1 - first - second])
