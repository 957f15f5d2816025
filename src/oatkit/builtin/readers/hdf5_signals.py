"""Signals in an HDF5 file, read as they are asked for."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.fingerprint import sampled_fingerprint
from oatkit.builtin.readers.indexing import expanded
from oatkit.errors import ReadError
from oatkit.hostile import hdf5_dataset, open_hdf5

Axes = tuple[int | None, int | None, int | None, int | None]
"""Which axis of a dataset holds frame, wavelength, detector and sample; None where it has no such axis."""


@dataclass(frozen=True)
class Hdf5Signals:
    """A dataset of a file, opened anew for every access; equal where the fingerprints are.

    Indexed by whole numbers, slices and ``...`` as an array of shape ``(frame, wavelength, detector, sample)``, in
    whatever order the file holds the axes; only what is asked for is read. Pickles as its path and layout. Raises
    `ReadError` where the file has changed since it was made, or where a checksum shows that it is damaged.
    """

    path: Path = field(compare=False)
    shape: tuple[int, ...] = field(compare=False)
    """``(frame, wavelength, detector, sample)``."""
    dtype: np.dtype = field(compare=False)
    fingerprint: str
    name: str = field(compare=False)
    """The dataset."""
    axes: Axes = field(compare=False)

    def __getitem__(self, index: Any) -> np.ndarray:
        entries = expanded(index)
        spans = [_span(entry, length) for entry, length in zip(entries, self.shape, strict=True)]
        with open_hdf5(self.path) as file:
            if sampled_fingerprint(self.path) != self.fingerprint:
                raise ReadError(f"{self.path}: the file has changed since the scan was read; read it again")
            values = self._read(_dataset(file, self.name, self.axes), spans)
        return values[tuple(slice(None) if isinstance(entry, slice) else 0 for entry in entries)]

    def _read(self, dataset: Any, spans: list[slice]) -> np.ndarray:
        """Return part of the dataset with the four axes of signals, contiguous."""
        held = {stored: axis for axis, stored in enumerate(self.axes) if stored is not None}
        values = dataset[tuple(spans[held[stored]] for stored in sorted(held))]
        values = values.transpose([stored for stored in self.axes if stored is not None])
        values = values[tuple(None if stored is None else slice(None) for stored in self.axes)]
        absent = (one if stored is None else slice(None) for one, stored in zip(spans, self.axes, strict=True))
        return np.ascontiguousarray(values[tuple(absent)])


def hdf5_signals(file: Any, path: Path, name: str = "signals", axes: Axes = (0, 1, 2, 3)) -> Hdf5Signals:
    """Return the signals of an open file. Raises `ReadError` where they cannot be read safely."""
    dataset = _dataset(file, name, axes)
    shape = tuple(1 if stored is None else dataset.shape[stored] for stored in axes)
    return Hdf5Signals(path, shape, dataset.dtype, sampled_fingerprint(path), name, axes)


def _dataset(file: Any, name: str, axes: Axes) -> Any:
    return hdf5_dataset(file, name, "iuf", sum(stored is not None for stored in axes))


def _span(entry: Any, length: int) -> slice:
    """Return an entry of an index as a slice of an axis: a whole number as one of length one."""
    if isinstance(entry, slice):
        start, stop, step = entry.indices(length)
        if step < 0:
            raise IndexError("signals of a file are not read backwards")
        return slice(start, max(start, stop), step)
    if not -length <= entry < length:
        raise IndexError(f"index {entry} is out of range for an axis of length {length}")
    return slice(entry % length, entry % length + 1, 1)
