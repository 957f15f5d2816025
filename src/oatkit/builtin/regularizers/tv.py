"""Total variation: the penalty for piecewise constant images."""

from typing import ClassVar

import numpy as np

from oatkit.api import Proximable
from oatkit.builtin.regularizers.dual_prox import proximal
from oatkit.builtin.regularizers.gradient import Gradient
from oatkit.vectors import norm

ROUNDING = 1e-15
"""Relative accuracy to which the proximal map is sought."""

N_STEPS = 20_000
"""It ends after so many steps at the latest."""


class TotalVariation(Proximable):
    """The sum over pixels of the length of the gradient: isotropic, by forward differences per pixel, Neumann edges.

    A constant image costs nothing; the edge of a region costs its length times its height, whatever its sharpness.
    """

    name: ClassVar[str] = "tv"
    degree: ClassVar[int] = 1

    def value(self, image: np.ndarray) -> float:
        """Return the total variation."""
        return Gradient().value(np.asarray(image, dtype=float))

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return the proximal point v - K^T y by its dual [Beck2009b]_.

        Its objective is within 1e-15 of |v|^2 / 2 + step |v|_1 of the minimum, about the rounding of its terms, where
        20 000 steps suffice: they did for images of 20 x 20 pixels and steps up to their height.

        References:
            [Beck2009b] Beck and Teboulle, IEEE Trans. Image Process. 18, 2419 (2009), 10.1109/TIP.2009.2028250.
        """
        image = np.asarray(image, dtype=float)
        largest_gap = ROUNDING * (norm(image) ** 2 / 2 + step * float(np.abs(image).sum()))
        return proximal(Gradient(), image, step, False, largest_gap, N_STEPS).image
