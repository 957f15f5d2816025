"""Anisotropic total variation by PyLops."""

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Solver, Weight, param
from oatkit_pylops.counted import Counted
from oatkit_pylops.ending import nothing_to_see


class SplitBregman(Solver):
    """Anisotropic total variation, min |A x - b|^2 + w (|D_y x|_1 + |D_x x|_1), by the split Bregman of PyLops.

    D_y and D_x are forward differences, without one across the edge of the image, which is signed. It has converged
    where a step moves the image, and the split differences lie off those of the image, by no more than `tolerance` of
    them. There is no certificate.

    References:
        Goldstein and Osher, SIAM J. Imaging Sci. 2, 323 (2009), 10.1137/080725891.
        Ravasi and Vasconcelos, SoftwareX 11, 100361 (2020), 10.1016/j.softx.2019.100361.
    """

    name: ClassVar[str] = "pylops-split-bregman"
    weight: Weight = param(3e-3, "weight of the total variation, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param(
        "relative", "weight in units of |A|^2 x_ref, or the w of the formula"
    )
    coupling: float = param(
        0.02, "how strongly the differences hold on to those of the image, relative to |A|^2: sets the speed", above=0
    )
    n_iterations: int = param(300, "largest number of steps", at_least=1)
    n_inner: int = param(5, "number of LSQR steps in each step", at_least=1, at_most=8)
    tolerance: float = param(1e-3, "stop where a step moves the image by this part of it", above=0, below=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the image after each step; before them, the zero image while the scale is set."""
        spent, image = 0, np.zeros(problem.operator.shape[1])
        for spent, _ in enumerate(problem.settle(), 1):
            yield Iterate(np.zeros(problem.shape), 0, products=spent)
        weight, spent = problem.applied_weight(self.weight, self.scaling, 1), problem.settling_products
        if problem.reference.level == 0:
            yield nothing_to_see(problem, spent)
            return
        counted = Counted(problem)
        solver = self._set_up(counted, problem, weight)
        for step in range(1, self.n_iterations + 1):
            before, image = image, solver.step(image, iter_lim=self.n_inner, atol=0, btol=0)
            move, split = _relative(image - before, image), self._split(solver, image)
            converged, last = max(move, split) <= self.tolerance, step == self.n_iterations
            told = f"step {step} moved the image by {move:.1e} of it, the differences are {split:.1e} apart"
            residual, penalty = (2 * float(solver.costdata) / solver.mu) ** 0.5, float(sum(solver.costregL1))
            yield Iterate(
                image.reshape(problem.shape),
                step,
                objective=residual**2 + weight * penalty,
                residual_norm=residual,
                penalty=penalty,
                products=spent + counted.products,
                converged=converged,
                reason=told if converged or last else "",
                details={"weight": weight},
            )
            if converged:
                return

    def _set_up(self, counted: Counted, problem: Problem, weight: float) -> Any:
        """Return the solver of PyLops, set up.

        It alternates between |A x - b|^2 + (eps / mu) |D x - d + c|^2 and a threshold of eps, which is the method for
        the weight eps^2 in (mu / 2) |A x - b|^2 + eps^2 |D x|_1, not for eps as it says.
        """
        from pylops import FirstDerivative
        from pylops.optimization.cls_sparsity import SplitBregman as Solving

        coupling = self.coupling * problem.norm**2
        epsilon = weight / (2 * coupling)
        solver = Solving(counted.operator())
        solver.setup(
            problem.data,
            [FirstDerivative(problem.shape, axis=axis, kind="forward") for axis in (0, 1)],
            niter_outer=self.n_iterations,
            niter_inner=1,
            mu=epsilon / coupling,
            epsRL1s=[epsilon, epsilon],
        )
        return solver

    def _split(self, solver: Any, image: np.ndarray) -> float:
        """Return how far the split differences are from those of the image, relative to them."""
        differences = np.concatenate([operator.matvec(image) for operator in solver.RegsL1])
        return _relative(np.concatenate(solver.d) - differences, differences)


def _relative(change: np.ndarray, whole: np.ndarray) -> float:
    return float(np.linalg.norm(change)) / (float(np.linalg.norm(whole)) or 1.0)
