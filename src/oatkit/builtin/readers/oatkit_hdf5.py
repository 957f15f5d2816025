"""Scans in oatkit's own HDF5 file."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from oatkit.api import Detectors, Geometry, Reader, ReadError, Scan, ValidationError
from oatkit.builtin.readers.hdf5_signals import Hdf5Signals, hdf5_signals
from oatkit.hostile import hdf5_dataset, open_hdf5, printable
from oatkit.scanfile import MAX_ARRAY_BYTES, PER_PULSE, is_scan_file, read_about


class OatkitHdf5(Reader):
    """Reads the scan file that `oatkit.scanfile.write_scan` writes; signals stay in the file."""

    name: ClassVar[str] = "oatkit-hdf5"

    def can_read(self, path: Path) -> bool:
        """Claim a file that begins with the marker of a scan file."""
        return is_scan_file(path)

    def read(self, path: Path) -> Scan:
        """Return the scan. Raises `ReadError`."""
        with open_hdf5(path) as file:
            about = read_about(file, path)
            signals = hdf5_signals(file, path)
            _check_complete(file, path, about.get("arrays", []))
            arrays = {name: _array(file, name) for name in ARRAYS if file.get(name, getlink=True) is not None}
        try:
            return _scan(path, about, signals, arrays)
        except KeyError as error:
            raise ReadError(f"{path}: expected an entry {error}, found nothing") from None
        except (TypeError, ValidationError, ValueError) as error:
            raise ReadError(f"{path}: {error}") from None


ARRAYS = {"detectors_m": ("f", 2), "valid": ("u", 3), "impulse_response": ("f", 1)} | dict.fromkeys(PER_PULSE, ("f", 2))
"""Kind of type and number of axes of each array beside the signals."""


def _check_complete(file: Any, path: Path, named: Any) -> None:
    """Raise `ReadError` where a dataset is missing that the file once had; older files do not say which they had."""
    if not isinstance(named, list):
        raise ReadError(f"{path} 'about': expected a list of arrays, found {named!r:.60}")
    lost = [name for name in named if name in ARRAYS and file.get(name, getlink=True) is None]
    if lost:
        raise ReadError(f"{path}: expected the dataset '{lost[0]}', found nothing")


def _array(file: Any, name: str) -> np.ndarray:
    kind, ndim = ARRAYS[name]
    return hdf5_dataset(file, name, kind, ndim, MAX_ARRAY_BYTES)[()]


def _scan(path: Path, about: dict[str, Any], signals: Hdf5Signals, arrays: dict[str, np.ndarray]) -> Scan:
    geometry = Geometry(
        Detectors(arrays["detectors_m"]),
        about["sampling_rate_hz"],
        signals.shape[3],
        about["start_time_s"],
        about["speed_of_sound_m_s"],
        arrays.get("impulse_response"),
    )
    origin = " by ".join(filter(None, (_text(about["source"]), _text(about["reader"]))))
    return Scan(
        signals,
        geometry,
        tuple(about["wavelengths_nm"]),
        valid=arrays["valid"],
        **{name: arrays.get(name) for name in PER_PULSE},
        name=_text(about["name"]),
        source=str(path),
        reader=OatkitHdf5.name,
        speed_of_sound_source=_text(about["speed_of_sound_source"]),
        notes=_notes(about["notes"], origin),
    )


def _notes(stored: Any, origin: str) -> tuple[str, ...]:
    if not isinstance(stored, list):
        raise TypeError(f"expected a list of notes in 'about', found {stored!r:.60}")
    return (*map(_text, stored), *([f"The file was written from: {origin}."] if origin else []))


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected a text in 'about', found {value!r:.60}")
    return printable(value)
