"""Spectra by linear interpolation in the tables of this folder; beyond a table's range there is no value."""

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Literal

import numpy as np

from oatkit.errors import ValidationError

Couplant = Literal["h2o", "d2o"]
"""What the body lies in: water or heavy water."""

GRAM_PER_LITRE = 150.0
"""Haemoglobin in whole blood, [Jacques2013]_."""
GRAM_PER_MOL = 64500.0
"""Molar mass of haemoglobin, as in Prahl's compilation."""


def water_absorption_per_m(wavelengths_nm: Sequence[float] | np.ndarray, couplant: Couplant = "h2o") -> np.ndarray:
    """Return mu_a of water [Hale1973]_ or heavy water [Kedenburg2012]_, shape ``(wavelength,)``, 1/m.

    The values of heavy water between 500 and 900 nm are about 0.6 1/m, flat and noisy: an upper bound rather than a
    spectrum. Of 3 cm of it, that is an attenuation of 2 %.

    Raises `ValidationError` for a wavelength out of the table's range.
    """
    if couplant == "d2o":
        return interpolated("heavy_water_kedenburg.csv", wavelengths_nm)[0]
    return 100 * interpolated("water_hale_querry.csv", wavelengths_nm)[0]


def haemoglobin_absorption_per_m(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return mu_a of whole blood, all oxygenated and all deoxygenated, shape ``(2, wavelength)``, 1/m.

    Molar extinction compiled by S. Prahl, times ln(10) and 150 g/l over 64500 g/mol. Raises `ValidationError` for a
    wavelength out of the table's range.
    """
    molar_per_cm = interpolated("haemoglobin_prahl.csv", wavelengths_nm)
    return 100 * np.log(10) * molar_per_cm * GRAM_PER_LITRE / GRAM_PER_MOL


def lipid_absorption_per_m(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return mu_a of mammalian fat [VanVeen2005]_, shape ``(wavelength,)``, 1/m.

    Raises `ValidationError` for a wavelength out of the table's range.
    """
    return interpolated("lipid_van_veen.csv", wavelengths_nm)[0]


def interpolated(table: str, wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the columns of a table at some wavelengths, in any order, shape ``(column, wavelength)``."""
    known, *columns = _read(table)
    wanted = np.atleast_1d(np.asarray(wavelengths_nm, dtype=float))
    covered = (wanted >= known[0]) & (wanted <= known[-1])
    if not covered.all():
        raise ValidationError(
            f"wavelength {wanted[~covered][0]:g} nm: {table} covers {known[0]:g} .. {known[-1]:g} nm; the unit is nm, "
            "so 700e-9 m is 700"
        )
    return np.array([np.interp(wanted, known, column) for column in columns])


@cache
def _read(table: str) -> np.ndarray:
    """Return a table's columns, wavelength first, as a read-only array."""
    text = files("oatkit.spectra").joinpath(table).read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if not line.startswith("#")]
    columns = np.array([[float(number) for number in row.split(",")] for row in rows[1:]]).T
    columns.setflags(write=False)
    return columns
