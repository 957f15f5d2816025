"""Penalties of PyProximal."""

from abc import abstractmethod
from typing import Any, ClassVar, Literal

import numpy as np

from oatkit.api import Proximable, param


class Penalty(Proximable):
    """What penalties of PyProximal have in common: they take raveled images."""

    degree: ClassVar[int] = 1

    @abstractmethod
    def of_shape(self, shape: tuple[int, ...]) -> Any:
        """Return PyProximal's ``ProxOperator`` for images of a shape."""

    def value(self, image: np.ndarray) -> float:
        """Return the penalty of an image."""
        return float(self.of_shape(np.shape(image))(np.asarray(image, dtype=float).ravel()))

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return the proximal point of an image."""
        image = np.array(image, dtype=float)
        if step == 0:
            return image  # which PyProximal refuses
        return np.reshape(self.of_shape(image.shape).prox(image.ravel(), step), image.shape)


class L1(Penalty):
    """|x|_1, the sum of the absolute values of the pixels, by PyProximal."""

    name: ClassVar[str] = "pyproximal-l1"

    def of_shape(self, shape: tuple[int, ...]) -> Any:
        """Return PyProximal's L1."""
        from pyproximal import L1 as Operator

        return Operator()


class L21(Penalty):
    """sum_j |x_j| over the columns x_j of the image, or over its rows, by PyProximal: whole ones become zero.

    References:
        Yuan and Lin, J. R. Stat. Soc. B 68, 49 (2006), 10.1111/j.1467-9868.2005.00532.x.
    """

    name: ClassVar[str] = "pyproximal-l21"
    groups: Literal["columns", "rows"] = param("columns", "what is zero as a whole or not")

    def of_shape(self, shape: tuple[int, ...]) -> Any:
        """Return PyProximal's L21 of columns."""
        from pyproximal import L21 as Operator

        return Operator(shape[0])

    def value(self, image: np.ndarray) -> float:
        """Return the penalty of an image."""
        return super().value(self._turned(image))

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return the proximal point of an image."""
        return self._turned(super().prox(self._turned(image), step))

    def _turned(self, image: np.ndarray) -> np.ndarray:
        return np.transpose(image) if self.groups == "rows" else image


class Nuclear(Penalty):
    """The sum of the singular values of the image, by PyProximal: few patterns along y, each times one along x.

    References:
        Cai, Candes and Shen, SIAM J. Optim. 20, 1956 (2010), 10.1137/080738970.
    """

    name: ClassVar[str] = "pyproximal-nuclear"

    def of_shape(self, shape: tuple[int, ...]) -> Any:
        """Return PyProximal's nuclear norm."""
        from pyproximal import Nuclear as Operator

        return Operator(shape)

    def value(self, image: np.ndarray) -> float:
        """Return the penalty of an image.

        PyProximal takes roots of the eigenvalues of X^T X: a singular value of 0 comes out as 1e-8 of the largest.
        """
        return float(np.linalg.svd(image, compute_uv=False).sum())
