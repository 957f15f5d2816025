"""Optical properties of tissue from a user's table."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from oatkit.data import Optics
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import read_at_most

COLUMNS = ("wavelength_nm", "absorption_per_cm", "reduced_scattering_per_cm")
LARGEST_TABLE = 10_000_000
"""Bytes."""


def read_optics(path: Path, wavelengths_nm: Sequence[float]) -> Optics:
    """Return mu_a and mu_s' at `wavelengths_nm`, linearly interpolated between the rows of a CSV file.

    Its first line names the columns, `COLUMNS` in any order among others; lines that begin with ``#`` are comments.
    Raises `ReadError` for a file that is no such table, `ValidationError` for a wavelength outside it.
    """
    table = _rows(path)
    known, *properties = table[np.argsort(table[:, 0])].T
    for wavelength in wavelengths_nm:
        if not known[0] <= wavelength <= known[-1]:
            raise ValidationError(
                f"{path}: {wavelength:g} nm is outside the table, which covers {known[0]:g} .. {known[-1]:g} nm"
            )
    absorption, scattering = (100 * np.interp(wavelengths_nm, known, values) for values in properties)
    return Optics(tuple(wavelengths_nm), absorption, scattering)


def _rows(path: Path) -> np.ndarray:
    """Return the three columns, shape ``(row, 3)``, checked."""
    try:
        text = read_at_most(path, LARGEST_TABLE).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ReadError(f"{path}: expected a CSV file, found bytes that are no text") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    reader = csv.DictReader(lines, skipinitialspace=True)
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise ReadError(f"{path}: expected the columns {', '.join(COLUMNS)}; missing: {', '.join(missing)}")
    try:
        rows = np.array([[float(row[name]) for name in COLUMNS] for row in reader])
    except (TypeError, ValueError):
        raise ReadError(f"{path}: expected a number in each of the columns {', '.join(COLUMNS)}") from None
    if len(rows) == 0 or not (np.isfinite(rows).all() and (rows >= 0).all()):
        raise ReadError(f"{path}: expected one or more rows of finite numbers, none of them negative")
    if len(np.unique(rows[:, 0])) < len(rows):
        raise ReadError(f"{path}: a wavelength stands in more than one row")
    return rows
