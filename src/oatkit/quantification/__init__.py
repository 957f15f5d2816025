"""The steps after the reconstruction: from initial pressure to boundary, fluence, absorption and chromophores."""

from oatkit.quantification.steps import STEPS, following, quantify, unmix_problem

__all__ = ["STEPS", "following", "quantify", "unmix_problem"]
