"""Maximum entropy, to a certified optimum."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np

from oatkit.api import Iterate, Problem, Reference, Solver, ValidationError, Weight, param
from oatkit.builtin.solvers.maxent_newton import newton
from oatkit.builtin.solvers.maxent_objective import ROUNDING, EntropyObjective, EntropyPoint, certified
from oatkit.builtin.solvers.maxent_paper import conjugate_gradients
from oatkit.vectors import norm

BLUR_PX = 1.5
"""Standard deviation of the Gaussian that blurs the structural prior."""

FLOOR = 0.03
"""What is added to it, relative to x_ref."""

DARKEST = 1e-3
"""Least of a pixel of an image that is begun with, relative to x_ref: a darker one is lit in many steps only."""

FINE = 1e-8
"""An image is right to about the square root of its gap. Who asks for a gap of this or less wants the digits of the
image: steps go on to the power 1.5 of the tolerance, which are few where Newton's method converges quadratically."""


class MaxEntNlcg(Solver):
    r"""Least squares with the relative entropy to a default model m: non-negative without a constraint [Prakash2019]_.

    .. math:: P(x) = |A x - b|^2 + w \sum_i [x_i \log(x_i / m_i) - x_i + m_i]

    P is strictly convex, so the image depends on the data, w and m alone. Each image carries its relative gap, an upper
    bound on (P(x) - P*) / min(P(x), |b|^2) by duality; it has converged where that is at most `tolerance`.

    "structural" takes for m the base image of `oatkit.api.Reference`, its negative pixels set to 0, blurred by 1.5
    pixels, plus 3 % of x_ref. A number is a flat m. The paper's form, without "- x + m", is that of m = m_paper / e.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """

    name: ClassVar[str] = "maxent-nlcg"
    weight: Weight = param(1e-2, "weight of the entropy, as `scaling` says", above=0)
    prior: float | Literal["structural"] = param(
        "structural", "default model m: one that follows the data, or a flat one, as `scaling` says", above=0
    )
    scaling: Literal["relative", "absolute"] = param(
        "relative", "weight in units of |A|^2 x_ref and prior in units of x_ref, or the w and m of the formula"
    )
    tolerance: float = param(1e-4, "largest relative gap to the optimum", above=0, below=1)
    n_iterations: int = param(500, "largest number of applications of A^T A", at_least=1)
    method: Literal["newton", "paper"] = param(
        "newton", "Newton's method, or the paper's conjugate gradients, repaired (slow at weak weights)"
    )

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the image of least P so far after each application of A^T A; the zero image while the scale is set."""
        for products, _ in enumerate(problem.settle(), 1):
            yield Iterate(np.zeros(problem.shape), 0, products=products)
        weight = problem.applied_weight(self.weight, self.scaling, degree=1)
        prior = self._prior(problem)
        if not prior.any():
            yield _nothing_to_see(problem)
            return
        if not np.log(weight) + np.log(prior.max()) + np.log(prior.size) < 690:
            raise ValidationError(
                f"maxent-nlcg: weight {weight:g} times prior {prior.max():g} leaves the range of floats"
            )
        objective = EntropyObjective(problem, weight, prior)
        about = {"prior_mean": float(prior.mean()), **_scale(objective)}
        goal = self.tolerance if self.tolerance > FINE else max(self.tolerance**1.5, ROUNDING)
        state = Iterate(np.zeros(problem.shape), 0)
        for point, gap in certified(self._points(objective), objective):
            state = _iterate(point, gap, state.iteration + 1, about)
            if gap <= goal or state.iteration == self.n_iterations:
                break
            yield state
        yield replace(state, converged=state.relative_gap <= self.tolerance, reason=self._reason(state))

    def _prior(self, problem: Problem) -> np.ndarray:
        """Return m, of the shape of the image; zero where nothing sets its scale."""
        if self.prior == "structural":
            return structural_prior(problem.reference)
        return np.full(problem.shape, self.prior * (problem.reference.level if self.scaling == "relative" else 1.0))

    def _points(self, objective: EntropyObjective) -> Iterator[EntropyPoint]:
        if self.method == "paper":
            return conjugate_gradients(objective, np.zeros_like(objective.prior))
        return newton(objective, _start(objective), near=_brightness_of_start(objective.problem) > 0)

    def _reason(self, state: Iterate) -> str:
        gap = state.relative_gap
        if gap <= self.tolerance:
            return f"converged: P is at most {gap:.1e} of itself (or of |b|^2, if that is less) above the optimum"
        known = f"the gap is {gap:.1e}" if np.isfinite(gap) else "uncertified, the bound exceeds the range of floats"
        if state.iteration < self.n_iterations:
            return f"stalled after {state.iteration} iterations ({known}); take method = 'newton' or a larger weight"
        return f"stopped after {state.iteration} iterations ({known}); raise n_iterations or the weight"


def structural_prior(reference: Reference) -> np.ndarray:
    """Return the default model that follows the data: see `MaxEntNlcg`."""
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(np.maximum(reference.base, 0), BLUR_PX) + FLOOR * reference.level


def _start(objective: EntropyObjective) -> np.ndarray:
    """Return z of the image to begin with; 0 where nothing sets its scale.

    That is the problem's own start, brought to the scale of the data, or the base image; dark pixels are lifted.
    """
    problem = objective.problem
    level, prior = problem.reference.level, np.log(objective.prior)
    if level == 0:
        return np.zeros_like(objective.prior)
    brightest = _brightness_of_start(problem)
    if problem.start is None or not brightest > 0:
        return np.log(np.maximum(problem.reference.base, FLOOR * level)) - prior
    return np.log(np.maximum(problem.start * (level / brightest), DARKEST * level)) - prior


def _brightness_of_start(problem: Problem) -> float:
    """Return the 99th percentile of the problem's own start; 0 where it has none."""
    return 0.0 if problem.start is None else float(np.percentile(problem.start, 99))


def _scale(objective: EntropyObjective) -> dict[str, Any]:
    """Return the weight as it stands in the formula, and the scale that makes it dimensionless."""
    problem = objective.problem
    unit = problem.norm**2 * problem.reference.level
    return {
        "weight": objective.weight,
        "tau": objective.weight / unit if unit > 0 else float("inf"),
        "operator_norm": problem.norm,
        "x_ref": problem.reference.level,
    }


def _iterate(point: EntropyPoint, gap: float, iteration: int, about: dict[str, Any]) -> Iterate:
    return Iterate(
        point.image,
        iteration,
        objective=point.value,
        residual_norm=point.residual_norm,
        penalty=point.penalty,
        relative_gap=gap,
        products=point.objective.problem.settling_products + iteration,
        details=about,
    )


def _nothing_to_see(problem: Problem) -> Iterate:
    """Return the end of a problem without a scale: the prior is zero, and so is the image."""
    residual = norm(problem.data)
    reason = "converged: the data are zero, or no image on this grid predicts anything of them"
    return Iterate(np.zeros(problem.shape), 0, residual**2, residual, 0.0, 0.0, problem.settling_products, True, reason)
