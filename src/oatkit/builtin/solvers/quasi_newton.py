"""Descent by minimising the penalty with a stand-in for A^T A: many cheap steps between two products."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np

from oatkit.builtin.solvers.point import Point
from oatkit.builtin.solvers.stand_in import Model, StandIn
from oatkit.vectors import inner

LEAST_FIT = 0.5
"""Least cosine between what the stand-in says of the first step and what A^T A does to it: below, the operator is not
nearly shift-invariant, and the stand-in of no use."""

MOST_STEPS = 40
"""Most steps: by then a stand-in that is of use has brought the image to where other steps can go on."""


P = TypeVar("P", bound=Point)
Minimise = Callable[[Model, float, P], np.ndarray]
"""From a model of the problem, its curvature and the point so far: the image of least objective on it."""


def quasi_newton(start: P, minimise: Minimise[P]) -> Iterator[P]:
    """Yield points of ever smaller objective, each after one product; the first is `start`, after that of the stand-in.

    Each step goes to the minimum of the objective in which the stand-in takes the place of A^T A, or part of the way
    there (a proximal quasi-Newton method [Lee2014]_). It ends where that leads no further down, or where the operator
    turns out not to be nearly shift-invariant; another method can go on from the last point.

    References:
        [Lee2014] Lee, Sun and Saunders, SIAM J. Optim. 24, 1420 (2014), 10.1137/130921428.
    """
    stand_in = StandIn.of(start.objective.problem)
    yield start
    if stand_in is None:
        return
    point = start
    for step in range(MOST_STEPS):
        image = minimise(Model.at(stand_in, point.image, point.slope), stand_in.curvature(), point)
        aim = point.objective.at(image)
        move, change = aim.image - point.image, aim.slope - point.slope
        share = _share(point, aim, move, change)
        useful = stand_in.learn(move, change) >= LEAST_FIT or step > 0
        point = _between(point, aim, share) if share > 0 else point
        yield point
        if share == 0 or not useful:
            return


def _share(point: P, aim: P, move: np.ndarray, change: np.ndarray) -> float:
    """Return how far to go from `point` to `aim`, from 0 to 1.

    To the minimum of the objective with its penalty replaced by the chord, which a convex penalty stays below.
    """
    descent = -2 * inner(point.slope, move) - point.objective.weight * (aim.penalty - point.penalty)
    curvature = 2 * inner(move, change)
    if not descent > 0:
        return 0.0
    return min(1.0, descent / curvature) if curvature > 0 else 1.0


def _between(point: P, aim: P, share: float) -> P:
    """Return the point at a share of the way: A is linear, so that it costs no product."""
    if share == 1:
        return aim
    names = ("image", "misfit", "slope")
    mixed = {name: (1 - share) * getattr(point, name) + share * getattr(aim, name) for name in names}
    return replace(point, **mixed)
