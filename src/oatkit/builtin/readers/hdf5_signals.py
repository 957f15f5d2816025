"""The signals of a scan file, read as they are asked for."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.fingerprint import sampled_fingerprint
from oatkit.errors import ReadError
from oatkit.hostile import hdf5_dataset, open_hdf5


@dataclass(frozen=True)
class Hdf5Signals:
    """The dataset ``/signals`` of a file, opened anew for every access; equal where the fingerprints are.

    Indexed as h5py indexes. Pickles as its path and layout. Raises `ReadError` where the file has changed since it was
    made, or where a checksum shows that it is damaged.
    """

    path: Path = field(compare=False)
    shape: tuple[int, ...] = field(compare=False)
    """``(frame, wavelength, detector, sample)``."""
    dtype: np.dtype = field(compare=False)
    fingerprint: str

    def __getitem__(self, index: Any) -> np.ndarray:
        with open_hdf5(self.path) as file:
            if sampled_fingerprint(self.path) != self.fingerprint:
                raise ReadError(f"{self.path}: the file has changed since the scan was read; read it again")
            return np.asarray(_dataset(file)[index])


def hdf5_signals(file: Any, path: Path) -> Hdf5Signals:
    """Return the signals of an open scan file. Raises `ReadError` where they cannot be read safely."""
    signals = _dataset(file)
    return Hdf5Signals(path, signals.shape, signals.dtype, sampled_fingerprint(path))


def _dataset(file: Any) -> Any:
    return hdf5_dataset(file, "signals", "iuf", 4)
