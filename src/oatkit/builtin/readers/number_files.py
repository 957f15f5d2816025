"""Small arrays of numbers in a file of any of the formats that a scan description may name."""

from pathlib import Path

import numpy as np

from oatkit.builtin.readers.matlab_arrays import read_mat
from oatkit.builtin.readers.npy import read_npy
from oatkit.errors import ReadError
from oatkit.hostile import read_at_most

MAX_BYTES = 16 * 2**20


def read_numbers(path: Path, dataset: str) -> np.ndarray:
    """Return the array in a ``.npy``, ``.csv`` or ``.mat`` file as float64; `dataset` names it in a ``.mat``.

    Raises `ReadError` where the file is of none of these formats, damaged, larger than 16 MiB, or holds a number that
    is not finite.
    """
    suffix = path.suffix.lower()
    if suffix == ".npy":
        values = read_npy(path, MAX_BYTES)
    elif suffix == ".csv":
        values = _read_csv(path)
    elif suffix == ".mat":
        values = read_mat(path, dataset, MAX_BYTES)
    else:
        raise ReadError(f"{path}: expected a file .npy, .csv or .mat, found '{suffix}'")
    values = np.asarray(values, dtype=float)
    if not np.isfinite(values).all():
        raise ReadError(f"{path}: expected finite numbers, found {(~np.isfinite(values)).sum()} that are not")
    return values


def _read_csv(path: Path) -> np.ndarray:
    """Return rows of numbers between commas, shape ``(row, column)``; lines that begin with # are passed over."""
    try:
        lines = read_at_most(path, MAX_BYTES).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ReadError(f"{path}: expected text, found bytes that are none") from None
    kept = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    rows = [_row(path, number, line) for number, line in kept]
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        raise ReadError(f"{path}: expected rows of one length, found lengths {sorted({len(row) for row in rows})}")
    return np.array(rows)


def _row(path: Path, number: int, line: str) -> list[float]:
    try:
        return [float(entry) for entry in line.split(",")]
    except ValueError:
        raise ReadError(
            f"{path} line {number}: expected numbers between commas, found {line[:60]!r}; "
            "a line of names is to begin with #"
        ) from None
