"""Removal of the constant offset of each channel."""

import math
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Preprocessor, Scan, param
from oatkit.builtin.preprocess.samples import finite_samples, window


class Offset(Preprocessor):
    """Subtracts from each channel its median, or mean, over a window of time.

    Whole numbers become floats first, so that nothing wraps. The median is not moved by the short, strong transient of
    the light pulse nor by bipolar signals; the mean needs a quiet window.
    """

    name: ClassVar[str] = "offset"
    statistic: Literal["median", "mean"] = param("median", "what is taken for the offset of a channel")
    start: float = param(0.0, "begin of the window, after the light pulse", unit="us", at_least=0)
    stop: float | Literal["end"] = param(
        "end", "end of the window: a time, or the end of the record", unit="us", above=0
    )

    def process(self, scan: Scan) -> Scan:
        """Return the scan about zero, as float32 or float64."""
        samples = finite_samples(scan, self.name)
        stop = math.inf if self.stop == "end" else self.stop
        quiet = samples[..., window(scan.geometry, self.start, stop, self.name)]
        level = np.median(quiet, axis=3) if self.statistic == "median" else quiet.mean(axis=3, dtype=float)
        level = level.astype(samples.dtype)
        note = f"offset: the {self.statistic} of each channel, {level.min():.6g} .. {level.max():.6g}, was subtracted."
        return replace(scan, signals=samples - level[..., None], notes=(*scan.notes, note))
