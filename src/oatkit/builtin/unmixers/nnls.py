"""Unmixing without negative concentrations."""

from typing import ClassVar

import numpy as np

from oatkit.builtin.unmixers.nonnegative import nonnegative
from oatkit.builtin.unmixers.spectral import SpectralUnmixer


class NnlsUnmixer(SpectralUnmixer):
    r"""Non-negative least squares in each pixel, solved exactly.

    .. math:: \min_{c \ge 0} \sum_\lambda \frac{1}{\sigma_\lambda^2}
        \left(\sum_k \varepsilon_k(\lambda) c_k - \mu_a(\lambda)\right)^2

    It takes the absorption where the pipeline has it, else the initial pressure, whose spectrum is coloured by the
    light that was lost on its way: deep saturations are then wrong. ``so2`` lies in [0, 1] by construction.
    """

    name: ClassVar[str] = "nnls"

    def _solve(self, spectra: np.ndarray, data: np.ndarray) -> np.ndarray:
        return nonnegative(spectra, data)
