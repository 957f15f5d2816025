"""What absorbs light in tissue, each with its spectrum for one unit of concentration."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.spectra.csv_table import WAVELENGTH, columns_of, spectra_at
from oatkit.spectra.tables import (
    haemoglobin_molar_absorption,
    icg_relative_absorption,
    lipid_absorption_per_m,
    melanosome_absorption_per_m,
    water_absorption_per_m,
)

Spectrum = Callable[[Sequence[float]], np.ndarray]


@dataclass(frozen=True)
class Chromophore:
    """An absorber: mu_a, 1/m, is its concentration times its spectrum."""

    name: str
    unit: str
    """Of the concentration; "" for a share of the volume."""
    spectrum: Spectrum
    """mu_a of one unit of concentration at some wavelengths (nm), shape ``(wavelength,)``."""
    source: str
    """Where the numbers come from."""


PRAHL = "S. Prahl, Oregon Medical Laser Center, from W. B. Gratzer and N. Kollias, omlc.org/spectra/hemoglobin"
HALE = "G. M. Hale, M. R. Querry, Appl. Opt. 12, 555 (1973), 10.1364/AO.12.000555"
VAN_VEEN = "R. L. P. van Veen et al., J. Biomed. Opt. 10, 054004 (2005), 10.1117/1.2085149"
JACQUES = "interior of a melanosome; S. L. Jacques, Phys. Med. Biol. 58, R37 (2013), 10.1088/0031-9155/58/11/R37"
PATATO = "PATATO's table, whose unit is not stated, scaled to 1 at its maximum (810 nm)"

_KNOWN = (
    Chromophore("oxyhaemoglobin", "mol/m^3", lambda w: haemoglobin_molar_absorption(w)[0], PRAHL),
    Chromophore("deoxyhaemoglobin", "mol/m^3", lambda w: haemoglobin_molar_absorption(w)[1], PRAHL),
    Chromophore("water", "", water_absorption_per_m, HALE),
    Chromophore("lipid", "", lipid_absorption_per_m, VAN_VEEN),
    Chromophore("melanin", "", melanosome_absorption_per_m, JACQUES),
    Chromophore("icg", "1/m", icg_relative_absorption, PATATO),
)
CHROMOPHORES: Mapping[str, Chromophore] = MappingProxyType({one.name: one for one in _KNOWN})
"""By name. Haemoglobin counts whole molecules of four haem groups; ICG is measured by its absorption at its maximum."""


def chromophore(name: str, tables: Sequence[Path] = ()) -> Chromophore:
    """Return a chromophore by its name: a column of one of the user's CSV tables, else one of `CHROMOPHORES`.

    A table has a column ``wavelength_nm`` and one column for each chromophore: mu_a, 1/m, at concentration 1 of
    whatever unit its author counts in. Raises `ReadError` for a file that is no such table, and `ValidationError` for a
    name that is nowhere or stands in two tables.
    """
    owners = [path for path in tables if name != WAVELENGTH and name in columns_of(path)]
    if len(owners) > 1:
        raise ValidationError(f"chromophore '{name}': both {owners[0]} and {owners[1]} have a column of this name")
    if owners:
        return Chromophore(name, "a.u.", lambda w: spectra_at(owners[0], [name], w)[0], str(owners[0]))
    if name not in CHROMOPHORES:
        known = [*CHROMOPHORES, *(column for path in tables for column in columns_of(path) if column != WAVELENGTH)]
        hint = did_you_mean(name, known)
        raise ValidationError(f"no chromophore named '{name}'{hint} (known: {', '.join(known)})")
    return CHROMOPHORES[name]
