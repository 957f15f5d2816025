"""A scan cut down to what a coarse image can hold: fewer detectors, fewer samples, a narrower band."""

from dataclasses import replace

import numpy as np

from oatkit.data import Detectors, Geometry, Grid, Scan

PASS, STOP = 0.4, 0.6
"""Cycles per pixel up to which a pixel's waves are kept whole, and from which they are gone, as in the arc model."""


def coarsened(clean: Scan, grid: Grid) -> Scan:
    """Return a preprocessed frame with as few detectors and samples as an image on `grid` needs.

    The band that the pixels can hold at the scan's speed of sound is kept, by a zero-phase low-pass that is convolved
    into the impulse response too, so that the model predicts what was left; beyond it lies nothing but misfit. Sampling
    is as slow as that band allows. Of the detectors every n-th in the order of their angles is kept, as near to each
    other as the shortest wave asks at the edge of the grid. Records are not cropped to the arrival times of the grid:
    what follows them belongs to the response of the low edge of a band-pass.
    """
    geometry = clean.geometry
    per_pixel_hz = geometry.speed_of_sound_m_s / grid.pixel_size_m
    factor = max(1, int(geometry.sampling_rate_hz / (2 * STOP * per_pixel_hz)))
    kept = thinned(geometry.detectors.positions_m, grid)
    decimate = Decimation(factor, geometry.sampling_rate_hz, PASS * per_pixel_hz, STOP * per_pixel_hz)
    signals = decimate.signals(np.asarray(clean.signals)[:, :, kept])
    slower = Geometry(
        Detectors(geometry.detectors.positions_m[kept]),
        geometry.sampling_rate_hz / factor,
        signals.shape[-1],
        geometry.start_time_s,
        geometry.speed_of_sound_m_s,
        decimate.response(geometry.impulse_response, geometry.n_samples),
    )
    return replace(clean, signals=signals, geometry=slower, valid=clean.valid[:, :, kept])


def thinned(positions_m: np.ndarray, grid: Grid) -> np.ndarray:
    """Return the indices of the detectors that are kept.

    Seen from the middle of the grid, detectors further apart than half a wave of `PASS` over half the grid's side make
    streaks within the circle that fits into the grid.
    """
    y, x = (positions_m - np.asarray(grid.centre_m)).T
    angles = np.arctan2(y, x)
    order = np.argsort(angles, kind="stable")
    gap = float(np.median(np.diff(angles[order]))) if len(order) > 1 else 0.0
    widest = (0.5 / PASS) / (max(grid.shape) / 2)
    every = max(1, int(widest / gap)) if gap > 0 else 1
    return np.sort(order[::every])


class Decimation:
    """A low-pass and a slower sampling, of signals and of impulse responses alike."""

    def __init__(self, factor: int, rate_hz: float, start_hz: float, stop_hz: float) -> None:
        self.factor, self.rate_hz = factor, rate_hz
        self.start_hz, self.stop_hz = start_hz, stop_hz

    def signals(self, signals: np.ndarray) -> np.ndarray:
        """Return every `factor`-th sample of the low-passed signals, the first one first; they count as 0 outside."""
        n = signals.shape[-1]
        slow = self._slow(signals, self._length(2 * n))
        return slow[..., : -(-n // self.factor)] / np.float32(self.factor)

    def response(self, response: np.ndarray | None, n_samples: int) -> np.ndarray:
        """Return an impulse response on the slower axis, as far as a record of `n_samples` of the faster can see it."""
        given = np.ones(1) if response is None else response
        length = self._length(len(given) + 2 * n_samples)
        padded = np.pad(given, (0, length * self.factor - len(given)))
        # Time zero comes first for the FFT, and goes back to the middle after it.
        slow = self._slow(np.roll(padded, -(len(given) // 2)), length)
        reach = -(-n_samples // self.factor)
        return np.roll(slow, reach)[: 2 * reach + 1]

    def _length(self, samples: int) -> int:
        """Return a length on the slower axis, quick to transform, that holds so many samples of the faster one."""
        from scipy import fft

        return fft.next_fast_len(-(-samples // self.factor) + 1, real=True)

    def _slow(self, values: np.ndarray, length: int) -> np.ndarray:
        """Return values on the slower axis, `factor` times too large: the spectrum within the band is as it was."""
        from scipy import fft

        bins = fft.rfft(values, length * self.factor)[..., : length // 2 + 1]
        gain = self._gain(np.arange(length // 2 + 1) * self.rate_hz / (length * self.factor))
        return fft.irfft(bins * gain.astype(bins.real.dtype), length)

    def _gain(self, frequency_hz: np.ndarray) -> np.ndarray:
        progress = np.clip((frequency_hz - self.start_hz) / (self.stop_hz - self.start_hz), 0, 1)
        return 0.5 * (1 + np.cos(np.pi * progress))
