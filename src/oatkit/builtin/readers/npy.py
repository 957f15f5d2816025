"""NumPy's ``.npy`` files, whose header is checked before anything is read or mapped."""

import ast
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np

from oatkit.builtin.readers.array_signals import Pages, check_numbers
from oatkit.errors import ReadError
from oatkit.hostile import printable, regular_file

MAGIC = b"\x93NUMPY"
SIZE_BYTES = {1: 2, 2: 4}
"""Bytes that hold the size of the header, by version. A third version is for names of fields in other alphabets."""
MAX_HEADER_BYTES = 10_000
"""As NumPy's own limit: parsing a longer text may crash the interpreter."""


def npy_pages(path: Path, axes: tuple[str, ...]) -> Pages:
    """Return where the numbers of a file lie, whose axes have these names. Raises `ReadError`."""
    offset, shape, fortran, dtype = _layout(path)
    if len(shape) != len(axes):
        raise ReadError(f"{path}: the array has {len(shape)} axes {shape}, 'axes' names {len(axes)}: {', '.join(axes)}")
    if fortran:
        shape, axes = shape[::-1], axes[::-1]
    return Pages(np.array(offset), shape, dtype, axes)


def read_npy(path: Path, limit: int) -> np.ndarray:
    """Return the array in a file of at most `limit` bytes. Raises `ReadError`."""
    offset, shape, fortran, dtype = _layout(path)
    if (declared := prod(shape) * dtype.itemsize) > limit:
        raise ReadError(f"{path}: the shape {shape} declares {declared} bytes; at most {limit} are read of such a file")
    try:
        return np.fromfile(path, dtype, offset=offset).reshape(shape, order="F" if fortran else "C")
    except (OSError, ValueError) as error:
        raise ReadError(f"{path}: cannot be read ({error})") from None


def _layout(path: Path) -> tuple[int, tuple[int, ...], bool, np.dtype]:
    """Return offset of the data, shape, whether it is in Fortran order, and type, where they fit the file."""
    size = regular_file(path).stat().st_size
    try:
        with open(path, "rb") as file:
            shape, fortran, dtype = _header(file)
            offset = file.tell()
    except (OSError, ValueError, TypeError, LookupError, RecursionError, MemoryError, SyntaxError) as error:
        raise ReadError(
            f"{path}: expected a .npy file, found a damaged header ({printable(str(error), 200)})"
        ) from None
    check_numbers(path, dtype)
    if not shape or not all(n > 0 for n in shape):
        raise ReadError(f"{path}: expected an array with one axis or more, none of them empty, found the shape {shape}")
    declared = prod(shape) * dtype.itemsize
    if offset + declared != size:
        raise ReadError(
            f"{path}: the header declares {declared} bytes (shape {shape}, {dtype}), the file holds {size - offset}"
        )
    return offset, shape, fortran, dtype


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Return shape, order and type, and leave the file at its data. Raises all that Python's parser does."""
    # NumPy's own reader tries a broken header again as one of Python 2, and fails in ways that it does not document.
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError("it does not begin as one")
    version = file.read(2)[0]
    size = int.from_bytes(file.read(SIZE_BYTES[version]), "little")
    if size > MAX_HEADER_BYTES:
        raise ValueError(f"{size} bytes; at most {MAX_HEADER_BYTES} are read")
    table: dict[str, Any] = ast.literal_eval(file.read(size).decode("latin-1").strip())
    shape, fortran = table["shape"], table["fortran_order"]
    if not (isinstance(shape, tuple) and all(type(n) is int for n in shape) and isinstance(fortran, bool)):
        raise ValueError(f"shape {shape}, Fortran order {fortran}")
    return shape, fortran, np.dtype(table["descr"])
