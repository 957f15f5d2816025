"""What `l1` and `tv` have in common."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import Any, ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Solver, Weight, param
from oatkit.builtin.regularizers.analysis import Analysis
from oatkit.builtin.solvers.proximal_gradient import Step
from oatkit.builtin.solvers.sparse_descent import descent
from oatkit.builtin.solvers.sparse_objective import SparseObjective, SparsePoint
from oatkit.builtin.solvers.sparse_start import start
from oatkit.vectors import norm

ROUNDING = 1e-14
"""Relative error that is granted to a value of P."""


class SparseSolver(Solver):
    """A solver of min |A x - b|^2 + w |K x|_1, perhaps over x >= 0."""

    on_stand_in: ClassVar[bool]
    """Whether most steps are taken on a stand-in for A^T A."""
    weight: Weight = param(3e-4, "weight of the penalty, as `scaling` says", above=0)
    scaling: Literal["relative", "absolute"] = param(
        "relative", "weight in units of |A|^2 x_ref, or the w of the formula"
    )
    non_negative: bool = param(True, "whether the image must not be negative")
    n_iterations: int = param(300, "largest number of steps", at_least=1)
    tolerance: float = param(1e-4, "stop where a step moves the image by this part of it", above=0, below=1)

    @abstractmethod
    def analysis(self) -> Analysis:
        """Return K."""

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the image of least P so far after each step; the zero image while the scale is set."""
        for products, _ in enumerate(problem.settle(), 1):
            yield Iterate(np.zeros(problem.shape), 0, products=products)
        weight = problem.applied_weight(self.weight, self.scaling, degree=1)
        if problem.reference.level == 0:
            yield _nothing_to_see(problem)
            return
        objective = SparseObjective.of(problem, weight, self.analysis(), self.non_negative)
        best = _Best(start(objective))
        yield best.iterate(0)
        steps = descent(best.point, self.tolerance, self.on_stand_in)
        for iteration, step in enumerate(islice(steps, self.n_iterations), 1):
            best.see(step)
            converged = step.move <= self.tolerance
            state = best.iterate(iteration)
            if converged or iteration == self.n_iterations:
                yield replace(state, converged=converged, reason=_reason(step, state, converged))
                return
            yield state


class _Best:
    """The best point so far, and the best bound."""

    def __init__(self, start: SparsePoint) -> None:
        self.point, self.bound = start, 0.0

    def see(self, step: Step) -> None:
        """Look at another step."""
        self.bound = max(self.bound, step.point.bound(step.dual))
        # Near the optimum P no longer tells two images apart, and the later one is nearer.
        if step.point.value <= self.point.value * (1 + ROUNDING):
            self.point = step.point

    @property
    def gap(self) -> float:
        """An upper bound on (P(x) - min P) / P(x)."""
        value = self.point.value
        if not 0 < value < np.inf:
            return 0.0 if value == 0 else float("inf")
        # The difference of two large numbers is known to their rounding only.
        return max(0.0, 1 - self.bound / value + ROUNDING)

    def iterate(self, iteration: int) -> Iterate:
        """Return it as the state after so many steps."""
        objective = self.point.objective
        return Iterate(
            self.point.image,
            iteration,
            objective=self.point.value,
            residual_norm=self.point.residual_norm,
            penalty=self.point.penalty,
            relative_gap=self.gap,
            products=objective.problem.settling_products
            + 1
            + iteration
            + (objective.extra_products if iteration else 0),
            details=_scale(objective),
        )


def _scale(objective: SparseObjective) -> dict[str, Any]:
    """Return the weight as it stands in the formula, and the scale that makes it dimensionless."""
    problem = objective.problem
    return {"weight": objective.weight, "operator_norm": problem.norm, "x_ref": problem.reference.level}


def _reason(step: Step, state: Iterate, converged: bool) -> str:
    known = f"the last step moved the image by {step.move:.1e} of it, P is at most {state.relative_gap:.1e} of itself "
    known += "above the optimum"
    if converged:
        return f"converged: {known}"
    return f"stopped after {state.iteration} steps: {known}; raise n_iterations or the weight"


def _nothing_to_see(problem: Problem) -> Iterate:
    """Return the end of a problem without a scale: the image is zero."""
    residual = norm(problem.data)
    reason = "converged: the data are zero, or no image on this grid predicts anything of them"
    return Iterate(np.zeros(problem.shape), 0, residual**2, residual, 0.0, 0.0, problem.settling_products, True, reason)
