"""Accelerated proximal gradients, restarted where they stop descending."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from oatkit.builtin.regularizers.dual_prox import Proximal, proximal
from oatkit.builtin.solvers.sparse_objective import SparseObjective, SparsePoint
from oatkit.vectors import inner, norm

INNER_STEPS = 1000
"""Largest number of steps for one proximal point."""

INNER_SHARE = 0.5
"""A proximal point need not be nearer than this part of what the image moved in the step before."""


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the method."""

    point: SparsePoint
    dual: np.ndarray
    """y with magnitudes up to w of the proximal point."""
    move: float
    """How far the proximal gradient step went, and could have gone if the proximal point were exact, relative to the
    image."""


def proximal_gradient(start: SparsePoint, tolerance: float, dual: np.ndarray | None) -> Iterator[Step]:
    """Yield the steps of FISTA [Beck2009]_ towards the minimum of P, without end.

    Momentum is dropped where it points uphill [ODonoghue2015]_. One application of A^T A in a step: A x and A^T A x of
    the extrapolated point are extrapolated with it. Proximal points without closed form start from the dual variable
    of the one before (the first from `dual`), and are sought as finely as the steps are long, or as `tolerance` asks.

    References:
        [Beck2009] Beck and Teboulle, SIAM J. Imaging Sci. 2, 183 (2009), 10.1137/080716542.
        [ODonoghue2015] O'Donoghue and Candes, Found. Comput. Math. 15, 715 (2015), 10.1007/s10208-013-9150-3.
    """
    objective = start.objective
    previous = point = start
    momentum, y = 1.0, None if dual is None else dual / (2 * objective.rate)
    moved = norm(point.slope) / objective.rate
    while True:
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        beta = (momentum - 1) / following
        ahead = point.image + beta * (point.image - previous.image)
        slope = point.slope + beta * (point.slope - previous.slope)
        fine = max(INNER_SHARE * moved, tolerance * norm(point.image))
        found = _proximal_point(objective, ahead - slope / objective.rate, fine, y)
        new, y = objective.at(found.image), found.dual
        uphill = inner(ahead - new.image, new.image - point.image) > 0
        previous, point, momentum = point, new, 1.0 if uphill else following
        moved = norm(new.image - ahead)
        yield Step(point, 2 * objective.rate * y, _relative(np.sqrt(moved**2 + 2 * found.gap), norm(new.image)))


def judged(point: SparsePoint, tolerance: float, dual: np.ndarray | None) -> Step:
    """Return a point as a step: with the dual variable and the length of the proximal gradient step from it."""
    objective = point.objective
    y = None if dual is None else dual / (2 * objective.rate)
    size = norm(point.image)
    found = _proximal_point(objective, point.image - point.slope / objective.rate, tolerance * size, y)
    moved = norm(found.image - point.image)
    return Step(point, 2 * objective.rate * found.dual, _relative(np.sqrt(moved**2 + 2 * found.gap), size))


def _proximal_point(objective: SparseObjective, image: np.ndarray, fine: float, dual: np.ndarray | None) -> Proximal:
    step = objective.weight / (2 * objective.rate)
    return proximal(objective.analysis, image, step, objective.non_negative, fine**2 / 2, INNER_STEPS, dual)


def _relative(move: float, size: float) -> float:
    if size == 0:
        return 0.0 if move == 0 else float("inf")
    return move / size
