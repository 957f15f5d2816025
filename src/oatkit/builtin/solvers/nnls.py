"""Least squares under x >= 0."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic, Solver, Weight, param
from oatkit.builtin.regularizers.laplacian import Laplacian
from oatkit.builtin.solvers.projected_gradient import projected_gradient


class Nnls(Solver):
    """Non-negative least squares with a quadratic penalty, min |A x - b|^2 + w |L x|^2 over x >= 0, by FISTA.

    This is the true minimiser of Eq. 18 of [Prakash2019]_. It has converged where the projected gradient has fallen to
    `tolerance` of the gradient at x = 0.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
        [Beck2009] Beck and Teboulle, SIAM J. Imaging Sci. 2, 183 (2009), 10.1137/080716542.
        [ODonoghue2015] O'Donoghue and Candes, Found. Comput. Math. 15, 715 (2015), 10.1007/s10208-013-9150-3.
    """

    name: ClassVar[str] = "nnls"
    weight: Weight = param(1e-2, "weight of the penalty, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param("relative", "weight in units of |A|^2, or the w of the formula")
    regularizer: Quadratic = param(Laplacian(), "the penalty |L x|^2")
    n_iterations: int = param(300, "largest number of steps", at_least=1)
    tolerance: float = param(3e-3, "stop where the projected gradient has fallen to this part", above=0, below=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the iterates of FISTA from zero; before them, the zero image while the scale is being set."""
        for _ in problem.settle_norm():
            yield Iterate(np.zeros(problem.shape), 0)
        w = problem.applied_weight(self.weight, self.scaling, self.regularizer.degree)
        yield from projected_gradient(problem, self.regularizer, w, self.n_iterations, self.tolerance)
