"""Regularized least squares, signed."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic, Solver, Weight, param
from oatkit.builtin.regularizers.laplacian import Laplacian
from oatkit.builtin.solvers.bidiagonalisation import least_squares


class Lsqr(Solver):
    """Least squares with a quadratic penalty, min |A x - b|^2 + w |L x|^2, by LSQR.

    The image is signed: its negative pixels mean nothing physically. Eq. 4 and 17 of [Prakash2019]_.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
        [Paige1982] Paige and Saunders, ACM Trans. Math. Softw. 8, 43 (1982), 10.1145/355984.355989.
    """

    name: ClassVar[str] = "lsqr"
    weight: Weight = param(1e-2, "weight of the penalty, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param("relative", "weight in units of |A|^2, or the w of the formula")
    regularizer: Quadratic = param(Laplacian(), "the penalty |L x|^2")
    n_iterations: int = param(100, "largest number of steps", at_least=1)
    tolerance: float = param(5e-3, "stop where the gradient has fallen to this part of its start", above=0, below=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the iterates of LSQR; before them, the zero image while the scale is being set."""
        for _ in problem.settle_norm():
            yield Iterate(np.zeros(problem.shape), 0)
        w = problem.applied_weight(self.weight, self.scaling, self.regularizer.degree)
        yield from least_squares(problem, self.regularizer, w, self.n_iterations, self.tolerance)
