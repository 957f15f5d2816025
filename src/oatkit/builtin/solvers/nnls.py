"""Least squares under x >= 0."""

from collections.abc import Iterator
from typing import ClassVar

from oatkit.api import Iterate, Problem, param
from oatkit.builtin.solvers.projected_gradient import projected_gradient
from oatkit.builtin.solvers.quadratic import QuadraticSolver


class Nnls(QuadraticSolver):
    """Non-negative least squares with a quadratic penalty, min |A x - b|^2 + w |L x|^2 over x >= 0, by FISTA.

    This is the true minimiser of Eq. 18 of [Prakash2019]_. It has converged where the projected gradient has fallen to
    `tolerance` of the gradient at x = 0.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
        [Beck2009] Beck and Teboulle, SIAM J. Imaging Sci. 2, 183 (2009), 10.1137/080716542.
        [ODonoghue2015] O'Donoghue and Candes, Found. Comput. Math. 15, 715 (2015), 10.1007/s10208-013-9150-3.
    """

    name: ClassVar[str] = "nnls"
    steps_by_norm: ClassVar[bool] = True
    tolerance: float = param(3e-3, "stop where the projected gradient has fallen to this part", above=0, below=1)

    def descend(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates of FISTA."""
        return projected_gradient(problem, self.regularizer, weight, self.n_iterations, self.tolerance)
