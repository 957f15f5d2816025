"""A^T A as a circular convolution: inside a detector array it is nearly shift-invariant, and the answer to one pixel in
the middle gives all of it.
"""

from collections.abc import Callable

import numpy as np

from oatkit.api import Problem, Quadratic

FLOOR = 1e-2
"""Least gain of the convolution, relative to its largest: what one pixel does not show, another may."""

BLUR_BINS = 1.5
"""Standard deviation of the Gaussian that smooths the gains: a pixel elsewhere has none of the fine ripple that the
edges of the image cause."""


def convolved(image: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Return the circular convolution of an image with these gains, over half of its frequencies as of `rfft2`."""
    from scipy import fft

    return fft.irfft2(fft.rfft2(image) * gains, s=image.shape)


def gains_of(problem: Problem) -> np.ndarray | None:
    """Return the gains of A^T A, all positive, by a single product; None where the pixel in the middle is not seen."""
    from scipy.ndimage import gaussian_filter

    gains = _answered(lambda image: problem.adjoint(problem.forward(image)), problem.shape)
    gains = gaussian_filter(gains, BLUR_BINS, mode="wrap")[:, : problem.shape[1] // 2 + 1]
    largest = gains.max()
    return np.maximum(gains, FLOOR * largest) if largest > 0 else None


def penalty_gains(regularizer: Quadratic, shape: tuple[int, int]) -> np.ndarray:
    """Return the gains of L^T L, none negative."""
    rows = regularizer.operator(shape)
    gains = _answered(lambda image: rows.rmatvec(rows.matvec(image.ravel())).reshape(shape), shape)
    return np.maximum(gains[:, : shape[1] // 2 + 1], 0)


def _answered(normal: Callable[[np.ndarray], np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """Return the gains at all frequencies of the convolution that answers the pixel in the middle as `normal` does."""
    from scipy.fft import fft2

    middle = shape[0] // 2, shape[1] // 2
    pixel = np.zeros(shape)
    pixel[middle] = 1.0
    return fft2(np.roll(normal(pixel), (-middle[0], -middle[1]), axis=(0, 1))).real
