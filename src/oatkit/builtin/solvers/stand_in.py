"""A stand-in for A^T A that costs next to nothing: a convolution, mended by what products with A^T A show."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from oatkit.api import Problem
from oatkit.builtin.solvers.convolution import convolved, gains_of
from oatkit.vectors import inner, norm

POWER_STEPS = 12
"""Steps of the power iteration for each estimate of the norm of B, from where the last ended and what was learnt."""

SAFETY = 1.3
"""Factor by which the estimate is raised, since it comes from below."""


class StandIn:
    """B near A^T A.

    B starts as a circular convolution (`oatkit.builtin.solvers.convolution`). Each product s -> y of A^T A mends it by
    the BFGS formula [Nocedal2006]_, so that y = B s: B + y y^T / (y^T s) - B s s^T B / (s^T B s).

    References:
        [Nocedal2006] Nocedal and Wright, Numerical Optimization, Springer (2006), Eq. 6.19, 10.1007/978-0-387-40065-5.
    """

    def __init__(self, shape: tuple[int, int], gains: np.ndarray) -> None:
        self.shape, self.gains = shape, gains
        size = shape[0] * shape[1]
        self._rows, self._signs = np.empty((0, size)), np.empty(0)
        self._leading = np.random.default_rng(0).standard_normal(shape)

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """Make one by a single product; None where the pixel in the middle is not seen."""
        gains = gains_of(problem)
        return None if gains is None else cls(problem.shape, gains)

    def apply(self, image: np.ndarray) -> np.ndarray:
        """Return B x."""
        mended = (self._signs * (self._rows @ image.ravel())) @ self._rows
        return convolved(image, self.gains) + mended.reshape(self.shape)

    def learn(self, step: np.ndarray, change: np.ndarray) -> float:
        """Mend B so that it maps `step` s to `change` A^T A s.

        Return the cosine between that and what B has said before: 1 where they point the same way.
        """
        guess = self.apply(step)
        before, after = inner(step, guess), inner(step, change)
        fits = inner(guess, change) / (norm(guess) * norm(change) or 1.0)
        if after > 1e-12 * before > 0:
            pair = change.ravel() / np.sqrt(after), guess.ravel() / np.sqrt(before)
            self._leading = self._leading / norm(self._leading) + change / norm(change)
            self._rows, self._signs = np.vstack([self._rows, *pair]), np.append(self._signs, [1.0, -1.0])
        return fits

    def curvature(self) -> float:
        """Return the spectral norm of B, estimated and raised.

        Where it is too small all the same, steps that rely on it diverge, and the descent on B ends early.
        """
        for _ in range(POWER_STEPS):
            self._leading = self.apply(self._leading / norm(self._leading))
        return SAFETY * norm(self._leading)


@dataclass(frozen=True, eq=False)
class Model:
    """What a method sees of a problem whose A^T A is replaced by B.

    Its misfit *is* the slope B (x - x0) + A^T (A x0 - b), and its adjoint leaves it as it is: B has no factor that maps
    images to data. So slopes are right, and residual norms mean nothing.
    """

    stand_in: StandIn
    data: np.ndarray
    """B x0 - A^T (A x0 - b)."""

    @classmethod
    def at(cls, stand_in: StandIn, image: np.ndarray, slope: np.ndarray) -> Self:
        """Make the one that has the `slope` A^T (A x0 - b) at the `image` x0."""
        return cls(stand_in, stand_in.apply(image) - slope)

    def forward(self, image: np.ndarray) -> np.ndarray:
        """Return B x."""
        return self.stand_in.apply(image)

    def adjoint(self, misfit: np.ndarray) -> np.ndarray:
        """Return what it gets."""
        return misfit
