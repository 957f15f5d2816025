"""Objects that are functions of the plane, averaged over pixels."""

from collections.abc import Callable
from itertools import product
from math import ceil

import numpy as np

from oatkit.data import Grid

SAMPLE_M = 25e-6
"""Largest spacing of the points that an object is sampled at, m."""

Density = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""An object: from y of shape ``(ny, 1)`` and x of shape ``(1, nx)``, m, to its values, shape ``(ny, nx)``."""


def area_average(density: Density, grid: Grid) -> np.ndarray:
    """Return the mean of `density` over each pixel of `grid`, float64 of the grid's shape.

    Each pixel is cut into equal squares of at most `SAMPLE_M`, at least two a side, and the density taken in the middle
    of each: one object on different grids is then the same up to the pixels that an edge crosses.
    """
    parts = max(2, ceil(grid.pixel_size_m / SAMPLE_M - 1e-9))
    offsets = ((np.arange(parts) + 0.5) / parts - 0.5) * grid.pixel_size_m
    y, x = grid.y_m[:, None], grid.x_m[None, :]
    total = np.zeros(grid.shape)
    for dy, dx in product(offsets, offsets):
        total += density(y + dy, x + dx)
    return total / parts**2
