"""What absorbs light in tissue, and what tissues are made of."""

from oatkit.spectra.chromophores import CHROMOPHORES, Chromophore, chromophore
from oatkit.spectra.tables import (
    Couplant,
    haemoglobin_absorption_per_m,
    haemoglobin_molar_absorption,
    icg_relative_absorption,
    lipid_absorption_per_m,
    melanosome_absorption_per_m,
    water_absorption_per_m,
)
from oatkit.spectra.tissues import TISSUES, Tissue, tissue_optics

__all__ = [
    "CHROMOPHORES", "TISSUES", "Chromophore", "Couplant", "Tissue", "chromophore", "haemoglobin_absorption_per_m",
    "haemoglobin_molar_absorption", "icg_relative_absorption", "lipid_absorption_per_m", "melanosome_absorption_per_m",
    "tissue_optics", "water_absorption_per_m",
]  # fmt: skip
