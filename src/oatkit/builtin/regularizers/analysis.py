"""Operators K of penalties |K x|_1, the sum of the magnitudes of what K sees in an image."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from oatkit.vectors import inner


@dataclass(frozen=True, eq=False)
class Ascent:
    """The state of fast gradient projection on the dual of a proximal map."""

    dual: np.ndarray
    """y, of magnitudes up to the step."""
    previous: np.ndarray
    """y one step before."""
    momentum: float = 1.0


class Analysis(ABC):
    """An operator K from images ``(y, x)`` to coefficients ``(part, y, x)``.

    The magnitude of a coefficient is the Euclidean norm over its parts; the penalty is the sum of magnitudes.
    """

    norm_squared: ClassVar[float]
    """A bound from above on the squared spectral norm of K."""
    orthonormal: ClassVar[bool]
    """Whether K^T K and K K^T are the identity; if not, K sees all of an image but a constant."""

    @abstractmethod
    def analyse(self, image: np.ndarray) -> np.ndarray:
        """Return K x."""

    @abstractmethod
    def adjoint(self, coefficients: np.ndarray) -> np.ndarray:
        """Return K^T y."""

    @abstractmethod
    def preimage(self, image: np.ndarray) -> np.ndarray:
        """Return the shortest y with K^T y = image - unseen(image)."""

    def unseen(self, image: np.ndarray) -> np.ndarray:
        """Return the part of an image that costs nothing: zero, or its mean."""
        return np.zeros_like(image) if self.orthonormal else np.full_like(image, image.mean())

    def has_closed_form(self, non_negative: bool) -> bool:
        """Say whether v - K^T clipped(K v) (its positive part under u >= 0) is the proximal point of v."""
        return self.orthonormal and not non_negative

    def ascend(self, ascent: Ascent, image: np.ndarray, step: float, non_negative: bool, n_steps: int) -> Ascent:
        """Take steps of fast gradient projection towards the y of magnitudes up to `step` with the proximal point
        v - K^T y (its positive part under u >= 0) of an image v; momentum is dropped where it points uphill.
        """
        dual, previous, momentum = ascent.dual, ascent.previous, ascent.momentum
        for _ in range(n_steps):
            following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
            ahead = dual + (momentum - 1) / following * (dual - previous)
            primal = positive_part(image - self.adjoint(ahead), non_negative)
            new = clipped(ahead + self.analyse(primal) / self.norm_squared, step)
            momentum = 1.0 if inner(ahead - new, new - dual) > 0 else following
            dual, previous = new, dual
        return Ascent(dual, previous, momentum)

    def value(self, image: np.ndarray) -> float:
        """Return the sum of the magnitudes of K x."""
        return float(magnitudes(self.analyse(image)).sum())


@dataclass(frozen=True)
class Pixels(Analysis):
    """K is the identity: the coefficients are the pixels."""

    norm_squared: ClassVar[float] = 1.0
    orthonormal: ClassVar[bool] = True

    def analyse(self, image: np.ndarray) -> np.ndarray:
        """Return the image as one part."""
        return image[None]

    def adjoint(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the one part."""
        return coefficients[0]

    def preimage(self, image: np.ndarray) -> np.ndarray:
        """Return the image as one part."""
        return image[None]

    def has_closed_form(self, non_negative: bool) -> bool:
        """Always."""
        return True


def positive_part(image: np.ndarray, non_negative: bool) -> np.ndarray:
    """Return the nearest image that the constraint allows."""
    return np.maximum(image, 0) if non_negative else image


def magnitudes(coefficients: np.ndarray) -> np.ndarray:
    """Return the Euclidean norm over the parts, shape ``(y, x)``."""
    if len(coefficients) == 1:
        return np.abs(coefficients[0])
    return np.sqrt(np.einsum("kij,kij->ij", coefficients, coefficients))


def clipped(coefficients: np.ndarray, largest: float) -> np.ndarray:
    """Return the coefficients with magnitudes above `largest` brought down to it."""
    if len(coefficients) == 1:
        return np.clip(coefficients, -largest, largest)
    return coefficients * (largest / np.maximum(magnitudes(coefficients), largest))
