"""Which part of a record a grid can reach."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from oatkit.api import Geometry, Grid

SPARE = 4
"""Samples between a window's ends and the arrival times it holds: room for a cubic spline and for rounding."""


@dataclass(frozen=True)
class Windows:
    """One window of samples per detector, all of one length; parts of it may lie outside the record."""

    first: np.ndarray
    """Index of the first sample of each detector's window, shape ``(detector,)``; may be negative."""
    length: int
    """Samples in each window."""
    n_samples: int
    """Samples in the record."""

    def widened(self, before: int, after: int) -> "Windows":
        """Return windows that start `before` samples earlier and end `after` samples later."""
        return Windows(self.first - before, self.length + before + after, self.n_samples)

    def place(self, detectors: np.ndarray, values: np.ndarray, record: np.ndarray) -> None:
        """Write `values`, a row per window of the `detectors`, into `record`, shape ``(detector, sample)``."""
        for row, detector in enumerate(detectors):
            inside, part = self._overlaps[detector]
            record[detector, inside] = values[row, part]

    def cut(self, detectors: np.ndarray, record: np.ndarray) -> np.ndarray:
        """Return the windows of the `detectors` out of `record`, zero outside; the transpose of `place`."""
        values = np.zeros((len(detectors), self.length), record.dtype)
        for row, detector in enumerate(detectors):
            inside, part = self._overlaps[detector]
            values[row, part] = record[detector, inside]
        return values

    @cached_property
    def _overlaps(self) -> list[tuple[slice, slice]]:
        """For each detector, where record and window meet: the slice of the record, the slice of the window."""
        start = np.clip(self.first, 0, self.n_samples)
        stop = np.clip(self.first + self.length, 0, self.n_samples)
        edges = zip(start.tolist(), stop.tolist(), self.first.tolist(), strict=True)
        return [(slice(a, b), slice(a - first, b - first)) for a, b, first in edges]


def reached(geometry: Geometry, grid: Grid) -> Windows:
    """Return the windows that hold the arrival times of the whole grid, with `SPARE` samples at both ends."""
    near, far = geometry.reach(grid)
    step_m = geometry.speed_of_sound_m_s / geometry.sampling_rate_hz
    start = geometry.start_time_s * geometry.sampling_rate_hz
    first = np.floor(near / step_m - start).astype(np.int64) - SPARE
    last = np.ceil(far / step_m - start).astype(np.int64) + SPARE
    return Windows(first, int(np.max(last - first)) + 1, geometry.n_samples)
