"""A change of variables after which least squares are nearly solved."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from oatkit.api import Problem, Quadratic
from oatkit.builtin.solvers.convolution import convolved, gains_of, penalty_gains


@dataclass(frozen=True, eq=False)
class Preconditioner:
    """M with M^2 near A^T A + w L^T L, a convolution: (A^T A + w L^T L) M^-2 has its singular values near 1."""

    gains: np.ndarray
    """Of M, over half of the frequencies."""

    @classmethod
    def of(cls, problem: Problem, regularizer: Quadratic, weight: float) -> Self | None:
        """Make one by a single product with A^T A; None where the pixel in the middle is not seen."""
        gains = gains_of(problem)
        if gains is None:
            return None
        return cls(np.sqrt(gains + weight * penalty_gains(regularizer, problem.shape)))

    def apply(self, image: np.ndarray) -> np.ndarray:
        """Return M x."""
        return convolved(image, self.gains)

    def undo(self, image: np.ndarray) -> np.ndarray:
        """Return M^-1 x."""
        return convolved(image, 1 / self.gains)
