"""A stand-in for A^T A that costs next to nothing: a convolution, mended by what products with A^T A show."""

from typing import Self

import numpy as np
from scipy import fft

from oatkit.api import Problem
from oatkit.vectors import inner, norm

FLOOR = 1e-2
"""Least gain of the convolution, relative to its largest: what one pixel does not show, another may."""

BLUR_BINS = 1.5
"""Standard deviation of the Gaussian that smooths the gains: a pixel elsewhere has none of the fine ripple that the
edges of the image cause."""

POWER_STEPS = 12
"""Steps of the power iteration for the first bound on B, and then for each next one from where the last ended."""

SAFETY = 1.1
"""Factor from its result to the bound."""


class StandIn:
    """B = J J^T near A^T A, and J^T as an operator, so that a method for any problem can be run on it as it is.

    Inside a detector array A^T A is nearly shift-invariant, and then the answer to one pixel in the middle gives all of
    it: B starts as the circular convolution with that answer, J as the one with the root of its spectrum. Each product
    s -> y of A^T A mends B by the BFGS formula, so that y = B s, in the form that keeps the factor J [Dennis1996]_, as
    sums of J0 and of outer products a v^T.

    References:
        [Dennis1996] Dennis and Schnabel, Numerical Methods for Unconstrained Optimization and Nonlinear Equations,
            SIAM (1996), Algorithm A9.4.2, 10.1137/1.9781611971200.
    """

    def __init__(self, image_shape: tuple[int, int], root: np.ndarray) -> None:
        self.image_shape, self.root = image_shape, root.astype(np.float32)
        size = image_shape[0] * image_shape[1]
        self.shape = (size, size)
        self.a, self.v = np.empty((2, 0, size), np.float32)
        self._leading = np.random.default_rng(0).standard_normal(size)

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """Make one by a single product; None where the pixel in the middle is not seen."""
        from scipy.ndimage import gaussian_filter

        middle = problem.shape[0] // 2, problem.shape[1] // 2
        pixel = np.zeros(problem.shape)
        pixel[middle] = 1.0
        answer = problem.adjoint(problem.forward(pixel))
        centred = np.roll(answer, (-middle[0], -middle[1]), axis=(0, 1))
        gains = gaussian_filter(fft.fft2(centred).real, BLUR_BINS, mode="wrap")[:, : problem.shape[1] // 2 + 1]
        largest = gains.max()
        return cls(problem.shape, np.sqrt(np.maximum(gains, FLOOR * largest))) if largest > 0 else None

    def matvec(self, image: np.ndarray) -> np.ndarray:
        """Return J^T x, raveled."""
        x = np.ravel(image).astype(np.float32)
        return self._convolved(x, self.root) + (self.a @ x) @ self.v

    def rmatvec(self, data: np.ndarray) -> np.ndarray:
        """Return J z, raveled."""
        z = np.ravel(data).astype(np.float32)
        return self._convolved(z, self.root) + (self.v @ z) @ self.a

    def problem(self, image: np.ndarray, slope: np.ndarray) -> Problem:
        """Return the problem with the curvature B and, at `image`, the `slope` A^T (A x - b)."""
        return Problem(self, self.matvec(image) - self._solved(slope.ravel()), self.image_shape)

    def fits(self, step: np.ndarray, change: np.ndarray) -> float:
        """Return the cosine between B s and `change` A^T A s for a `step` s: 1 where they point the same way."""
        guess = self.rmatvec(self.matvec(step))
        size = norm(guess) * norm(change)
        return inner(guess, change) / size if size > 0 else 0.0

    def learn(self, step: np.ndarray, change: np.ndarray) -> None:
        """Mend B so that it maps `step` s to `change` A^T A s."""
        s, y = step.ravel(), change.ravel()
        z = self.matvec(s)
        before, after = inner(z, z), inner(s, y)
        if not after > 1e-12 * before > 0:
            return
        v = np.sqrt(after / before) * z
        a = (y - self.rmatvec(v)) / inner(v, v)
        self.a, self.v = (np.vstack(pair).astype(np.float32) for pair in ((self.a, a), (self.v, v)))

    def bound(self) -> float:
        """Return a bound from above on the curvature of B."""
        for _ in range(POWER_STEPS):
            self._leading = self.rmatvec(self.matvec(self._leading / norm(self._leading)))
        return SAFETY * norm(self._leading)

    def _solved(self, slope: np.ndarray) -> np.ndarray:
        """Return J^-1 of a raveled slope, by the Woodbury identity."""
        inverse = 1 / self.root
        alone = self._convolved(slope, inverse)
        if not len(self.a):
            return alone
        carried = np.array([self._convolved(a, inverse) for a in self.a])
        small = np.eye(len(self.a)) + self.v @ carried.T
        return alone - np.linalg.solve(small, self.v @ alone) @ carried

    def _convolved(self, values: np.ndarray, gains: np.ndarray) -> np.ndarray:
        image = values.reshape(self.image_shape).astype(np.float32, copy=False)
        return fft.irfft2(fft.rfft2(image) * gains, s=self.image_shape).ravel()
