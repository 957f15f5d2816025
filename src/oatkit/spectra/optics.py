"""Optical properties of tissue from a user's table."""

from collections.abc import Sequence
from pathlib import Path

from oatkit.data import Optics
from oatkit.spectra.csv_table import spectra_at

COLUMNS = ("absorption_per_cm", "reduced_scattering_per_cm")


def read_optics(path: Path, wavelengths_nm: Sequence[float]) -> Optics:
    """Return mu_a and mu_s' at `wavelengths_nm` from a CSV file with the columns ``wavelength_nm`` and `COLUMNS`.

    Raises as `oatkit.spectra.csv_table.spectra_at` does.
    """
    absorption, scattering = 100 * spectra_at(path, COLUMNS, wavelengths_nm)
    return Optics(tuple(wavelengths_nm), absorption, scattering)
