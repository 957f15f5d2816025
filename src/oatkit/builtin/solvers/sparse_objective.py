"""What `l1` and `tv` minimise, and a bound from below on its minimum."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from oatkit.api import Problem
from oatkit.builtin.regularizers.analysis import Analysis, magnitudes, positive_part
from oatkit.builtin.solvers.point import Point
from oatkit.vectors import inner

SAFETY = 1.01
"""`Problem.norm` is a bound from below, at worst 2e-3 too low; steps are shortened by this factor."""


@dataclass(frozen=True, eq=False)
class SparseObjective:
    """P(x) = |A x - b|^2 + w |K x|_1, perhaps over x >= 0."""

    problem: Any
    """A `Problem`, or the `Model` of one."""
    weight: float
    """w."""
    analysis: Analysis
    """K."""
    non_negative: bool
    rate: float
    """A bound from above on the curvature of |A x - b|^2 / 2."""

    @classmethod
    def of(cls, problem: Problem, weight: float, analysis: Analysis, non_negative: bool) -> "SparseObjective":
        """Make one, with the bound from the norm of A."""
        return cls(problem, weight, analysis, non_negative, SAFETY * problem.norm**2)

    def at(self, image: np.ndarray) -> "SparsePoint":
        """Return the point of an image, by one application of A^T A."""
        return SparsePoint.of(self, image)

    @cached_property
    def constant(self) -> tuple[np.ndarray, np.ndarray]:
        """A 1 and A^T A 1 of the image that is 1 everywhere, by one application of A^T A; where K does not see it."""
        signals = self.problem.forward(np.ones(self.problem.shape))
        return signals, self.problem.adjoint(signals)

    @property
    def extra_products(self) -> int:
        """Applications of A^T A that `constant` takes, where it is needed."""
        return 0 if self.analysis.orthonormal else 1


@dataclass(frozen=True, eq=False)
class SparsePoint(Point):
    """The point of `SparseObjective`."""

    @cached_property
    def penalty(self) -> float:
        """|K x|_1."""
        return self.objective.analysis.value(self.image)

    def bound(self, dual: np.ndarray) -> float:
        r"""Return a bound from below on the minimum of P, by Fenchel's dual.

        .. math:: \min P \ge -|u|^2 - 2 \langle u, b \rangle \quad\text{if}\quad
            2 A^T u + K^T y = 0 \;(\ge 0 \text{ under } x \ge 0), \; |y_i| \le w

        u is the misfit, `dual` a guess of y. What is missing to the equation is added to y; then u and y are shrunk
        until y is small enough. It comes near the minimum as x and y come near their optima.
        """
        return max([0.0, *(self._value_of_dual(*pair) for pair in self._feasible(dual))])

    def _feasible(self, dual: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of u and y that meet the equation; magnitudes of y may be too large."""
        analysis, non_negative = self.objective.analysis, self.objective.non_negative
        slope, spread = 2 * self.slope, analysis.adjoint(dual)
        slack = positive_part(slope + spread, True) if non_negative else np.zeros_like(slope)
        if analysis.orthonormal:
            yield self.misfit, dual + analysis.preimage(slack - slope - spread)
            return
        # K^T y has no mean: either u is moved along A 1, or the slack is scaled, until both sides have the same mean.
        signals, constant_slope = self.objective.constant
        if (rise := 2 * constant_slope.mean()) > 0:
            shift = (slack.mean() - slope.mean()) / rise
            lifted = slope + 2 * shift * constant_slope
            yield self.misfit + shift * signals, dual + analysis.preimage(slack - lifted - spread)
        if 0 < slope.mean() < slack.mean():
            yield self.misfit, dual + analysis.preimage(slack * (slope.mean() / slack.mean()) - slope - spread)

    def _value_of_dual(self, u: np.ndarray, y: np.ndarray) -> float:
        """Return the largest value of the dual among the multiples of (u, y) that are feasible."""
        energy, gain, largest = inner(u, u), -inner(u, self.objective.problem.data), float(magnitudes(y).max())
        if not (0 < energy < np.inf and gain > 0):
            return 0.0
        multiple = min(gain / energy, self.objective.weight / largest if largest > 0 else np.inf)
        return multiple * (2 * gain - multiple * energy)
