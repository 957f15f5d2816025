"""Absorption fed back into the light: each wavelength by itself, without a word on what absorbs."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.api import FluenceModel
from oatkit.data import Image, Optics
from oatkit.light import CoarseLight, Passes, Settled, implausible
from oatkit.quantification.absorption import absorption
from oatkit.tables import AbsorptionTable

UNSETTLED = 0.01
"""Relative change of the absorption in the last pass that is worth a note."""


def fixed_point(
    table: AbsorptionTable, model: FluenceModel, optics: Optics, pressure: Image, fluence: Image, boundary: Image
) -> tuple[Image, Image]:
    """Return absorption and fluence after at most ``table.passes`` passes, fewer where nothing changes any more.

    The first pass takes the `fluence` of the body of `optics`; each further one that of the absorption found before
    it, at the given mu_s' [Cox2006]_, see `oatkit.light.Passes`. Without a calibration one number for all wavelengths
    is set, in the light only, by the mean mu_a of `optics`; the absorption itself stays in arbitrary units. In the
    light, absorption is kept between 0 and mu_s', where the diffusion of light ends. A calibration that is wrong by a
    fifth can change the absorption of deep pixels by a factor of five: ``diagnostics["change"]`` holds the relative
    change of each pass by wavelength, and notes say where the last one was large, where the limit was reached, and
    where the mean is far from the one stated.

    References:
        [Cox2006] Cox, Arridge, Koestli and Beard, Appl. Opt. 45, 1866 (2006), 10.1364/AO.45.001866.
    """
    settled = _passes(table, model, optics, pressure, fluence, boundary).settle(table.passes, 0.0)
    light = replace(fluence, values=settled.state.light)
    found = absorption(table, pressure, light, boundary)
    notes = (*found.diagnostics["notes"], *_unsettled(settled), *_suspicious(found, optics, boundary))
    told = {**found.diagnostics, "passes": settled.passes, "change": settled.changes, "notes": notes}
    return replace(found, diagnostics=told), light


def _passes(
    table: AbsorptionTable, model: FluenceModel, optics: Optics, pressure: Image, fluence: Image, boundary: Image
) -> Passes:
    """Return passes in which each wavelength is its own chromophore."""
    light = CoarseLight(model, boundary, optics, fluence.values.astype(float), factor=1)
    calibration = None if table.calibration is None else table.calibration * table.grueneisen
    one_each = np.eye(len(pressure.values))
    return Passes(pressure.values.astype(float), light, lambda mu_a: mu_a, one_each, calibration, table.floor)


def _suspicious(found: Image, optics: Optics, boundary: Image) -> Iterator[str]:
    return iter(()) if found.unit == "a.u." else implausible(found.values, optics, boundary.values[0] < 0)


def _unsettled(settled: Settled) -> Iterator[str]:
    if settled.largest and not settled.largest[-1] <= UNSETTLED:
        yield (
            f"the last of the passes between absorption and light changed the absorption by {settled.largest[-1]:.1%}; "
            "raise absorption.passes, and doubt the calibration if that does not settle it"
        )
