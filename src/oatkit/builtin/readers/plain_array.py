"""Scans in plain arrays: a ``.npy`` or ``.tif`` file of signals, described by a TOML file."""

import re
import tomllib
from pathlib import Path
from typing import ClassVar

import numpy as np

from oatkit.api import Detectors, Geometry, Reader, ReadError, Scan, ValidationError
from oatkit.builtin.readers.array_detectors import arc, positions
from oatkit.builtin.readers.array_response import impulse_response
from oatkit.builtin.readers.array_signals import ArraySignals, Pages, array_signals
from oatkit.builtin.readers.array_tables import MAX_BYTES, Description, PulsesTable, SignalsTable, read_description
from oatkit.builtin.readers.npy import npy_pages
from oatkit.builtin.readers.number_files import read_numbers
from oatkit.builtin.readers.tiff import tiff_pages
from oatkit.hostile import inside, printable, read_at_most
from oatkit.scanfile import PER_PULSE

SIGNAL_SUFFIXES = (".npy", ".tif", ".tiff")


class PlainArray(Reader):
    """Reads a ``.toml`` that describes a file of signals beside it, or that file where the two share a name.

    The description gives the order of axes, sampling, wavelengths and detectors; all files that it names lie in its
    folder. Signals stay in their file, as they are.
    """

    name: ClassVar[str] = "array"

    def can_read(self, path: Path) -> bool:
        """Claim a TOML file with a table ``[signals]``, and a ``.npy`` or ``.tif`` with such a file beside it."""
        try:
            return _describes_signals(_description_of(path))
        except (OSError, ValueError, ReadError):
            return False

    def read(self, path: Path) -> Scan:
        """Return the scan. Raises `ReadError`."""
        toml = _description_of(path)
        description = read_description(toml)
        signals_path = inside(toml.parent, description.signals.file)
        if path != toml and path.resolve() != signals_path.resolve():
            raise ReadError(f"{toml}: describes {description.signals.file!r}, not {path.name}")
        try:
            return _scan(toml, signals_path, description)
        except ValidationError as error:
            raise ReadError(f"{toml}: {error}") from None


def _description_of(path: Path) -> Path:
    return path.with_suffix(".toml") if path.suffix.lower() in SIGNAL_SUFFIXES else path


def _describes_signals(path: Path) -> bool:
    """Say whether a TOML file has a table ``[signals]`` and no ``[reconstruct]``, which is a pipeline's."""
    if path.suffix.lower() != ".toml":
        return False
    text = read_at_most(path, MAX_BYTES).decode("utf-8-sig")
    try:
        tables = set(tomllib.loads(text))
    except (ValueError, RecursionError):
        # Claimed in spite of a slip, so that reading it can say where the slip is.
        tables = set(re.findall(r"^\s*\[\s*(\w+)", text, re.MULTILINE))
    return "signals" in tables and "reconstruct" not in tables


def _scan(toml: Path, signals_path: Path, description: Description) -> Scan:
    table = description.signals
    detectors, notes = _detectors(description, toml.parent)
    known = {"wavelength": len(table.wavelengths_nm), "detector": detectors.count}
    signals = array_signals(signals_path, _pages(signals_path, table.axes, known))
    _check_lengths(signals, known)
    response, response_note = impulse_response(description.impulse_response, toml.parent)
    speed = table.speed_of_sound_m_s
    geometry = Geometry(
        detectors,
        table.sampling_rate_mhz * 1e6,
        signals.shape[3],
        table.start_time_us * 1e-6,
        Geometry.speed_of_sound_m_s if speed is None else speed,
        response,
    )
    return Scan(
        signals,
        geometry,
        table.wavelengths_nm,
        **_per_pulse(description.pulses, toml.parent, signals.shape[:2]),
        name=printable(toml.stem, 200),
        source=str(toml),
        reader=PlainArray.name,
        speed_of_sound_source="default" if speed is None else f"{toml.name}: {speed:g} m/s",
        notes=(*_assumed(table, signals), *filter(None, notes), response_note),
    )


def _detectors(description: Description, folder: Path) -> tuple[Detectors, list[str]]:
    if description.arc is not None:
        return arc(description.arc), []
    assert description.detectors is not None, "checked when the description was read"
    return positions(description.detectors, folder)


def _pages(path: Path, axes: tuple[str, ...], known: dict[str, int]) -> Pages:
    suffix = path.suffix.lower()
    if suffix not in SIGNAL_SUFFIXES:
        raise ReadError(f"{path}: expected signals in a file .npy, .tif or .tiff, found '{suffix}'")
    return npy_pages(path, axes) if suffix == ".npy" else tiff_pages(path, axes, known)


def _check_lengths(signals: ArraySignals, known: dict[str, int]) -> None:
    """Raise `ReadError` where an axis is not as long as the wavelengths or the detectors are many."""
    lengths = signals.pages.lengths
    for axis, expected in known.items():
        if lengths[axis] != expected:
            others = [other for other, length in lengths.items() if length == expected and other in signals.pages.axes]
            hint = f"; axis '{others[0]}' has that length: are 'axes' in the order of the file?" if others else ""
            raise ReadError(
                f"{signals.path}: axis '{axis}' has length {lengths[axis]}, by the description it is {expected}{hint}"
            )


def _per_pulse(table: PulsesTable, folder: Path, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Return the arrays of ``[pulses]`` by their names."""
    named = {name: inside(folder, file) for name in PER_PULSE if (file := getattr(table, name))}
    arrays = {name: read_numbers(path, table.dataset) for name, path in named.items()}
    for name, values in arrays.items():
        if values.shape != shape:
            raise ReadError(f"{named[name]}: expected the shape (frame, wavelength) {shape}, found {values.shape}")
    return arrays


def _assumed(table: SignalsTable, signals: ArraySignals) -> list[str]:
    """Return what the description leaves open, and what is taken instead."""
    missing = [axis for axis in signals.pages.axes if axis not in table.axes]
    notes = [f"The file has no axis {' and '.join(missing)}: length one assumed."] if missing else []
    if "start_time_us" not in table.model_fields_set:
        notes.append("The start time is not stated: the first sample is assumed at the light pulse.")
    if table.speed_of_sound_m_s is None:
        notes.append(f"The speed of sound is not stated: {Geometry.speed_of_sound_m_s:g} m/s assumed.")
    return notes
