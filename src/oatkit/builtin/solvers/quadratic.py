"""What least-squares solvers with a quadratic penalty have in common."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Quadratic, Solver, Weight, param
from oatkit.builtin.regularizers.laplacian import Laplacian


class QuadraticSolver(Solver):
    """A solver of min |A x - b|^2 + w |L x|^2, perhaps under a constraint."""

    steps_by_norm: ClassVar[bool]
    """Whether the length of its steps comes from |A|."""
    weight: Weight = param(1e-2, "weight of the penalty, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param("relative", "weight in units of |A|^2, or the w of the formula")
    regularizer: Quadratic = param(Laplacian(), "the penalty |L x|^2")
    n_iterations: int = param(300, "largest number of steps", at_least=1)
    tolerance: float = param(1e-3, "stop where the gradient has fallen to this part of its start", above=0, below=1)

    @abstractmethod
    def descend(self, problem: Problem, weight: float) -> Iterator[Iterate]:
        """Yield the iterates from zero for the w of the formula, their products without those of the scale."""

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the iterates of the method; before them, the zero image while the scale is being set."""
        spent = 0
        if self.steps_by_norm or self.scaling == "relative":
            for products, _ in enumerate(problem.settle_norm(), 1):
                yield Iterate(np.zeros(problem.shape), 0, products=products)
            spent = problem.norm_products
        weight = problem.applied_weight(self.weight, self.scaling, self.regularizer.degree)
        for state in self.descend(problem, weight):
            yield replace(state, products=spent + state.products)
