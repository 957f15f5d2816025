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
MELANIN_RANGE_NM = (300.0, 1100.0)
"""Where the power law for melanosomes is taken to hold."""


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
    mol_per_m3 = 1000 * GRAM_PER_LITRE / GRAM_PER_MOL
    return mol_per_m3 * haemoglobin_molar_absorption(wavelengths_nm)


def haemoglobin_molar_absorption(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return mu_a of 1 mol/m^3 of oxygenated and of deoxygenated haemoglobin, shape ``(2, wavelength)``, 1/m.

    It is molar extinction compiled by S. Prahl, in 1/(cm M), times ln(10) * 100 / 1000. Raises `ValidationError` for a
    wavelength out of the table's range.
    """
    return np.log(10) / 10 * interpolated("haemoglobin_prahl.csv", wavelengths_nm)


def lipid_absorption_per_m(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return mu_a of mammalian fat [VanVeen2005]_, shape ``(wavelength,)``, 1/m.

    Raises `ValidationError` for a wavelength out of the table's range.
    """
    return interpolated("lipid_van_veen.csv", wavelengths_nm)[0]


def melanosome_absorption_per_m(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return mu_a of the interior of a melanosome, 1.7e12 * (nm)^-3.48 1/cm [Jacques2013]_, in 1/m.

    Raises `ValidationError` for a wavelength outside 300 .. 1100 nm, about which the formula says nothing.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, dtype=float))
    _check_covered(wavelengths, *MELANIN_RANGE_NM, "the formula for melanin")
    return 100 * 1.7e12 * wavelengths**-3.48


def icg_relative_absorption(wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the absorption of indocyanine green relative to its largest, at 810 nm, shape ``(wavelength,)``.

    Raises `ValidationError` for a wavelength out of the table's range.
    """
    return interpolated("icg.csv", wavelengths_nm)[0] / _read("icg.csv")[1].max()


def interpolated(table: str, wavelengths_nm: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the columns of a table at some wavelengths, in any order, shape ``(column, wavelength)``."""
    known, *columns = _read(table)
    wanted = np.atleast_1d(np.asarray(wavelengths_nm, dtype=float))
    _check_covered(wanted, known[0], known[-1], table)
    return np.array([np.interp(wanted, known, column) for column in columns])


def _check_covered(wavelengths_nm: np.ndarray, lowest: float, highest: float, table: str) -> None:
    covered = (wavelengths_nm >= lowest) & (wavelengths_nm <= highest)
    if not covered.all():
        raise ValidationError(
            f"wavelength {wavelengths_nm[~covered][0]:g} nm: {table} covers {lowest:g} .. {highest:g} nm; the unit is "
            "nm, so 700e-9 m is 700"
        )


@cache
def _read(table: str) -> np.ndarray:
    """Return a table's columns, wavelength first, as a read-only array."""
    text = files("oatkit.spectra").joinpath(table).read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if not line.startswith("#")]
    columns = np.array([[float(number) for number in row.split(",")] for row in rows[1:]]).T
    columns.setflags(write=False)
    return columns
