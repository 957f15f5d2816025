"""Absorption of water, blood and fat, and what tissues are made of."""

from oatkit.spectra.tables import (
    Couplant,
    haemoglobin_absorption_per_m,
    lipid_absorption_per_m,
    water_absorption_per_m,
)
from oatkit.spectra.tissues import TISSUES, Tissue, tissue_optics

__all__ = [
    "TISSUES", "Couplant", "Tissue", "haemoglobin_absorption_per_m", "lipid_absorption_per_m", "tissue_optics",
    "water_absorption_per_m",
]  # fmt: skip
