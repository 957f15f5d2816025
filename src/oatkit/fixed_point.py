"""Absorption and light that belong together: what the body absorbs dims the light by which it is seen."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.absorption import absorption
from oatkit.api import FluenceModel
from oatkit.data import Image, Optics
from oatkit.plausible import implausible, of_body
from oatkit.tables import AbsorptionTable

SETTLED = 0.01
"""Relative change of the absorption in the last pass that is worth no note."""


def fixed_point(
    table: AbsorptionTable, model: FluenceModel, optics: Optics, pressure: Image, fluence: Image, boundary: Image
) -> tuple[Image, Image]:
    """Return absorption and fluence after ``table.passes`` passes, each with the light that the absorption leaves.

    The first pass takes the `fluence` of the body of `optics`; each further one that of the absorption found before it,
    at the given mu_s' [Cox2006]_. Without a calibration its scale is set, in the light only, by the mean mu_a of
    `optics`; the absorption itself stays in arbitrary units. In the light, absorption is kept between 0 and mu_s',
    where the diffusion of light ends. A calibration that is wrong by a fifth can change the absorption of deep pixels
    by a factor of five: ``diagnostics["change"]`` holds the relative change of each pass by wavelength, and notes say
    where the last one was large, where the limit was reached, and where the mean is far from the one stated.

    References:
        [Cox2006] Cox, Arridge, Koestli and Beard, Appl. Opt. 45, 1866 (2006), 10.1364/AO.45.001866.
    """
    inside = boundary.values[0] < 0
    found, changes = absorption(table, pressure, fluence, boundary), []
    for _ in range(table.passes - 1):
        before = found
        fluence = model.fluence(boundary, _seen(found, optics, inside))
        found = absorption(table, pressure, fluence, boundary)
        changes.append(tuple(_change(a[inside], b[inside]) for a, b in zip(before.values, found.values, strict=True)))
    notes = (*found.diagnostics["notes"], *_unsettled(changes), *_suspicious(found, optics, inside))
    told = {**found.diagnostics, "passes": table.passes, "change": tuple(changes), "notes": notes}
    return replace(found, diagnostics=told), fluence


def _seen(found: Image, optics: Optics, inside: np.ndarray) -> Optics:
    """Return optics with the absorption found, 1/m; outside of the body, where none is defined, its mean."""
    planes = []
    for index, plane in enumerate(found.values):
        mean = float(np.mean(of_body(optics.absorption_per_m[index], inside)))
        limit = optics.reduced_scattering_per_m[index]
        mu_a = np.clip(np.where(inside, plane, 0).astype(float), 0, None)
        if found.unit == "a.u.":
            total = mu_a[inside].mean()
            mu_a = mu_a * (mean / total if total > 0 else 0.0)
        planes.append(np.minimum(np.where(inside, mu_a, mean), limit))
    return Optics(optics.wavelengths_nm, np.stack(planes), optics.reduced_scattering_per_m)


def _change(before: np.ndarray, after: np.ndarray) -> float:
    size = float(np.linalg.norm(after))
    return float(np.linalg.norm(after - before)) / size if size > 0 else 0.0


def _suspicious(found: Image, optics: Optics, inside: np.ndarray) -> Iterator[str]:
    return iter(()) if found.unit == "a.u." else implausible(found.values, optics, inside)


def _unsettled(changes: list[tuple[float, ...]]) -> Iterator[str]:
    if changes and not max(changes[-1]) <= SETTLED:
        yield (
            f"the last of the passes between absorption and light changed the absorption by {max(changes[-1]):.1%}; "
            "raise absorption.passes, and doubt the calibration if that does not settle it"
        )
