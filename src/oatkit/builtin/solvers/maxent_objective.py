"""What maximum entropy minimises, and the certificate of how near an image is to the optimum."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from oatkit.api import Problem, SolverError
from oatkit.builtin.regularizers.entropy import log_prox
from oatkit.builtin.solvers.point import Point
from oatkit.vectors import norm

ROUNDING = 1e-14
"""Relative error that is granted to a value of P."""


@dataclass(frozen=True, eq=False)
class EntropyObjective:
    """P(x) = |A x - b|^2 + w sum [x log(x / m) - x + m], strictly convex in x >= 0."""

    problem: Problem
    weight: float
    """w."""
    prior: np.ndarray
    """m > 0, of the shape of the image."""

    def at(self, log_ratio: np.ndarray) -> "EntropyPoint":
        """Return the point of z = log(x / m), by one application of A^T A. Raises `SolverError` if it is not finite."""
        with np.errstate(over="ignore"):
            image = self.prior * np.exp(log_ratio)
        point = EntropyPoint.of(self, image, log_ratio=log_ratio)
        if not np.isfinite(point.value):
            raise SolverError(
                f"maximum entropy: the objective left the range of floats at weight {self.weight:g} and a mean prior "
                f"of {self.prior.mean():g}; bring data and operator to order 1"
            )
        return point

    def hessian(self, direction: np.ndarray) -> np.ndarray:
        """Return A^T A applied to a change of the image."""
        return self.problem.adjoint(self.problem.forward(direction))

    @property
    def rate(self) -> float:
        """A bound on the curvature of |A x - b|^2 / 2; `Problem.norm` is a bound from below, at worst 2e-3 too low."""
        return 1.01 * self.problem.norm**2

    def advance(self, image: np.ndarray, slope: np.ndarray) -> "EntropyPoint":
        """Return the point after one proximal gradient step from an image of that slope A^T (A x - b)."""
        return self.at(log_prox(image - slope / self.rate, self.weight / (2 * self.rate), self.prior))


@dataclass(frozen=True, eq=False)
class EntropyPoint(Point):
    """The point of `EntropyObjective`; its image is not negative."""

    log_ratio: np.ndarray
    """z = log(x / m), finite even where x is too small for a float."""

    @cached_property
    def penalty(self) -> float:
        """The relative entropy of x to m."""
        return relative_entropy(self.image, self.log_ratio, self.objective.prior)

    @cached_property
    def gradient(self) -> np.ndarray:
        """The derivative of P by x: 2 A^T (A x - b) + w log(x / m)."""
        return 2 * self.slope + self.objective.weight * self.log_ratio

    @cached_property
    def gap(self) -> float:
        """An upper bound on P(x) - P*: w times the relative entropy of x to x^ = m exp(-2 A^T (A x - b) / w).

        It is the duality gap of Fenchel's dual, taken at the residual. Infinite where x^ is too large for a float.
        """
        weight = self.objective.weight
        exponent = np.log(self.objective.prior) - 2 * self.slope / weight
        if np.max(exponent) > 700:
            return float("inf")
        return weight * relative_entropy(self.image, self.gradient / weight, np.exp(exponent))


def certified(points: Iterator[EntropyPoint], objective: EntropyObjective) -> Iterator[tuple[EntropyPoint, float]]:
    """Yield the point of least P so far and its relative gap, for each of `points`.

    The gap is relative to P or to |b|^2, whichever is smaller: a large flat prior adds a constant to P that would make
    any gap look small.
    A bound from below on P* holds whatever point it comes from, so the best one is kept. Points may come several times,
    and may belong to another weight than `objective`, in whose terms they are judged.
    """
    best, seen, bound, gap = None, None, -np.inf, np.inf
    energy = norm(objective.problem.data) ** 2 or np.inf
    for point in points:
        if point is not seen or best is None:
            seen, judged = point, replace(point, objective=objective)
            bound = max(bound, judged.value - judged.gap)
            if best is None or (judged.value, judged.gap) < (best.value, best.gap):
                best = judged
            # The difference of two large numbers is known to their rounding only.
            gap = min(best.gap, best.value - bound + ROUNDING * best.value)
        yield best, gap / min(best.value, energy) if gap > 0 else 0.0


def relative_entropy(image: np.ndarray, log_ratio: np.ndarray, model: np.ndarray) -> float:
    """Return the sum of x log(x / y) - x + y, given log(x / y), without cancellation where x is near y."""
    small = np.clip(log_ratio, -1e-3, 1e-3)
    near = image * small * small * (1 / 2 - small * (1 / 6 - small * (1 / 24 - small / 120)))
    far = image * log_ratio - image + model
    return float(np.where(small == log_ratio, near, far).sum())
