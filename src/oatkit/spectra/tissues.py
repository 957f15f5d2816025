"""What tissues are made of, each with the source of its numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from oatkit.data import Optics
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.spectra.tables import haemoglobin_absorption_per_m, lipid_absorption_per_m, water_absorption_per_m


@dataclass(frozen=True)
class Tissue:
    r"""A tissue by its chromophores and its scattering.

    .. math::
        \mu_a = B (S \mu_{HbO_2} + (1 - S) \mu_{Hb}) + W \mu_{water} + F \mu_{fat}, \qquad
        \mu_s' = a (\lambda / 500 nm)^{-b}
    """

    blood_volume: float
    """B: share of the volume that is blood."""
    oxygen_saturation: float
    """S: share of the haemoglobin that is oxygenated."""
    water: float
    """W: share of the volume."""
    fat: float
    """F: share of the volume."""
    scattering_per_m: float
    """a: mu_s' at 500 nm, 1/m."""
    scattering_power: float
    """b, a pure number."""
    source: str
    """Where the numbers come from."""

    def optics(self, wavelengths_nm: Sequence[float]) -> Optics:
        """Return mu_a and mu_s', shape ``(wavelength,)``. Raises `ValidationError` beyond the range of the spectra."""
        saturation = np.array([self.oxygen_saturation, 1 - self.oxygen_saturation])
        absorption = self.blood_volume * (saturation @ haemoglobin_absorption_per_m(wavelengths_nm))
        absorption += self.water * water_absorption_per_m(wavelengths_nm)
        absorption += self.fat * lipid_absorption_per_m(wavelengths_nm)
        ratio = np.asarray(wavelengths_nm, dtype=float) / 500
        scattering = self.scattering_per_m * ratio**-self.scattering_power
        return Optics(tuple(wavelengths_nm), absorption, scattering)


JACQUES = "S. L. Jacques, Phys. Med. Biol. 58, R37 (2013), 10.1088/0031-9155/58/11/R37"
ALEXANDRAKIS = "mouse; G. Alexandrakis et al., Phys. Med. Biol. 50, 4225 (2005), 10.1088/0031-9155/50/17/021, table 1"


def _of_mouse(blood_volume: float, oxygen_saturation: float, water: float, factor: float, power: float) -> Tissue:
    """Return a tissue of [Alexandrakis2005]_, whose mu_s' is factor * (wavelength in nm)^-power in 1/mm."""
    return Tissue(blood_volume, oxygen_saturation, water, 0.0, 1e3 * factor * 500**-power, power, ALEXANDRAKIS)


# Blood, its oxygen saturation, water, fat; a in 1/m, b; source.
TISSUES: Mapping[str, Tissue] = MappingProxyType(
    {
        "soft-tissue": Tissue(
            0.0361, 0.69, 0.5, 0.0, 1890, 1.286,
            f"human; {JACQUES}: table 2, other soft tissues; table 3, calf (Matcher 1997); water as in mouse muscle",
        ),
        "breast": Tissue(
            0.0102, 0.676, 0.144, 0.656, 1680, 1.055, f"human; {JACQUES}: tables 2 and 3 (Tromberg 1997)"
        ),
        "brain": Tissue(
            0.0305, 0.59, 0.837, 0.0, 2420, 1.611,
            f"rat cortex; {JACQUES}: tables 2 and 3 (O'Sullivan 2012); water of human grey matter, Front. Neurol. 10, "
            "1333 (2019)",
        ),
        "dermis": Tissue(
            0.002, 0.39, 0.65, 0.0, 4600, 1.421, f"human, without melanin; {JACQUES}: tables 2 and 3 (Choudhury 2010)"
        ),
        "fat": Tissue(
            0.0054, 0.76, 0.11, 0.69, 1840, 0.672, f"human abdomen; {JACQUES}: tables 2 and 3 (Jakubowski 2004)"
        ),
        "adipose": _of_mouse(0.0033, 0.7, 0.5, 38, 0.53),
        "bone": _of_mouse(0.049, 0.8, 0.15, 35600, 1.47),
        "bowel": _of_mouse(0.0093, 0.8, 0.5, 3670, 1.24),
        "heart": _of_mouse(0.05, 0.75, 0.5, 10600, 1.43),
        "kidney": _of_mouse(0.056, 0.75, 0.8, 41700, 1.51),
        "liver": _of_mouse(0.3, 0.75, 0.7, 629, 1.05),
        "lung": _of_mouse(0.15, 0.85, 0.85, 68.4, 0.53),
        "muscle": _of_mouse(0.07, 0.8, 0.5, 4e7, 2.82),
        "skin": _of_mouse(0.06, 0.75, 0.5, 2850, 1.1),
        "stomach": _of_mouse(0.01, 0.7, 0.8, 792, 0.97),
    }
)  # fmt: skip
"""The presets by name. What a source does not give is 0: of the mouse, fat; of all, melanin."""


def tissue_optics(tissue: str, wavelengths_nm: Sequence[float]) -> Optics:
    """Return mu_a and mu_s' of a preset, shape ``(wavelength,)``.

    Raises `ValidationError` for an unknown name or a wavelength out of the range of the spectra.
    """
    if tissue not in TISSUES:
        raise ValidationError(f"no tissue named '{tissue}'{did_you_mean(tissue, TISSUES)}")
    return TISSUES[tissue].optics(wavelengths_nm)
