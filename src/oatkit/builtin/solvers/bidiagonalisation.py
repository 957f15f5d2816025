"""Regularized least squares by LSQR, one iterate at a time."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic
from oatkit.builtin.solvers.preconditioner import Preconditioner
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
    stack = _Stack(problem, regularizer, weight, preconditioner)
    image = np.zeros(problem.shape)
    beta = norm(problem.data)
    u = stack.with_zeros(problem.data)
    first = norm(problem.back_projected)
    if first == 0:
        reason = "the data are zero" if beta == 0 else "no image on this grid predicts anything of the data"
        yield Iterate(image, 0, beta**2, beta, 0.0, products=0, converged=True, reason=reason)
        return
    v = stack.undone(problem.back_projected)
    alpha = norm(v)
    u, v, alpha = u / beta, v / alpha, alpha / beta
    w, phi_bar, rho_bar = v, beta, alpha
    for iteration in range(1, n_iterations + 1):
        before = alpha
        u = stack.forward(v) - alpha * u
        beta = norm(u)
        u = u / beta if beta > 0 else u
        v = stack.adjoint(u) - beta * v
        alpha = norm(v)
        v = v / alpha if alpha > 0 else v
        if preconditioner and iteration == 1 and not _fits(before, beta, alpha):
            yield Iterate(image, 0, products=1)
            for state in least_squares(problem, regularizer, weight, n_iterations, tolerance):
                yield replace(state, products=state.products + 1)
            return
        rho = float(np.hypot(rho_bar, beta))
        c, s = rho_bar / rho, beta / rho
        phi, phi_bar = c * phi_bar, s * phi_bar
        image = image + (phi / rho) * w
        w = v - (s * alpha / rho) * w
        rho_bar = -c * alpha
        # The gradient of half the objective has the norm phi_bar * alpha * |c| [Paige1982, Eq. 5.6], along v.
        gradient = phi_bar * alpha * abs(c) * stack.stretch(v)
        state = stack.iterate(image, iteration, phi_bar)
        if gradient <= tolerance * first:
            yield replace(state, converged=True, reason=f"the gradient fell to {gradient / first:.1e} of its start")
            return
        if iteration == n_iterations:
            reason = f"stopped after {iteration} steps at a gradient of {gradient / first:.1e}; raise n_iterations"
            yield replace(state, reason=reason)
            return
        yield state


def _fits(alpha: float, beta: float, next_alpha: float) -> bool:
    """Say whether the stack's S^T S v = (alpha^2 + beta^2) v + beta next_alpha v' lies along v."""
    along = alpha**2 + beta**2
    return along >= LEAST_FIT * np.hypot(along, beta * next_alpha)


class _Stack:
    """The operator [A; sqrt(w) L] M^-1: images z = M x on one side, data with the penalty's rows below on the other."""

    def __init__(
        self, problem: Problem, regularizer: Quadratic, weight: float, preconditioner: Preconditioner | None
    ) -> None:
        self.problem, self.regularizer, self.weight, self.preconditioner = problem, regularizer, weight, preconditioner
        self.penalty = regularizer.operator(problem.shape)

    def with_zeros(self, data: np.ndarray) -> np.ndarray:
        return np.concatenate([data, np.zeros(self.penalty.shape[0])])

    def undone(self, image: np.ndarray) -> np.ndarray:
        """Return M^-1 times an image."""
        return self.preconditioner.undo(image) if self.preconditioner else image

    def stretch(self, image: np.ndarray) -> float:
        """Return |M z| of a z of norm 1."""
        return norm(self.preconditioner.apply(image)) if self.preconditioner else 1.0

    def forward(self, image: np.ndarray) -> np.ndarray:
        image = self.undone(image)
        below = np.sqrt(self.weight) * self.penalty.matvec(image.ravel())
        return np.concatenate([self.problem.forward(image), below])

    def adjoint(self, rows: np.ndarray) -> np.ndarray:
        n = self.problem.data.size
        below = np.sqrt(self.weight) * self.penalty.rmatvec(rows[n:])
        return self.undone(self.problem.adjoint(rows[:n]) + below.reshape(self.problem.shape))

    def iterate(self, image: np.ndarray, iteration: int, stacked_norm: float) -> Iterate:
        """Return the state, with the residual of the data alone taken from that of the stack."""
        image = self.undone(image)
        penalty = self.regularizer.value(image)
        residual = float(np.sqrt(max(0.0, stacked_norm**2 - self.weight * penalty)))
        return Iterate(
            image,
            iteration,
            objective=stacked_norm**2,
            residual_norm=residual,
            penalty=penalty,
            products=iteration,
            details={"weight": self.weight},
        )
