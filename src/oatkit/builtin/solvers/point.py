"""What one application of A^T A tells about an image, for objectives |A x - b|^2 + w penalty(x)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from oatkit.vectors import norm


@dataclass(frozen=True, eq=False)
class Point(ABC):
    """An image with all that one application of A^T A tells about it."""

    objective: Any
    """With its ``problem`` (a `Problem`, or the `Model` of one), its ``weight`` w, and ``at(image)``, the point of
    another image by one product."""
    image: np.ndarray
    """Of the problem's shape."""
    misfit: np.ndarray
    """A x - b, raveled."""
    slope: np.ndarray
    """A^T (A x - b), of the shape of the image."""

    @classmethod
    def of(cls, objective: Any, image: np.ndarray, **more: Any) -> Self:
        """Return the point of an image, by one application of A^T A; `more` are fields of the class."""
        misfit = objective.problem.forward(image) - objective.problem.data
        return cls(objective, image, misfit, objective.problem.adjoint(misfit), **more)

    @property
    @abstractmethod
    def penalty(self) -> float:
        """The unweighted, convex penalty."""

    @cached_property
    def residual_norm(self) -> float:
        """|A x - b|."""
        return norm(self.misfit)

    @property
    def value(self) -> float:
        """The objective; infinite where that is too large for a float."""
        return self.residual_norm * self.residual_norm + self.objective.weight * self.penalty
