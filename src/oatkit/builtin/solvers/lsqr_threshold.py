"""Regularized least squares, then negative pixels set to zero: the paper's L2-NN."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from oatkit.api import Iterate, Problem
from oatkit.builtin.solvers.signed import SignedSolver
from oatkit.vectors import norm


class LsqrThreshold(SignedSolver):
    """Least squares with a quadratic penalty, then negative pixels set to zero.

    This is how [Prakash2019]_ solves its Eq. 18; it is not the minimiser under x >= 0, which `nnls` finds. Objective,
    residual and penalty are those of the signed image; ``details`` says how many pixels were set to zero, and the
    residual after that.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """

    name: ClassVar[str] = "lsqr-threshold"

    def descend(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates of LSQR with their negative pixels set to zero."""
        for state in self.signed(problem, weight):
            image = np.maximum(state.image, 0)
            details = {**state.details, "pixels_set_to_zero": int((state.image < 0).sum())}
            if state.reason:
                details["residual_norm_after"] = norm(problem.forward(image) - problem.data)
            yield replace(state, image=image, details=details)
