"""Signals in a file of plain numbers, in any order of axes, read as they are asked for."""

from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.fingerprint import sampled_fingerprint
from oatkit.builtin.readers.indexing import expanded
from oatkit.content import read_only
from oatkit.errors import ReadError
from oatkit.hostile import regular_file

AXES = ("frame", "wavelength", "detector", "sample")


@dataclass(frozen=True)
class Pages:
    """Where the numbers of a file lie: blocks of one shape in C order, the pages, at offsets of any kind."""

    offsets: np.ndarray
    """First byte of each page; its own shape is that of the axes which count the pages."""
    shape: tuple[int, ...]
    """Shape of a page."""
    dtype: np.dtype
    axes: tuple[str, ...]
    """Names of all axes, those that count the pages first."""

    @property
    def lengths(self) -> dict[str, int]:
        """Length of each axis by its name; an axis that the file lacks has length one."""
        return dict.fromkeys(AXES, 1) | dict(zip(self.axes, (*self.offsets.shape, *self.shape), strict=True))

    @property
    def bytes_per_page(self) -> int:
        """Size of a page."""
        return prod(self.shape) * self.dtype.itemsize

    @property
    def identity(self) -> bytes:
        """What tells this layout from others of the same bytes."""
        return f"{self.axes} {self.shape} {self.dtype.str} {self.offsets.shape} ".encode() + self.offsets.tobytes()


@dataclass(frozen=True)
class ArraySignals:
    """Signals that are never opened for writing, of shape ``(frame, wavelength, detector, sample)``.

    Indexed by whole numbers, slices and ``...`` as such an array; only what is asked for is read. Equal where the
    fingerprints are. Pickles as its path and layout. Raises `ReadError` where the file has changed since it was made.
    """

    path: Path = field(compare=False)
    pages: Pages = field(compare=False)
    fingerprint: str

    @property
    def shape(self) -> tuple[int, ...]:
        """``(frame, wavelength, detector, sample)``."""
        return tuple(self.pages.lengths[axis] for axis in AXES)

    @property
    def dtype(self) -> np.dtype:
        """As in the file, its byte order included."""
        return self.pages.dtype

    def __getitem__(self, index: Any) -> np.ndarray:
        entries = dict(zip(AXES, expanded(index), strict=True))
        in_file = tuple(entries[axis] for axis in self.pages.axes)
        n_counting = self.pages.offsets.ndim
        offsets, inside = np.asarray(self.pages.offsets[in_file[:n_counting]]), in_file[n_counting:]
        page = np.broadcast_to(np.empty((), self.dtype), self.pages.shape)[inside].shape
        picked = np.empty((offsets.size, *page), self.dtype)
        content = self._content()
        for target, offset in enumerate(offsets.flat):
            picked[target] = np.ndarray(self.pages.shape, self.dtype, content, int(offset))[inside]
        kept = [axis for axis in self.pages.axes if isinstance(entries[axis], slice)]
        order = [kept.index(axis) for axis in AXES if axis in kept]
        return np.asarray(picked.reshape((*offsets.shape, *page)).transpose(order), order="C")

    def _content(self) -> np.ndarray:
        """Return the bytes of the file as a read-only memory map."""
        # A file that has become shorter would end the process with a bus error.
        try:
            if sampled_fingerprint(self.path, self.pages.identity) != self.fingerprint:
                raise ReadError(f"{self.path}: the file has changed since the scan was read; read it again")
            return np.memmap(self.path, np.uint8, mode="r")
        except OSError as error:
            raise ReadError(f"{self.path}: cannot be read ({error.strerror})") from None


def array_signals(path: Path, pages: Pages) -> ArraySignals:
    """Return the signals of a file whose pages all lie in it. Raises `ReadError` where one does not."""
    size = regular_file(path).stat().st_size
    end = int(pages.offsets.max()) + pages.bytes_per_page
    if end > size or int(pages.offsets.min()) < 0:
        raise ReadError(f"{path}: expected at least {end} bytes, found {size}; the file is cut or damaged")
    missing = tuple(axis for axis in AXES if axis not in pages.axes)
    whole = Pages(
        read_only(pages.offsets.reshape((1,) * len(missing) + pages.offsets.shape)),
        pages.shape,
        pages.dtype,
        (*missing, *pages.axes),
    )
    try:
        return ArraySignals(path, whole, sampled_fingerprint(path, whole.identity))
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror})") from None


def check_numbers(where: Path, dtype: np.dtype) -> None:
    """Raise `ReadError` unless a type is one of real numbers that every machine has."""
    if dtype.kind not in "iuf" or dtype.itemsize > 8:
        raise ReadError(f"{where}: expected real numbers of at most 8 bytes, found {dtype}")
