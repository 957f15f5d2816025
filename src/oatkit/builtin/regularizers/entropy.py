"""Relative entropy: the distance of a non-negative image from a default model."""

from typing import Any, ClassVar

import numpy as np

from oatkit.api import Proximable, Smooth, param


class Entropy(Smooth, Proximable):
    r"""Relative entropy of an image to a flat default model m, the generalised Kullback-Leibler divergence.

    .. math:: \sum_i x_i \log(x_i / m) - x_i + m

    It is 0 at x = m, infinite where a pixel is negative, and pulls towards m, not towards 0. Eq. 14 of [Prakash2019]_
    lacks the last two terms, which amounts to m = m_paper / e.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """

    name: ClassVar[str] = "entropy"
    degree: ClassVar[int] = 1
    prior: float = param(1.0, "default model m, in the unit of the image", above=0)

    def value(self, image: np.ndarray) -> float:
        """Return the divergence; infinite where a pixel is negative."""
        image = np.asarray(image, dtype=float)
        if (image < 0).any():
            return float("inf")
        ratio = image / self.prior
        logs = np.log(ratio, out=np.zeros_like(ratio), where=ratio > 0)
        return float(self.prior * (ratio * logs - ratio + 1).sum())

    def gradient(self, image: np.ndarray) -> np.ndarray:
        """Return log(x / m); minus infinity where a pixel is 0, NaN where it is negative."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log(np.asarray(image, dtype=float) / self.prior)

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return u > 0 with u + step log(u / m) = image; see `log_prox`."""
        return self.prior * np.exp(log_prox(np.asarray(image, dtype=float), step, self.prior))


def log_prox(image: np.ndarray, step: float, prior: Any) -> np.ndarray:
    """Return log(u / m) for the u that minimises |u - image|^2 / 2 + step * (relative entropy of u to m).

    With u = step * omega it is omega + log(omega) = image / step + log(m / step), Wright's omega function. The
    logarithm stays finite where u itself is too small for a float.
    """
    from scipy.special import wrightomega

    shift = np.log(prior / step)
    right = image / step + shift
    omega = wrightomega(right)
    # log(omega) = right - omega loses its digits where omega is large, log() where it is too small for a float.
    log_omega = np.where(right < 1, right - omega, np.log(np.maximum(omega, 1e-300)))
    return log_omega - shift
