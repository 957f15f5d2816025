"""Any penalty with a proximal map, by PyProximal."""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Proximable, Solver, Weight, param
from oatkit_pylops.counted import Counted
from oatkit_pylops.ending import nothing_to_see
from oatkit_pylops.penalties import L1

STEP = 0.95
"""Length of steps in units of 1 / |A|^2, which is found from below."""


class ProximalFista(Solver):
    """Least squares with any proximable penalty, min |A x - b|^2 + w g(x), by the FISTA of PyProximal; signed.

    It has converged where a step moves the image by no more than `tolerance` of it. There is no certificate. Each step
    applies A twice, the second time only to tell the objective.

    References:
        Beck and Teboulle, SIAM J. Imaging Sci. 2, 183 (2009), 10.1137/080716542.
        Ravasi et al., J. Open Source Softw. 9, 6326 (2024), 10.21105/joss.06326.
    """

    name: ClassVar[str] = "pyproximal-fista"
    weight: Weight = param(3e-4, "weight of the penalty, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param(
        "relative", "weight in units of |A|^2 x_ref^(2 - degree of the penalty), or the w of the formula"
    )
    regularizer: Proximable = param(L1(), "the penalty g")
    n_iterations: int = param(300, "largest number of steps", at_least=1)
    tolerance: float = param(1e-4, "stop where a step moves the image by this part of it", above=0, below=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the image after each step; before them, the zero image while the scale is set."""
        spent, zeros = 0, np.zeros(problem.operator.shape[1])
        for spent, _ in enumerate(problem.settle(), 1):
            yield Iterate(zeros.reshape(problem.shape), 0, products=spent)
        weight = problem.applied_weight(self.weight, self.scaling, self.regularizer.degree)
        spent = problem.settling_products
        if problem.reference.level == 0:
            yield nothing_to_see(problem, spent)
            return
        counted = Counted(problem, problem.norm)
        solver, image, ahead = self._set_up(counted, problem, weight, zeros)
        for step in range(1, self.n_iterations + 1):
            before = image
            image, ahead = solver.step(image, ahead)
            move = float(np.linalg.norm(image - before)) / (float(np.linalg.norm(image)) or 1.0)
            converged, last = move <= self.tolerance, step == self.n_iterations
            residual = problem.norm * float(2 * solver.proxf(image)) ** 0.5
            shown = image.reshape(problem.shape)
            penalty = self.regularizer.value(shown)
            yield Iterate(
                shown,
                step,
                objective=residual**2 + weight * penalty,
                residual_norm=residual,
                penalty=penalty,
                products=spent + counted.products,
                converged=converged,
                reason=f"step {step} moved the image by {move:.1e} of it" if converged or last else "",
                details={"weight": weight},
            )
            if converged:
                return

    def _set_up(self, counted: Counted, problem: Problem, weight: float, zeros: np.ndarray) -> tuple[Any, Any, Any]:
        """Return the solver of PyProximal, set up, with its two images.

        It keeps the length of steps and the weight in single precision: so both are 1 there, about, A is divided by its
        norm, and the weight is the penalty's.
        """
        from pyproximal import L2
        from pyproximal.optimization.cls_primal import ProximalGradient

        misfit = L2(counted.operator(), problem.data / problem.norm)
        penalty = _Weighted(self.regularizer, weight / (2 * problem.norm**2), problem.shape)
        solver = ProximalGradient()
        image, ahead = solver.setup(misfit, penalty, zeros, tau=STEP, acceleration="fista")
        return solver, image, ahead


class _Weighted:
    """A regularizer times a number, as PyProximal takes it."""

    def __init__(self, regularizer: Proximable, weight: float, shape: tuple[int, int]) -> None:
        self._regularizer, self._weight, self._shape = regularizer, weight, shape

    def __call__(self, image: np.ndarray) -> float:
        return self._weight * self._regularizer.value(image.reshape(self._shape))

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return the proximal point, raveled."""
        return np.ravel(self._regularizer.prox(image.reshape(self._shape), step * self._weight))
