"""Energy: the squared norm of the image itself."""

from typing import Any, ClassVar

import numpy as np

from oatkit.api import Proximable, Quadratic, Smooth


class Identity(Quadratic, Smooth, Proximable):
    """|x|^2, Tikhonov's penalty in its plainest form."""

    name: ClassVar[str] = "identity"

    def value(self, image: np.ndarray) -> float:
        """Return |x|^2."""
        return float((image**2).sum())

    def gradient(self, image: np.ndarray) -> np.ndarray:
        """Return 2 x."""
        return 2.0 * image

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return x / (1 + 2 step)."""
        return image / (1 + 2 * step)

    def operator(self, shape: tuple[int, int]) -> Any:
        """Return the identity as a scipy ``LinearOperator``."""
        from scipy.sparse.linalg import LinearOperator

        n = shape[0] * shape[1]
        return LinearOperator((n, n), matvec=lambda image: image, rmatvec=lambda image: image, dtype=float)
