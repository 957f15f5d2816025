"""Damped least squares by PyLops."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Solver, Weight, param
from oatkit_pylops.counted import Counted
from oatkit_pylops.ending import nothing_to_see


class PylopsLsqr(Solver):
    """Damped least squares, min |A x - b|^2 + w |x|^2, by the LSQR of PyLops; the image is signed.

    It has converged where the gradient has fallen to `tolerance` of what it was at x = 0. There is no certificate.

    References:
        Paige and Saunders, ACM Trans. Math. Softw. 8, 43 (1982), 10.1145/355984.355989.
        Ravasi and Vasconcelos, SoftwareX 11, 100361 (2020), 10.1016/j.softx.2019.100361.
    """

    name: ClassVar[str] = "pylops-lsqr"
    weight: Weight = param(1e-2, "weight of |x|^2, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param("relative", "weight in units of |A|^2, or the w of the formula")
    n_iterations: int = param(300, "largest number of steps", at_least=1)
    tolerance: float = param(1e-3, "stop where the gradient has fallen to this part of its start", above=0, below=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the image after each step; before them, the zero image while |A| is found."""
        from pylops.optimization.cls_basic import LSQR

        spent = 0
        if self.scaling == "relative":
            for spent, _ in enumerate(problem.settle_norm(), 1):
                yield Iterate(np.zeros(problem.shape), 0, products=spent)
            spent = problem.norm_products
        weight = problem.applied_weight(self.weight, self.scaling, 2)
        if not problem.back_projected.any():
            yield nothing_to_see(problem, spent)
            return
        counted = Counted(problem)
        solver = LSQR(counted.operator())
        image = solver.setup(problem.data, damp=weight**0.5, atol=0, btol=0, conlim=0, niter=self.n_iterations)
        for step in range(1, self.n_iterations + 1):
            with np.errstate(divide="ignore"):  # in estimates of the condition, where it is done after a step
                image = solver.step(image)
            left = float(solver.arnorm / solver.arnorm0)
            converged = left <= self.tolerance
            told = f"the gradient fell to {left:.1e} of its start"
            if not converged:
                told = (
                    f"stopped after {step} steps at {left:.1e} of the first gradient"
                    if step == self.n_iterations
                    else ""
                )
            penalty = float(image @ image)
            objective = float(solver.r2norm) ** 2
            yield Iterate(
                image.reshape(problem.shape),
                step,
                objective=objective,
                residual_norm=max(0.0, objective - weight * penalty) ** 0.5,
                penalty=penalty,
                products=spent + counted.products,
                converged=converged,
                reason=told,
                details={"weight": weight},
            )
            if converged:
                return
