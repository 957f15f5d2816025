"""The cheapest closed path around a strip, by dynamic programming."""

import numpy as np


def cheapest_closed_path(cost: np.ndarray, bending: float, max_step: int) -> np.ndarray:
    r"""Return the column in each row of the closed path that minimises, over all closed paths,

    .. math:: \sum_i C_{i, k_i} + b \sum_i (k_{i+1} - k_i)^2, \qquad |k_{i+1} - k_i| \le s

    with indices i counted around the strip. `cost` is finite, of shape ``(along, across)``.

    It is exact, by branch and bound [Sun2003]_: the cheapest open path from a column of the first row bounds the closed
    ones from below, and the closed path through one column lies between those through its neighbours, since a convex
    price of steps makes crossing paths no cheaper than uncrossed ones.

    References:
        [Sun2003] Sun and Pallottino, Pattern Recognition 36, 709 (2003), 10.1016/S0031-3203(02)00085-7.
    """
    # Where few columns come near the best one, few starts have to be tried.
    best, usual = cost.min(axis=1, keepdims=True), np.median(cost, axis=1, keepdims=True)
    first = int(np.argmin((cost < 0.5 * (best + usual)).sum(axis=1)))
    price = bending * np.arange(-max_step, max_step + 1, dtype=float) ** 2
    return np.roll(_from_first_row(np.roll(cost, -first, axis=0), price), first)


def _from_first_row(cost: np.ndarray, price: np.ndarray) -> np.ndarray:
    bound = _open_costs(cost, price)
    limits = np.zeros(len(cost), int), np.full(len(cost), cost.shape[1] - 1)
    best, path = np.inf, limits[0]
    intervals = [(0, cost.shape[1], *limits)]
    while intervals:
        begin, end, left, right = intervals.pop()
        start = begin + int(np.argmin(bound[begin:end])) if begin < end else -1
        if start < 0 or not bound[start] < best:
            continue
        total, found = _between(cost, price, start, left, right)
        if total < best:
            best, path = total, found
        intervals += [(begin, start, left, found), (start + 1, end, found, right)]
    return path


def _open_costs(cost: np.ndarray, price: np.ndarray) -> np.ndarray:
    """Return, for each column of the first row, the cost of the cheapest path once around that starts there."""
    total = _cheapest_step(np.zeros(cost.shape[1]), price)[0]
    for row in cost[:0:-1]:
        total = _cheapest_step(total + row, price)[0]
    return total + cost[0]


def _between(
    cost: np.ndarray, price: np.ndarray, start: int, left: np.ndarray, right: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return cost and columns of the cheapest closed path through `start` that stays within two others."""
    low, high = int(left.min()), int(right.max()) + 1
    column = np.arange(low, high)
    barred = (column < left[:, None]) | (column > right[:, None])
    total, path = _through(np.where(barred, np.inf, cost[:, low:high]), price, start - low)
    return total, path + low


def _through(cost: np.ndarray, price: np.ndarray, start: int) -> tuple[float, np.ndarray]:
    """Return cost and columns of the cheapest closed path through one column of the first row."""
    total = np.full(cost.shape[1], np.inf)
    total[start] = cost[0, start]
    came_from = np.zeros(cost.shape, int)
    for i in range(1, len(cost)):
        total, came_from[i] = _cheapest_step(total, price)
        total = total + cost[i]
    total, came_from[0] = _cheapest_step(total, price)
    path = np.empty(len(cost), int)
    at = start
    for i in range(len(cost) - 1, -1, -1):
        at = came_from[(i + 1) % len(cost), at]
        path[i] = at
    return float(total[start]), path


def _cheapest_step(total: np.ndarray, price: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least cost of stepping into each column from its neighbours, and from which of them."""
    reach = len(price) // 2
    padded = np.full(len(total) + 2 * reach, np.inf)
    padded[reach : reach + len(total)] = total
    candidates = np.lib.stride_tricks.sliding_window_view(padded, len(price)) + price
    choice = candidates.argmin(1)
    column = np.arange(len(total))
    # Where no step is possible, the first candidate is taken, which may lie outside.
    return candidates[column, choice], np.clip(column + choice - reach, 0, len(total) - 1)
