"""What an HDF5 file of PATATO says of each pulse, and other small datasets that it may lack."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.builtin.readers.ithera_pulses import UNIX_EPOCH_TICKS
from oatkit.builtin.readers.patato_layout import has
from oatkit.hostile import hdf5_dataset
from oatkit.scanfile import MAX_ARRAY_BYTES

CORRECTIONS = ("OverallCorrectionFactor", "POWER")
"""Where the factor stands by which signals are divided; old files have it in the second, the first being all NaN."""


@dataclass(frozen=True)
class Pulses:
    """Arrays ``(frame, wavelength)``, None where the file does not tell, and notes on what was left out."""

    energy: np.ndarray | None
    temperature_c: np.ndarray | None
    timestamps_s: np.ndarray | None
    position_m: np.ndarray | None
    notes: tuple[str, ...]


def pulses(file: Any, shape: tuple[int, int]) -> Pulses:
    """Return what is known of the pulses of a scan with that many frames and wavelengths. Raises `ReadError`."""
    notes: list[str] = []
    corrections = [_known(file, name, shape, notes) for name in CORRECTIONS]
    ticks = _known(file, "timestamp", shape, notes)
    position_mm = _known(file, "Z-POS", shape, notes)
    return Pulses(
        next((factors for factors in corrections if factors is not None), None),
        _known(file, "TEMPERATURE", shape, notes),
        None if ticks is None else _seconds(ticks, notes),
        None if position_mm is None else 1e-3 * position_mm,
        tuple(notes),
    )


def optional(file: Any, name: str, notes: list[str], shape: tuple[int, ...]) -> np.ndarray | None:
    """Return a dataset of real numbers, or None, with a note, where it is missing or of another type or shape."""
    if not has(file, name):
        return None
    stored = hdf5_dataset(file, name, "biufcSVmM", range(33), MAX_ARRAY_BYTES)
    if stored.dtype.kind not in "biuf" or stored.shape != shape:
        notes.append(f"{name} is left out: expected numbers of shape {shape}, found {stored.dtype} of {stored.shape}.")
        return None
    return np.asarray(stored[()])


def scan_wavelengths(file: Any) -> np.ndarray | None:
    """Return the wavelengths of the scan, nm, or None where the file has none."""
    if not has(file, "wavelengths"):
        return None
    return np.asarray(hdf5_dataset(file, "wavelengths", "iuf", 1, MAX_ARRAY_BYTES)[()], float)


def _known(file: Any, name: str, shape: tuple[int, int], notes: list[str]) -> np.ndarray | None:
    """Return a number for each pulse, or None, with a note, where not all of them are known."""
    values = optional(file, name, notes, shape)
    unknown = 0 if values is None else int((~np.isfinite(values)).sum())
    if unknown:
        notes.append(f"{name} is unknown for {unknown} of {shape[0] * shape[1]} pulses and left out.")
    return None if unknown else values


def _seconds(ticks: np.ndarray, notes: list[str]) -> np.ndarray:
    """Return ticks of 100 ns since the year 1 as seconds since 1970; since an unknown start where they are too few."""
    if ticks.min() < UNIX_EPOCH_TICKS:
        notes.append("Timestamps begin before 1970: they are taken as seconds since an unknown start.")
        return 1e-7 * ticks.astype(float)
    return 1e-7 * (ticks - ticks.dtype.type(UNIX_EPOCH_TICKS)).astype(float)
