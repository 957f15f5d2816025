"""Regularized least squares, then negative pixels set to zero: the paper's L2-NN."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic, Solver, Weight, param
from oatkit.builtin.regularizers.laplacian import Laplacian
from oatkit.builtin.solvers.bidiagonalisation import least_squares
from oatkit.vectors import norm


class LsqrThreshold(Solver):
    """Least squares with a quadratic penalty, then negative pixels set to zero.

    This is how [Prakash2019]_ solves its Eq. 18; it is not the minimiser under x >= 0, which `nnls` finds. Objective,
    residual and penalty are those of the signed image; ``details`` says how many pixels were set to zero, and the
    residual after that.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """

    name: ClassVar[str] = "lsqr-threshold"
    weight: Weight = param(1e-2, "weight of the penalty, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param("relative", "weight in units of |A|^2, or the w of the formula")
    regularizer: Quadratic = param(Laplacian(), "the penalty |L x|^2")
    n_iterations: int = param(100, "largest number of steps", at_least=1)
    tolerance: float = param(5e-3, "stop where the gradient has fallen to this part of its start", above=0, below=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the iterates of LSQR with their negative pixels set to zero; before them, the zero image."""
        for _ in problem.settle_norm():
            yield Iterate(np.zeros(problem.shape), 0)
        w = problem.applied_weight(self.weight, self.scaling, self.regularizer.degree)
        for state in least_squares(problem, self.regularizer, w, self.n_iterations, self.tolerance):
            image = np.maximum(state.image, 0)
            details = {**state.details, "pixels_set_to_zero": int((state.image < 0).sum())}
            if state.reason:
                after = norm(problem.forward(image) - problem.data)
                details["residual_norm_after"] = after
            yield replace(state, image=image, details=details)
