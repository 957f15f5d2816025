"""Non-negative images by SIRT."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import ClassVar

import numpy as np

from oatkit.api import Iterate, Problem, Solver, param


class Sirt(Solver):
    """SIRT under x >= 0: x <- max(0, x + A^T R (b - A x) / |A^T R A|), where R divides by squared norms of rows of A.

    References:
        Hansen and Saxild-Hansen, J. Comput. Appl. Math. 236, 2167 (2012), 10.1016/j.cam.2011.09.039.
    """

    name: ClassVar[str] = "sirt"
    n_iterations: int = param(500, "largest number of steps", at_least=1)
    tolerance: float = param(1e-4, "stop where a step moves the image by this part of it", above=0, below=1)
    n_probes: int = param(30, "number of images of random signs that tell the norms of rows", at_least=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the image after each step; before them, the zero image while the scale is set."""
        image, squares, rng = np.zeros(problem.shape), np.zeros(problem.data.size), np.random.default_rng(0)
        for spent in range(1, self.n_probes + 1):
            squares += problem.forward(rng.choice([-1.0, 1.0], problem.shape)) ** 2
            yield Iterate(image, 0, products=spent)
        # A sample that hardly hears the image must not count for more than a hundred others.
        root = 1 / np.sqrt(np.maximum(squares, 0.01 * squares.max()) if squares.any() else 1.0)
        forward, adjoint = lambda x: root * problem.forward(x), lambda y: problem.adjoint(root * y)
        operator = SimpleNamespace(shape=problem.operator.shape, matvec=forward, rmatvec=adjoint)
        weighted = Problem(operator, root * problem.data, problem.shape)
        for spent, _ in enumerate(weighted.settle_norm(), self.n_probes + 1):
            yield Iterate(image, 0, products=spent)
        misfit, largest = -weighted.data, weighted.norm**2 or 1.0
        for step in range(1, self.n_iterations + 1):
            before, image = image, np.maximum(image - adjoint(misfit) / largest, 0)
            misfit = forward(image) - weighted.data
            move, left = np.linalg.norm(image - before) / (np.linalg.norm(image) or 1), np.linalg.norm(misfit / root)
            converged, count = bool(move <= self.tolerance), spent + step
            told = f"step {step} moved the image by {move:.1e} of it" if converged or step == self.n_iterations else ""
            yield Iterate(image, step, float(misfit @ misfit), float(left), 0.0, np.nan, count, converged, told)
            if converged:
                return
