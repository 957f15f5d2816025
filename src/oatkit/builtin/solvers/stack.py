"""Least squares with a quadratic penalty as plain least squares: data and penalty in one operator."""

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic
from oatkit.builtin.solvers.preconditioner import Preconditioner
from oatkit.vectors import norm


class Stack:
    """S = [A; sqrt(w) L] M^-1: images z = M x on one side, data with the penalty's rows below on the other."""

    def __init__(
        self, problem: Problem, regularizer: Quadratic, weight: float, preconditioner: Preconditioner | None
    ) -> None:
        self.problem, self.regularizer, self.weight, self.preconditioner = problem, regularizer, weight, preconditioner
        self.penalty = regularizer.operator(problem.shape)

    def with_zeros(self, data: np.ndarray) -> np.ndarray:
        """Return data with zeros below for the penalty."""
        return np.concatenate([data, np.zeros(self.penalty.shape[0])])

    def undone(self, image: np.ndarray) -> np.ndarray:
        """Return M^-1 times an image."""
        return self.preconditioner.undo(image) if self.preconditioner else image

    def stretch(self, image: np.ndarray) -> float:
        """Return |M z| of a z of norm 1."""
        return norm(self.preconditioner.apply(image)) if self.preconditioner else 1.0

    def forward(self, image: np.ndarray) -> np.ndarray:
        """Return S z."""
        image = self.undone(image)
        below = np.sqrt(self.weight) * self.penalty.matvec(image.ravel())
        return np.concatenate([self.problem.forward(image), below])

    def adjoint(self, rows: np.ndarray) -> np.ndarray:
        """Return S^T y."""
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
