"""Least squares under x >= 0."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import ClassVar

import numpy as np

from oatkit.api import Iterate, Problem, param
from oatkit.builtin.solvers.projected_gradient import projected_gradient
from oatkit.builtin.solvers.quadratic import QuadraticSolver
from oatkit.builtin.solvers.quadratic_objective import QuadraticObjective, QuadraticPoint
from oatkit.builtin.solvers.quasi_newton import quasi_newton
from oatkit.builtin.solvers.stand_in import Model
from oatkit.vectors import norm

CHEAP_STEPS = 150
"""Most projected gradient steps on the stand-in between two products."""

CHEAP_SHARE = 0.05
"""They end where the projected gradient has fallen to this part of where they started."""

STEPS_BETWEEN_CHECKS = 5
"""That is looked at after so many: it costs half a step."""


class Nnls(QuadraticSolver):
    """Non-negative least squares with a quadratic penalty, min |A x - b|^2 + w |L x|^2 over x >= 0.

    This is the true minimiser of Eq. 18 of [Prakash2019]_. It has converged where the projected gradient has fallen to
    `tolerance` of the gradient at x = 0. Where A^T A is nearly shift-invariant, as inside a detector array, most steps
    are taken on a convolution in its place [Lee2014]_; FISTA takes those that remain, and all for other operators.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
        [Lee2014] Lee, Sun and Saunders, SIAM J. Optim. 24, 1420 (2014), 10.1137/130921428.
        [Beck2009] Beck and Teboulle, SIAM J. Imaging Sci. 2, 183 (2009), 10.1137/080716542.
        [ODonoghue2015] O'Donoghue and Candes, Found. Comput. Math. 15, 715 (2015), 10.1007/s10208-013-9150-3.
    """

    name: ClassVar[str] = "nnls"
    steps_by_norm: ClassVar[bool] = True
    tolerance: float = param(3e-3, "stop where the projected gradient has fallen to this part", above=0, below=1)

    def descend(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates of the quasi-Newton method, then of FISTA."""
        objective = QuadraticObjective.of(problem, self.regularizer, weight)
        start = objective.at(np.zeros(problem.shape))
        first = norm(start.slope)
        if first == 0:
            reason = "the data are zero, or no image on this grid predicts anything of them"
            yield replace(_iterate(start, 0), converged=True, reason=reason)
            return
        yield _iterate(start, 0)
        for iteration, point in enumerate(islice(_points(start), self.n_iterations), 1):
            left = point.left / first
            state = _iterate(point, iteration)
            if left <= self.tolerance:
                reason = f"the projected gradient fell to {left:.1e} of its start"
                yield replace(state, converged=True, reason=reason)
                return
            if iteration == self.n_iterations:
                reason = f"stopped after {iteration} steps at a projected gradient of {left:.1e}; raise n_iterations"
                yield replace(state, reason=reason)
                return
            yield state


def _points(start: QuadraticPoint) -> Iterator[QuadraticPoint]:
    """Yield points towards the optimum, each after one product, without end."""
    point = start
    for point in quasi_newton(start, _on_stand_in):
        yield point
    yield from projected_gradient(point)


def _on_stand_in(model: Model, curvature: float, point: QuadraticPoint) -> np.ndarray:
    """Return the image that projected gradients reach on a stand-in."""
    here = start = replace(point.objective, problem=model, curvature=curvature).at(point.image)
    for step, here in enumerate(islice(projected_gradient(start), CHEAP_STEPS), 1):
        if step % STEPS_BETWEEN_CHECKS == 0 and here.left <= CHEAP_SHARE * start.left:
            break
    return here.image


def _iterate(point: QuadraticPoint, iteration: int) -> Iterate:
    return Iterate(
        point.image,
        iteration,
        objective=point.value,
        residual_norm=point.residual_norm,
        penalty=point.penalty,
        products=iteration + 1,
        details={"weight": point.objective.weight},
    )
