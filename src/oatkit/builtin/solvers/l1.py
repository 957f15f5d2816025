"""Least squares with a sparse image, in pixels or in wavelets."""

from typing import ClassVar

from oatkit.api import param
from oatkit.builtin.regularizers.analysis import Analysis
from oatkit.builtin.regularizers.l1 import L1
from oatkit.builtin.solvers.sparse import SparseSolver


class L1Solver(SparseSolver):
    """Least squares with an L1 penalty on pixels or wavelet coefficients, min |A x - b|^2 + w |W x|_1, by FISTA.

    The image is the true minimiser under x >= 0, not one with its negative pixels cut off afterwards. It has converged
    where a step moves it by no more than `tolerance` of its norm. Each image carries its relative gap, an upper bound
    on (P(x) - P*) / P(x) by duality: rigorous, but far above what is left until the steps have become very short.

    References:
        [Beck2009] Beck and Teboulle, SIAM J. Imaging Sci. 2, 183 (2009), 10.1137/080716542.
    """

    name: ClassVar[str] = "l1"
    on_stand_in: ClassVar[bool] = False
    regularizer: L1 = param(L1(), "the basis in which the image is to be sparse")

    def analysis(self) -> Analysis:
        """Return the operator of the basis."""
        return self.regularizer.analysis()
