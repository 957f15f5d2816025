"""Unmixing by least squares without bounds, as most software does it."""

from typing import ClassVar

import numpy as np

from oatkit.builtin.unmixers.nonnegative import least_squares
from oatkit.builtin.unmixers.spectral import SpectralUnmixer


class LstsqUnmixer(SpectralUnmixer):
    r"""Least squares in each pixel, by the pseudo-inverse of the spectra: for comparison with other software.

    .. math:: \min_c \sum_\lambda \frac{1}{\sigma_\lambda^2}
        \left(\sum_k \varepsilon_k(\lambda) c_k - \mu_a(\lambda)\right)^2

    Concentrations may be negative, and ``so2`` then lies outside of [0, 1]: it is what the method gives, and nothing is
    cut off. It takes the absorption where the pipeline has it, else the initial pressure.
    """

    name: ClassVar[str] = "lstsq"

    def _solve(self, spectra: np.ndarray, data: np.ndarray) -> np.ndarray:
        return least_squares(spectra, data)
