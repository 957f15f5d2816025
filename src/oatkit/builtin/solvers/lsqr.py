"""Regularized least squares, signed."""

from collections.abc import Iterator
from typing import ClassVar

from oatkit.api import Iterate, Problem
from oatkit.builtin.solvers.signed import SignedSolver


class Lsqr(SignedSolver):
    """Least squares with a quadratic penalty, min |A x - b|^2 + w |L x|^2, by LSQR.

    The image is signed: its negative pixels mean nothing physically. Eq. 4 and 17 of [Prakash2019]_. Where A^T A is
    nearly shift-invariant, as inside a detector array, a convolution near (A^T A + w L^T L)^(1/2) preconditions it, and
    a sixth of the steps suffice; other operators go without. An image that is meant to be stopped early, before its
    noise is fitted, takes the preconditioner "none".

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
        [Paige1982] Paige and Saunders, ACM Trans. Math. Softw. 8, 43 (1982), 10.1145/355984.355989.
    """

    name: ClassVar[str] = "lsqr"

    def descend(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates of LSQR."""
        return self.signed(problem, weight)
