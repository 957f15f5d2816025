"""Regularized least squares, signed."""

from collections.abc import Iterator
from typing import ClassVar

from oatkit.api import Iterate, Problem
from oatkit.builtin.solvers.bidiagonalisation import least_squares
from oatkit.builtin.solvers.quadratic import QuadraticSolver


class Lsqr(QuadraticSolver):
    """Least squares with a quadratic penalty, min |A x - b|^2 + w |L x|^2, by LSQR.

    The image is signed: its negative pixels mean nothing physically. Eq. 4 and 17 of [Prakash2019]_.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
        [Paige1982] Paige and Saunders, ACM Trans. Math. Softw. 8, 43 (1982), 10.1145/355984.355989.
    """

    name: ClassVar[str] = "lsqr"
    steps_by_norm: ClassVar[bool] = False

    def descend(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates of LSQR."""
        return least_squares(problem, self.regularizer, weight, self.n_iterations, self.tolerance)
