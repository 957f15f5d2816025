"""The gradient of an image by forward differences."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from oatkit.builtin.regularizers.analysis import Analysis, Ascent


@dataclass(frozen=True)
class Gradient(Analysis):
    """Forward differences along y and along x, two parts; none across the last row and the last column (Neumann)."""

    norm_squared: ClassVar[float] = 8.0
    orthonormal: ClassVar[bool] = False

    def analyse(self, image: np.ndarray) -> np.ndarray:
        """Return the differences, shape ``(2, y, x)``."""
        out = np.zeros((2, *image.shape))
        np.subtract(image[1:], image[:-1], out=out[0, :-1])
        np.subtract(image[:, 1:], image[:, :-1], out=out[1, :, :-1])
        return out

    def adjoint(self, coefficients: np.ndarray) -> np.ndarray:
        """Return minus the divergence, by backward differences."""
        down, across = coefficients[0, :-1], coefficients[1, :, :-1]
        out = np.zeros(coefficients.shape[1:])
        out[:-1] -= down
        out[1:] += down
        out[:, :-1] -= across
        out[:, 1:] += across
        return out

    def ascend(self, ascent: Ascent, image: np.ndarray, step: float, non_negative: bool, n_steps: int) -> Ascent:
        """Take the steps in compiled code, about five times as fast at 200 x 200 pixels."""
        from oatkit.builtin.regularizers.gradient_kernels import ascend

        buffers = np.array(ascent.dual), np.array(ascent.previous)
        return Ascent(*ascend(*buffers, np.ascontiguousarray(image), step, non_negative, ascent.momentum, n_steps))

    def preimage(self, image: np.ndarray) -> np.ndarray:
        """Return the gradient of the solution of Poisson's equation for image - mean, by cosine transforms."""
        from scipy.fft import dctn, idctn

        rows, columns = (2 - 2 * np.cos(np.pi * np.arange(n) / n) for n in image.shape)
        eigenvalues = rows[:, None] + columns
        eigenvalues[0, 0] = np.inf
        return self.analyse(idctn(dctn(image) / eigenvalues))
