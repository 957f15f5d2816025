"""What the solvers by LSQR have in common."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, param
from oatkit.builtin.solvers.least_squares import least_squares
from oatkit.builtin.solvers.preconditioner import Preconditioner
from oatkit.builtin.solvers.quadratic import QuadraticSolver


class SignedSolver(QuadraticSolver):
    """A solver of min |A x - b|^2 + w |L x|^2 over all x, or one that begins so."""

    steps_by_norm: ClassVar[bool] = False
    preconditioner: Literal["convolution", "none"] = param("convolution", "what shortens the way to the solution")

    def signed(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates of LSQR, after a zero image where a preconditioner was made."""
        by, spent = None, 0
        if self.preconditioner == "convolution":
            by, spent = Preconditioner.of(problem, self.regularizer, weight), 1
            yield Iterate(np.zeros(problem.shape), 0, products=spent)
        for state in least_squares(problem, self.regularizer, weight, self.n_iterations, self.tolerance, by):
            yield replace(state, products=spent + state.products)
