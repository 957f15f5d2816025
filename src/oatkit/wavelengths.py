"""Which wavelengths of a scan are used, and what to know of their order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from oatkit.data import Scan, Signals
from oatkit.errors import ValidationError

NEAR_NM = 0.5
"""A wavelength that is asked for stands for those of the scan that are at most so far from it."""


@dataclass(frozen=True)
class ChosenSignals:
    """Some wavelengths of signals that lie in a file, whose frames are read as they are asked for.

    An index begins with a frame, a slice of frames or ``...``; the rest is what numpy takes.
    """

    signals: Signals
    chosen: tuple[int, ...]
    """Indices of the wavelengths."""

    @property
    def shape(self) -> tuple[int, ...]:
        """``(frame, wavelength, detector, sample)``."""
        frames, _, *record = self.signals.shape
        return (frames, len(self.chosen), *record)

    @property
    def dtype(self) -> np.dtype:
        """That of the file."""
        return self.signals.dtype

    @property
    def fingerprint(self) -> str:
        """Identifies the content, without reading it."""
        return f"{getattr(self.signals, 'fingerprint', '')} at {self.chosen}"

    def __getitem__(self, index: Any) -> np.ndarray:
        first, *rest = index if isinstance(index, tuple) else (index,)
        if first is Ellipsis:
            return self[:][index]
        values = np.asarray(self.signals[first])[..., list(self.chosen), :, :]
        return values[(*[slice(None)] * (values.ndim - 3), *rest)]


def choose_wavelengths(scan: Scan, wanted_nm: Sequence[float]) -> Scan:
    """Return the scan at those of its wavelengths that are within `NEAR_NM` of one of `wanted_nm`, in its own order.

    Repeated ones stay repeated and unsorted ones unsorted. Signals in a file stay there. Raises `ValidationError` for a
    wavelength that the scan does not have.
    """
    apart = np.abs(np.subtract.outer(np.array(wanted_nm, float), np.array(scan.wavelengths_nm)))
    near = apart <= NEAR_NM + 1e-9
    missing = [f"{wanted:g}" for wanted, found in zip(wanted_nm, near.any(axis=1), strict=True) if not found]
    if missing:
        there = ", ".join(f"{w:g}" for w in scan.wavelengths_nm)
        raise ValidationError(f"[scan].wavelengths_nm: the scan has no {', '.join(missing)} nm; it has {there} nm")
    chosen = [int(i) for i in np.flatnonzero(near.any(axis=0))]
    per_pulse = ("valid", "pulse_energy", "temperature_c", "timestamps_s", "position_m")
    parts: dict[str, Any] = {k: v[:, chosen] for k in per_pulse if (v := getattr(scan, k)) is not None}
    held = isinstance(scan.signals, np.ndarray)
    signals = scan.signals[:, chosen] if held else ChosenSignals(scan.signals, tuple(chosen))
    return replace(scan, signals=signals, wavelengths_nm=tuple(scan.wavelengths_nm[i] for i in chosen), **parts)


def wavelength_notes(wavelengths_nm: tuple[float, ...]) -> tuple[str, ...]:
    """Say which wavelengths come more than once, and whether they are in rising order."""
    known = list(dict.fromkeys(wavelengths_nm))
    repeated = [f"{w:g} nm {wavelengths_nm.count(w)} times" for w in known if wavelengths_nm.count(w) > 1]
    notes = [f"wavelengths: the scan has {', '.join(repeated)}; each is an image of its own"] if repeated else []
    if known != sorted(known):
        notes.append("wavelengths: they are in no rising order; images keep the order of the scan")
    return tuple(notes)
