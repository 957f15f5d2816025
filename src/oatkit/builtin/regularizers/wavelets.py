"""Orthonormal wavelet transforms of an image."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from oatkit.api import ValidationError
from oatkit.builtin.regularizers.analysis import Analysis

INSTALL = "the wavelet basis needs PyWavelets: pip install 'oatkit[wavelet]'"


@dataclass(frozen=True)
class Wavelets(Analysis):
    """The periodic discrete wavelet transform, one part: the coarse image in the corner at row 0, details around it.

    Raises `ValidationError` where PyWavelets is missing, where it has no orthonormal wavelet of that name, and where a
    side of the image is odd.
    """

    wavelet: str
    levels: int
    """Largest number of levels; there are fewer where a side holds fewer factors of two."""
    norm_squared: ClassVar[float] = 1.0
    orthonormal: ClassVar[bool] = True

    def analyse(self, image: np.ndarray) -> np.ndarray:
        """Return the coefficients, shape ``(1, y, x)``."""
        out = np.array(image, dtype=float)[None]
        for ny, nx in self._shapes(image.shape):
            coarse, (y, x, both) = self._pywt.dwt2(out[0, :ny, :nx], self._filters, mode="periodization")
            out[0, :ny, :nx] = np.block([[coarse, x], [y, both]])
        return out

    def adjoint(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the image of these coefficients."""
        out = np.array(coefficients[0])
        for ny, nx in reversed(self._shapes(out.shape)):
            upper, lower = (np.hsplit(half, 2) for half in np.vsplit(out[:ny, :nx], 2))
            bands = upper[0], (lower[0], upper[1], lower[1])
            out[:ny, :nx] = self._pywt.idwt2(bands, self._filters, mode="periodization")
        return out

    def preimage(self, image: np.ndarray) -> np.ndarray:
        """Return the coefficients: the inverse of the adjoint is the transform."""
        return self.analyse(image)

    def _shapes(self, shape: tuple[int, ...]) -> list[tuple[int, int]]:
        """Return the shape of what is split at each level."""
        ny, nx = shape
        shapes: list[tuple[int, int]] = []
        while len(shapes) < self.levels and ny % 2 == nx % 2 == 0:
            shapes.append((ny, nx))
            ny, nx = ny // 2, nx // 2
        if not shapes:
            even = " x ".join(str(n + n % 2) for n in shape)
            raise ValidationError(
                f"l1: a wavelet basis needs an even number of rows and of columns, got {ny} x {nx}; take {even} "
                "pixels, or better a multiple of 8, or basis = 'pixel'"
            )
        return shapes

    @cached_property
    def _pywt(self) -> Any:
        try:
            import pywt
        except ImportError:
            raise ValidationError(INSTALL) from None
        return pywt

    @cached_property
    def _filters(self) -> Any:
        if self.wavelet not in self._pywt.wavelist(kind="discrete"):
            raise ValidationError(f"l1: PyWavelets has no discrete wavelet named '{self.wavelet}'; 'db4' is one")
        filters = self._pywt.Wavelet(self.wavelet)
        low = np.array(filters.dec_lo)
        products = np.correlate(low, low, "full")[len(low) - 1 :: 2]
        products[0] -= 1
        if not (filters.orthogonal and abs(products).max() <= 1e-9):
            raise ValidationError(f"l1: the wavelet '{self.wavelet}' is not orthonormal; take a db, sym or coif")
        return filters
