"""The raw signals of an iThera scan, read as they are asked for."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.fingerprint import sampled_fingerprint
from oatkit.builtin.readers.indexing import expanded
from oatkit.content import read_only
from oatkit.errors import ReadError
from oatkit.hostile import regular_file

SAMPLE = np.dtype("<u2")


@dataclass(frozen=True)
class RawSignals:
    """Records of uint16 in a file without a header, never opened for writing; equal where the fingerprints are.

    Indexed by whole numbers, slices and ``...`` as an array of shape ``(frame, wavelength, detector, sample)``; only
    the records of the pulses asked for are read. Pickles as its path and layout. Raises `ReadError` where the file has
    changed since it was made.
    """

    path: Path = field(compare=False)
    offsets: np.ndarray = field(compare=False)
    """Index of each pulse's record, shape ``(frame, wavelength)``."""
    record: tuple[int, int] = field(compare=False)
    """Shape of a record, ``(detector, sample)``."""
    inverted: bool = field(compare=False)
    """Whether signals are returned as 65535 minus what the file holds."""
    salt: bytes = field(compare=False)
    """What else belongs to the identity of the signals: a digest of the header, and the polarity."""
    fingerprint: str

    @property
    def shape(self) -> tuple[int, ...]:
        """``(frame, wavelength, detector, sample)``."""
        return (*self.offsets.shape, *self.record)

    @property
    def dtype(self) -> np.dtype:
        """Little-endian uint16, as in the file."""
        return SAMPLE

    def __getitem__(self, index: Any) -> np.ndarray:
        frame, wavelength, *rest = expanded(index)
        wanted = np.asarray(self.offsets[frame, wavelength])
        picked = self._records()[wanted][(*(slice(None),) * wanted.ndim, *rest)]
        return np.array(~picked if self.inverted else picked)

    def _records(self) -> np.ndarray:
        """Return all records of the file as a read-only memory map, shape ``(record, detector, sample)``."""
        # A file that has become shorter would end the process with a bus error.
        try:
            if sampled_fingerprint(self.path, self.salt) != self.fingerprint:
                raise ReadError(f"{self.path}: the file has changed since its header was read; read the scan again")
            count = self.path.stat().st_size // (SAMPLE.itemsize * self.record[0] * self.record[1])
            return np.memmap(self.path, SAMPLE, mode="r", shape=(count, *self.record))
        except OSError as error:
            raise ReadError(f"{self.path}: cannot be read ({error.strerror})") from None


def odd_size(path: Path, record: tuple[int, int]) -> str:
    """Say where a file does not end with a record: a header of another scan, a detector or a sample too few in it."""
    size, whole = path.stat().st_size, record[0] * record[1] * SAMPLE.itemsize
    return f"{path.name} holds {size / whole:.6g} records by the header, no whole number." if size % whole else ""


def raw_signals(path: Path, offsets: np.ndarray, record: tuple[int, int], inverted: bool, header: str) -> RawSignals:
    """Return the signals of a file that is long enough for them. Raises `ReadError` where it is missing or too short.

    `header` is a digest of what describes the signals.
    """
    found = regular_file(path).stat().st_size
    expected = (int(offsets.max()) + 1) * record[0] * record[1] * SAMPLE.itemsize
    if found < expected:
        raise ReadError(
            f"{path}: expected at least {expected} bytes ({int(offsets.max()) + 1} records of {record[0]} detectors "
            f"x {record[1]} samples of 2 bytes), found {found}"
        )
    salt = f"{header} {inverted} ".encode()
    try:
        return RawSignals(path, read_only(offsets), record, inverted, salt, sampled_fingerprint(path, salt))
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror})") from None
