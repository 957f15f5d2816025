"""Linear convolution along the sample axis by real FFTs, with its exact transpose."""

from dataclasses import dataclass

import numpy as np
from scipy import fft


@dataclass(frozen=True)
class Filter:
    """A convolution that takes signals from one time axis to another, both starting at the same time."""

    spectrum: np.ndarray
    """Complex, shape ``(bin,)``; real in the bins at zero and at half the length of an FFT, where it has these."""
    fft_in: int
    """Length of the FFT of what comes in."""
    fft_out: int
    """Length of the FFT of what goes out; the rates of the two axes are as these lengths."""
    n_in: int
    n_out: int

    def apply(self, signals: np.ndarray) -> np.ndarray:
        """Map ``(row, n_in)`` to ``(row, n_out)``."""
        bins = fft.rfft(signals, self.fft_in)[:, : len(self.spectrum)]
        return fft.irfft(bins * self.spectrum, self.fft_out)[:, : self.n_out]

    def adjoint(self, signals: np.ndarray) -> np.ndarray:
        """Map ``(row, n_out)`` to ``(row, n_in)``; the transpose of `apply`."""
        bins = fft.rfft(signals, self.fft_out)[:, : len(self.spectrum)]
        scaled = (self.fft_in / self.fft_out) * self.spectrum.conj()
        return fft.irfft(bins * scaled, self.fft_in)[:, : self.n_in]


@dataclass(frozen=True)
class Response:
    """A sampled impulse response."""

    values: np.ndarray
    before: int
    """Samples before time zero."""

    @classmethod
    def of(cls, values: np.ndarray | None) -> "Response":
        """Take the impulse response of a geometry, time zero at index ``n // 2``; None is the unit pulse."""
        values = np.ones(1) if values is None else values
        return cls(values, len(values) // 2)

    @property
    def after(self) -> int:
        """Samples after time zero."""
        return len(self.values) - 1 - self.before

    def padded(self, margin: int) -> "Response":
        """Return the same response with `margin` zeros at both ends."""
        return Response(np.pad(self.values, margin), self.before + margin)

    def trimmed(self, before: int, after: int) -> "Response":
        """Return the part that reaches at most `before` samples back and `after` samples ahead."""
        before, after = min(before, self.before), min(after, self.after)
        return Response(self.values[self.before - before : self.before + after + 1], before)

    def spectrum(self, length: int) -> np.ndarray:
        """Return its spectrum for FFTs of `length`; filtered signals start `before` samples earlier than raw ones."""
        return fft.rfft(self.values, length)
