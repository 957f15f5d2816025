"""What `nnls` minimises."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from oatkit.api import Problem, Quadratic
from oatkit.builtin.solvers.point import Point
from oatkit.vectors import norm

SAFETY = 1.02
"""Spectral norms are estimated from below, at worst 2e-3 too low; steps are shortened by this factor."""


@dataclass(frozen=True, eq=False)
class QuadraticObjective:
    """P(x) = |A x - b|^2 + w |L x|^2."""

    problem: Any
    """A `Problem`, or the `Model` of one."""
    regularizer: Quadratic
    rows: Any
    """L."""
    weight: float
    """w."""
    curvature: float
    """A bound from above on that of |A x - b|^2 / 2."""
    roughness: float
    """Likewise of |L x|^2 / 2."""

    @classmethod
    def of(cls, problem: Problem, regularizer: Quadratic, weight: float) -> "QuadraticObjective":
        """Make one, with bounds from the norms of A and L."""
        rows = regularizer.operator(problem.shape)
        roughest = Problem(rows, np.zeros(rows.shape[0]), problem.shape).norm
        return cls(problem, regularizer, rows, weight, SAFETY * problem.norm**2, SAFETY * roughest**2)

    @property
    def rate(self) -> float:
        """A bound from above on the curvature of P / 2."""
        return self.curvature + self.weight * self.roughness

    def at(self, image: np.ndarray) -> "QuadraticPoint":
        """Return the point of an image, by one application of A^T A."""
        return QuadraticPoint.of(self, image)


@dataclass(frozen=True, eq=False)
class QuadraticPoint(Point):
    """The point of `QuadraticObjective`."""

    @cached_property
    def penalty(self) -> float:
        """|L x|^2."""
        return self.objective.regularizer.value(self.image)

    @cached_property
    def gradient(self) -> np.ndarray:
        """Half the gradient of P."""
        rows = self.objective.rows
        rough = rows.rmatvec(rows.matvec(self.image.ravel())).reshape(self.image.shape)
        return self.slope + self.objective.weight * rough

    @cached_property
    def left(self) -> float:
        """How far from the optimum over x >= 0: the norm of the projected gradient."""
        # In units of the gradient before the norm: squares of an image under a huge weight are too small for a float.
        rate = self.objective.rate
        return norm(rate * (self.image - np.maximum(self.image - self.gradient / rate, 0)))
