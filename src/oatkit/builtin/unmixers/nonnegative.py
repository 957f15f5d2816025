"""Non-negative least squares for all pixels at once, exactly."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

MOST_ENUMERATED = 4
"""Unknowns up to which all sets of positive ones are tried: 2^n of them."""
MOST_EXCHANGES = 3
"""How often blocks are exchanged without fewer unknowns being wrong, before they are exchanged one by one."""


def nonnegative(matrix: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Return for each pixel the x >= 0 that minimises |matrix x - data|, shape ``(pixel, unknown)``.

    `matrix` has the shape ``(datum, unknown)``, `data` ``(pixel, datum)``. Up to `MOST_ENUMERATED` unknowns, the
    least-squares solution of every set of unknowns is found, the others being zero; the best of those that are not
    negative is the answer, for the minimum over x >= 0 is one of them. Above, sets are exchanged block by block until
    they obey the conditions of Karush, Kuhn and Tucker [Kim2011]_. Where columns depend on each other, the answer is
    one of many.

    References:
        [Kim2011] Kim and Park, SIAM J. Sci. Comput. 33, 3261 (2011), 10.1137/110821172.
    """
    size = np.linalg.norm(matrix, axis=0)
    scale = np.where(size > 0, size, 1)[:, None]
    # Only the part of the data within the span of the columns matters, and that has few numbers.
    basis, triangle = np.linalg.qr(matrix / scale.T)
    seen = basis.T @ data.T
    solve = _enumerated if len(scale) <= MOST_ENUMERATED else _pivoted
    return np.asarray((solve(triangle, seen) / scale).T)


def least_squares(matrix: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Return for each pixel the x of least |matrix x - data|, of any sign, shape ``(pixel, unknown)``; shapes as above.

    Where that is not unique, the shortest such x.
    """
    return np.asarray(data @ np.linalg.pinv(matrix).T)


def _enumerated(matrix: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Return x of shape ``(unknown, pixel)`` for data of shape ``(datum, pixel)``."""
    n = matrix.shape[1]
    best = np.linalg.pinv(matrix) @ data
    # Where the solution without any bound is not negative, nothing can be better.
    left = np.flatnonzero((best < 0).any(0))
    data, found, gained = data[:, left], np.zeros((n, len(left))), np.zeros(len(left))
    for chosen in (list(c) for size in range(1, n) for c in combinations(range(n), size)):
        part = matrix[:, chosen]
        values = np.linalg.pinv(part) @ data
        # Of a least-squares solution, |part x|^2 is by how much it lowers |data|^2.
        gain = ((part @ values) ** 2).sum(0)
        gain[(values < 0).any(0)] = 0
        better = gain > gained
        gained = np.where(better, gain, gained)
        found *= ~better
        found[chosen] += values * better
    best[:, left] = found
    return best


def _pivoted(matrix: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Return the same by block principal pivoting, the pixels that share a set being solved together."""
    n, pixels = matrix.shape[1], data.shape[1]
    tolerance = 1e-12 * np.linalg.norm(data, axis=0)
    found, slope = np.zeros((n, pixels)), -matrix.T @ data
    positive = np.zeros((n, pixels), bool)
    fewest, trials = np.full(pixels, n + 1), np.full(pixels, MOST_EXCHANGES)
    open_ = np.arange(pixels)
    while len(open_):
        wrong = np.where(positive, found, slope)[:, open_] < -tolerance[open_]
        count = wrong.sum(0)
        open_, wrong, count = open_[count > 0], wrong[:, count > 0], count[count > 0]
        improved = count < fewest[open_]
        fewest[open_] = np.minimum(count, fewest[open_])
        trials[open_] = np.where(improved, MOST_EXCHANGES, trials[open_] - 1)
        positive[:, open_] ^= np.where(trials[open_] >= 0, wrong, _last_alone(wrong))
        for chosen, group in _groups(positive[:, open_]):
            at = open_[group]
            values = np.zeros((n, len(at)))
            values[chosen] = np.linalg.pinv(matrix[:, chosen]) @ data[:, at]
            found[:, at], slope[:, at] = values, matrix.T @ (matrix @ values - data[:, at])
    return np.maximum(found, 0)


def _last_alone(wrong: np.ndarray) -> np.ndarray:
    """Return in each column only the last one that is set: exchanging that alone cannot go in circles."""
    return np.asarray(wrong & (np.cumsum(wrong[::-1], axis=0)[::-1] == 1))


def _groups(sets: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield each distinct column of `sets`, bool, and the numbers of the columns that equal it."""
    code = (1 << np.arange(len(sets), dtype=np.int64)) @ sets
    order = np.argsort(code, kind="stable")
    starts = np.flatnonzero(np.diff(code[order], prepend=-1))
    for group in np.split(order, starts[1:]) if len(order) else ():
        yield sets[:, group[0]], group
