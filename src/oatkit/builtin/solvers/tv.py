"""Least squares with total variation."""

from typing import ClassVar

from oatkit.api import Weight, param
from oatkit.builtin.regularizers.analysis import Analysis
from oatkit.builtin.regularizers.gradient import Gradient
from oatkit.builtin.solvers.sparse import SparseSolver


class TvSolver(SparseSolver):
    """Least squares with total variation, min |A x - b|^2 + w TV(x).

    TV is that of the regularizer ``tv``. The image is the true minimiser under x >= 0. Convergence and relative gap are
    as for `l1`. Where A^T A is nearly shift-invariant, as inside a detector array, most steps are taken on a
    convolution in its place [Lee2014]_; FISTA takes those that remain, with an inner iteration on the dual
    [Beck2009b]_.

    References:
        [Lee2014] Lee, Sun and Saunders, SIAM J. Optim. 24, 1420 (2014), 10.1137/130921428.
        [Beck2009b] Beck and Teboulle, IEEE Trans. Image Process. 18, 2419 (2009), 10.1109/TIP.2009.2028250.
    """

    name: ClassVar[str] = "tv"
    on_stand_in: ClassVar[bool] = True
    weight: Weight = param(3e-3, "weight of the penalty, as `scaling` says", above=0)

    def analysis(self) -> Analysis:
        """Return the gradient."""
        return Gradient()
