"""Roughness: the squared norm of the Laplacian."""

from typing import Any, ClassVar

import numpy as np

from oatkit.api import Quadratic, Smooth
from oatkit.laplacian import laplacian


class Laplacian(Quadratic, Smooth):
    """|L x|^2 with the 5-point Laplacian L in pixel units and Neumann edges: straight slopes are free [Prakash2019]_.

    L is symmetric. A constant image costs nothing.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """

    name: ClassVar[str] = "laplacian"

    def value(self, image: np.ndarray) -> float:
        """Return |L x|^2."""
        return float((laplacian(image) ** 2).sum())

    def gradient(self, image: np.ndarray) -> np.ndarray:
        """Return 2 L L x."""
        return 2 * laplacian(laplacian(image))

    def operator(self, shape: tuple[int, int]) -> Any:
        """Return L as a scipy ``LinearOperator``."""
        from scipy.sparse.linalg import LinearOperator

        def apply(image: np.ndarray) -> np.ndarray:
            return laplacian(image.reshape(shape)).ravel()

        n = shape[0] * shape[1]
        return LinearOperator((n, n), matvec=apply, rmatvec=apply, dtype=float)
