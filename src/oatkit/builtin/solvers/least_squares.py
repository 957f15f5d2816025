"""Regularized least squares by LSQR, one iterate at a time."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic
from oatkit.builtin.solvers.bidiagonalisation import Bidiagonalisation
from oatkit.builtin.solvers.preconditioner import Preconditioner
from oatkit.builtin.solvers.stack import Stack
from oatkit.vectors import norm

LEAST_FIT = 0.7
"""Least cosine between what a preconditioner says of the first step and what A^T A + w L^T L does to it: below, the
operator is not nearly shift-invariant, and LSQR goes on without."""


def least_squares(
    problem: Problem,
    regularizer: Quadratic,
    weight: float,
    n_iterations: int,
    tolerance: float,
    preconditioner: Preconditioner | None = None,
) -> Iterator[Iterate]:
    """Yield the iterates of LSQR [Paige1982]_ for min |A x - b|^2 + w |L x|^2, from x = 0.

    It bidiagonalises the stack of A and sqrt(w) L (Eq. 4 and 17 of [Prakash2019]_, whose lambda L is a misprint), times
    M^-1 with a preconditioner. It has converged where the gradient has fallen to `tolerance` of what it was at x = 0.
    """
    first = norm(problem.back_projected)
    if first == 0:
        yield _nothing_to_see(problem)
        return
    stack = Stack(problem, regularizer, weight, preconditioner)
    basis = Bidiagonalisation(stack, problem.data, problem.back_projected)
    image = np.zeros(problem.shape)
    w, phi_bar, rho_bar = basis.v, basis.beta, basis.alpha
    for iteration in range(1, n_iterations + 1):
        basis.advance()
        if preconditioner and iteration == 1 and basis.along < LEAST_FIT:
            yield Iterate(image, 0, products=1)
            for state in least_squares(problem, regularizer, weight, n_iterations, tolerance):
                yield replace(state, products=state.products + 1)
            return
        rho = float(np.hypot(rho_bar, basis.beta))
        c, s = rho_bar / rho, basis.beta / rho
        phi, phi_bar = c * phi_bar, s * phi_bar
        image = image + (phi / rho) * w
        w = basis.v - (s * basis.alpha / rho) * w
        rho_bar = -c * basis.alpha
        # The gradient of half the objective has the norm phi_bar * alpha * |c| [Paige1982, Eq. 5.6], along v.
        left = phi_bar * basis.alpha * abs(c) * stack.stretch(basis.v) / first
        state = stack.iterate(image, iteration, phi_bar)
        if left <= tolerance:
            yield replace(state, converged=True, reason=f"the gradient fell to {left:.1e} of its start")
            return
        if iteration == n_iterations:
            reason = f"stopped after {iteration} steps at a gradient of {left:.1e}; raise n_iterations"
            yield replace(state, reason=reason)
            return
        yield state


def _nothing_to_see(problem: Problem) -> Iterate:
    size = norm(problem.data)
    reason = "the data are zero" if size == 0 else "no image on this grid predicts anything of the data"
    return Iterate(np.zeros(problem.shape), 0, size**2, size, 0.0, products=0, converged=True, reason=reason)
