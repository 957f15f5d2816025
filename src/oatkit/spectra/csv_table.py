"""Tables of numbers that users write: CSV with a line of column names."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import printable, read_at_most

LARGEST_TABLE = 10_000_000
"""Bytes."""
WAVELENGTH = "wavelength_nm"
"""The column that every table of spectra has."""


def columns_of(path: Path) -> tuple[str, ...]:
    """Return the names of the columns of a CSV file. Raises `ReadError` for a file that is no such table."""
    return tuple(printable(name, 100) for name in _reader(path).fieldnames or ())


def spectra_at(path: Path, columns: Sequence[str], wavelengths_nm: Sequence[float]) -> np.ndarray:
    """Return `columns` of a CSV file, linearly interpolated at some wavelengths: shape ``(column, wavelength)``.

    The first line names the columns, `WAVELENGTH` among them, in any order and beside others; lines that begin with
    ``#`` are comments. Raises `ReadError` for a file that is no such table, `ValidationError` for a wavelength outside
    it: there is no extrapolation.
    """
    rows = _rows(path, (WAVELENGTH, *columns))
    known, *spectra = rows[np.argsort(rows[:, 0])].T
    for wavelength in wavelengths_nm:
        if not known[0] <= wavelength <= known[-1]:
            raise ValidationError(
                f"{path}: {wavelength:g} nm is outside the table, which covers {known[0]:g} .. {known[-1]:g} nm"
            )
    return np.array([np.interp(wavelengths_nm, known, values) for values in spectra])


def _reader(path: Path) -> csv.DictReader:
    try:
        text = read_at_most(path, LARGEST_TABLE).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ReadError(f"{path}: expected a CSV file, found bytes that are no text") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    reader = csv.DictReader(lines, skipinitialspace=True)
    try:
        reader.fieldnames  # noqa: B018  reads the first line
    except csv.Error as error:
        raise ReadError(f"{path}: expected a CSV file, found a broken first line ({error})") from None
    return reader


def _rows(path: Path, names: Sequence[str]) -> np.ndarray:
    """Return the columns asked for, shape ``(row, column)``, checked."""
    reader = _reader(path)
    listed = ", ".join(names)
    missing = [name for name in names if name not in (reader.fieldnames or ())]
    if missing:
        raise ReadError(f"{path}: expected the columns {listed}; missing: {', '.join(missing)}")
    try:
        rows = np.array([[float(row[name]) for name in names] for row in reader])
    except (TypeError, ValueError, csv.Error):
        raise ReadError(f"{path}: expected a number in each of the columns {listed}") from None
    if len(rows) == 0 or not (np.isfinite(rows).all() and (rows >= 0).all()):
        raise ReadError(f"{path}: expected one or more rows of finite numbers, none of them negative")
    if len(np.unique(rows[:, 0])) < len(rows):
        raise ReadError(f"{path}: a wavelength stands in more than one row")
    return rows
