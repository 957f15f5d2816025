"""Accelerated projected gradients, restarted where they stop descending."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic
from oatkit.vectors import inner, norm

SAFETY = 1.02
"""The spectral norms are estimated from below, at worst 2e-3 too low; steps are shortened by this factor."""


def projected_gradient(
    problem: Problem, regularizer: Quadratic, weight: float, n_iterations: int, tolerance: float
) -> Iterator[Iterate]:
    """Yield the iterates of FISTA [Beck2009]_ for min |A x - b|^2 + w |L x|^2 over x >= 0, from zero.

    Momentum is dropped where it points uphill [ODonoghue2015]_. One application of A^T A in a step: A x and A^T A x of
    the extrapolated point are extrapolated with it.
    """
    penalty = regularizer.operator(problem.shape)
    roughest = Problem(penalty, np.zeros(penalty.shape[0]), problem.shape).norm
    rate = SAFETY * (problem.norm**2 + weight * roughest**2)
    start = _Point(problem, penalty, weight, np.zeros(problem.shape))
    first = norm(start.slope)
    if first == 0:
        reason = "the data are zero, or no image on this grid predicts anything of them"
        yield replace(start.iterate(regularizer, 0), converged=True, reason=reason)
        return
    previous = point = start
    momentum = 1.0
    for iteration in range(1, n_iterations + 1):
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        beta = (momentum - 1) / following
        ahead = point.image + beta * (point.image - previous.image)
        slope = point.slope + beta * (point.slope - previous.slope)
        new = _Point(problem, penalty, weight, np.maximum(ahead - slope / rate, 0))
        uphill = inner(ahead - new.image, new.image - point.image) > 0
        previous, point, momentum = point, new, 1.0 if uphill else following
        # In units of the slope before the norm: squares of an image under a huge weight are too small for a float.
        left = norm(rate * (point.image - np.maximum(point.image - point.slope / rate, 0))) / first
        state = point.iterate(regularizer, iteration)
        if left <= tolerance:
            yield replace(state, converged=True, reason=f"the projected gradient fell to {left:.1e} of its start")
            return
        if iteration == n_iterations:
            reason = f"stopped after {iteration} steps at a projected gradient of {left:.1e}; raise n_iterations"
            yield replace(state, reason=reason)
            return
        yield state


class _Point:
    """An image with its misfit and half its gradient."""

    def __init__(self, problem: Problem, penalty: object, weight: float, image: np.ndarray) -> None:
        self.image, self.weight = image, weight
        self.misfit = problem.forward(image) - problem.data
        rough = penalty.rmatvec(penalty.matvec(image.ravel())).reshape(problem.shape)  # type: ignore[attr-defined]
        self.slope = problem.adjoint(self.misfit) + weight * rough

    def iterate(self, regularizer: Quadratic, iteration: int) -> Iterate:
        """Return it as the state after so many steps."""
        residual, penalty = norm(self.misfit), regularizer.value(self.image)
        return Iterate(
            self.image,
            iteration,
            objective=residual**2 + self.weight * penalty,
            residual_norm=residual,
            penalty=penalty,
            products=iteration + 1,
            details={"weight": self.weight},
        )
