"""Channels that cannot be trusted."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Preprocessor, ReadError, Scan, param
from oatkit.builtin.preprocess.samples import window


class Channels(Preprocessor):
    """Finds channels that are not finite, dead, saturated or noisy, sets them to zero and marks them in ``valid``.

    It comes first: saturation shows only in the whole numbers of the instrument, at the limits of their type. Each
    wavelength is judged by itself, outside the transient of the light pulse.
    """

    name: ClassVar[str] = "channels"
    after: float = param(
        3.75, "only samples from this time on are judged, after the light pulse", unit="us", at_least=0
    )
    dead: float = param(0.01, "dead: standard deviation at most this part of the median channel's", at_least=0, below=1)
    noisy: float | Literal["off"] = param("off", "noisy: standard deviation above so many of the median's", above=1)
    saturated: float = param(0.001, "saturated: more than this share of samples at a limit", at_least=0, below=1)

    def process(self, scan: Scan) -> Scan:
        """Return the scan with its bad channels at zero and marked. Raises `ReadError` where none is left."""
        signals = np.array(scan.signals)
        judged = signals[0, ..., window(scan.geometry, self.after, float("inf"), self.name)]
        valid = scan.valid.copy()
        notes = list(scan.notes)
        if signals.dtype.kind == "f":
            notes.append("channels: saturation cannot be seen, since the signals are no whole numbers.")
        where: dict[str, list[str]] = {}
        for i, wavelength in enumerate(scan.wavelengths_nm):
            found = dict(self._bad(signals[0, i], judged[i], valid[0, i]))
            for bad in found.values():
                valid[0, i] &= ~bad
            if found:
                where.setdefault(_listed(found), []).append(f"{wavelength:g}")
            if not valid[0, i].any():
                raise ReadError(f"channels: no channel is left at {wavelength:g} nm ({_listed(found)})")
        notes += [f"channels: not used at {', '.join(at)} nm: {which}." for which, at in where.items()]
        signals[~valid] = 0
        return replace(scan, signals=signals, valid=valid, notes=tuple(notes))

    def _bad(self, signals: np.ndarray, judged: np.ndarray, valid: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        """Yield each fault with the channels that have it, of signals ``(detector, sample)``; each channel once."""
        faults = {"not finite": ~np.isfinite(signals).all(axis=1)}
        usable = valid & ~faults["not finite"]
        spread = np.zeros(len(signals))
        spread[usable] = judged[usable].std(axis=1, dtype=float)
        alive = spread[usable & (spread > 0)]
        typical = float(np.median(alive)) if alive.size else 0.0
        # Before saturated: all zeros are at a limit, too.
        faults["dead"] = spread <= self.dead * typical
        if signals.dtype.kind in "iu":
            limits = np.iinfo(signals.dtype)
            at_limit = (judged == limits.min) | (judged == limits.max)
            faults["saturated"] = at_limit.mean(axis=1) > self.saturated
        if self.noisy != "off":
            faults["noisy"] = spread > self.noisy * typical
        left = valid.copy()
        for fault, bad in faults.items():
            if (bad & left).any():
                yield fault, bad & left
            left &= ~bad


def _listed(found: dict[str, np.ndarray]) -> str:
    """Name the channels of each fault, the first ten by their index."""
    parts = []
    for fault, bad in found.items():
        which = np.flatnonzero(bad)
        more = f" and {len(which) - 10} more" if len(which) > 10 else ""
        parts.append(f"{', '.join(map(str, which[:10]))}{more} {fault}")
    return "; ".join(parts) or "none was valid before"
