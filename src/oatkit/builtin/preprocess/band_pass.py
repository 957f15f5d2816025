"""Zero-phase band-pass, of the data and of the model."""

from dataclasses import replace
from typing import ClassVar, Self

import numpy as np
from pydantic import model_validator
from pydantic_core import PydanticCustomError

from oatkit.api import Geometry, Preprocessor, Scan, ValidationError, param
from oatkit.builtin.preprocess.samples import check_offset_removed, finite_samples


class BandPass(Preprocessor):
    r"""Multiplies the spectrum by the squared magnitudes of a Butterworth low-pass and a high-pass.

    .. math:: G(f) = \frac{1}{1 + (f/f_{high})^{2n}} \cdot \frac{(f/f_{low})^{2n}}{1 + (f/f_{low})^{2n}}

    The phase is zero, and G is 1/2 at either edge. The same response is convolved into the geometry's impulse response,
    so that the forward model predicts filtered signals. The data count as zero outside of the record, the model's
    signals do not: where the field of view reaches beyond an end of it (or into what the step `transient` cut off),
    data and model differ next to that end, for a time of the order of 1 / low.
    """

    name: ClassVar[str] = "band-pass"
    low: float = param(0.1, "lower edge; 0 for a low-pass", unit="MHz", at_least=0)
    high: float = param(7.0, "upper edge, below half the sampling rate", unit="MHz", above=0)
    order: int = param(4, "steepness: the order n of the Butterworth filters", at_least=1, at_most=20)

    @model_validator(mode="after")
    def _edges(self) -> Self:
        if not self.low < self.high:
            text = "low must be below high, got {low} and {high} MHz"
            raise PydanticCustomError("oatkit", text, {"low": self.low, "high": self.high})
        return self

    def process(self, scan: Scan) -> Scan:
        """Return the filtered scan. Raises `ValidationError` where the upper edge is above half the sampling rate."""
        from scipy import fft

        nyquist = scan.geometry.sampling_rate_hz / 2
        if not self.high * 1e6 < nyquist:
            raise ValidationError(f"band-pass: high must be below {nyquist / 1e6:g} MHz, got {self.high:g} MHz")
        samples = finite_samples(scan, self.name)
        check_offset_removed(samples, scan.valid, self.name)
        n = scan.geometry.n_samples
        length = _padded(n)
        gain = self.gain(fft.rfftfreq(length, 1 / scan.geometry.sampling_rate_hz)).astype(samples.dtype)
        filtered = fft.irfft(fft.rfft(samples, length) * gain, length)[..., :n]
        note = (
            f"band-pass: {self.low:g} .. {self.high:g} MHz, order {self.order}, zero phase; the model is filtered too."
        )
        return replace(scan, signals=filtered, geometry=self._filtered(scan.geometry), notes=(*scan.notes, note))

    def gain(self, frequency_hz: np.ndarray) -> np.ndarray:
        """Return G at frequencies in Hz."""
        power = 2 * self.order
        with np.errstate(over="ignore"):  # far above an edge the power is infinite, and its reciprocal right
            passed = 1 / (1 + (frequency_hz / (1e6 * self.high)) ** power)
            if self.low > 0:
                passed = passed * (1 - 1 / (1 + (frequency_hz / (1e6 * self.low)) ** power))
        return passed

    def _filtered(self, geometry: Geometry) -> Geometry:
        """Return the geometry with its impulse response filtered, as far as a record can see it."""
        from scipy import fft

        n = geometry.n_samples
        length = _padded(n)
        gain = self.gain(fft.rfftfreq(length, 1 / geometry.sampling_rate_hz))
        # What is later or earlier than the length of a record leads out of it.
        kernel = np.roll(fft.irfft(gain, length), n - 1)[: 2 * n - 1]
        given = np.ones(1) if geometry.impulse_response is None else geometry.impulse_response
        length = fft.next_fast_len(len(given) + 2 * n, real=True)
        both = fft.irfft(fft.rfft(given, length) * fft.rfft(kernel, length), length)
        return replace(geometry, impulse_response=both[len(given) // 2 :][: 2 * n - 1])


def _padded(n: int) -> int:
    """Return the length of an FFT in which a record of `n` samples does not meet itself."""
    from scipy import fft

    return fft.next_fast_len(2 * n, real=True)
