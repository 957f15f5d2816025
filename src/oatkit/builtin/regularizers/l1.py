"""Sum of absolute values: the penalty for sparse images."""

from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Proximable, param
from oatkit.builtin.regularizers.analysis import Analysis, Pixels
from oatkit.builtin.regularizers.dual_prox import proximal
from oatkit.builtin.regularizers.wavelets import Wavelets


class L1(Proximable):
    """|x|_1 of the pixels, or |W x|_1 of the coefficients of an orthonormal wavelet transform W, periodic at the edges.

    The coarse coefficients are penalised as the details are, so that it is a norm: the only image that costs nothing
    is zero. "wavelet" needs PyWavelets (``pip install 'oatkit[wavelet]'``) and an even number of rows and of columns.
    """

    name: ClassVar[str] = "l1"
    degree: ClassVar[int] = 1
    basis: Literal["pixel", "wavelet"] = param("pixel", "what is to be sparse: the pixels or the wavelet coefficients")
    wavelet: str = param("db4", "name of an orthonormal wavelet of PyWavelets")
    levels: int = param(
        3, "largest number of wavelet levels; fewer where a side holds fewer factors of two", at_least=1
    )

    def analysis(self) -> Analysis:
        """Return the operator whose coefficients are summed."""
        return Pixels() if self.basis == "pixel" else Wavelets(self.wavelet, self.levels)

    def value(self, image: np.ndarray) -> float:
        """Return the sum of absolute values. Raises `ValidationError` where the wavelet does not fit the image."""
        return self.analysis().value(np.asarray(image, dtype=float))

    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return the image with its coefficients moved towards 0 by `step`, and set to 0 where they are smaller."""
        return proximal(self.analysis(), np.asarray(image, dtype=float), step, False, 0.0, 0).image
