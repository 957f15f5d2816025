"""What an unmixer promises: what was mixed comes apart again, each pixel by itself."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from oatkit.api import FluenceModel, Grid, Image, Optics, Unmixer, UnmixProblem
from oatkit.spectra import CHROMOPHORES, chromophore
from oatkit.testing.problems import boundary_of, random
from oatkit.testing.running import difference

WAVELENGTHS_NM = (700.0, 730.0, 760.0, 780.0, 800.0, 850.0, 875.0, 900.0)
GRID = Grid((9, 8), 2e-4)
CALIBRATION = 3.0
"""K: the pressure that 1/m of absorption gives at fluence 1."""
TYPICAL_PER_M = {"mol/m^3": 0.03, "": 0.2, "1/m": 10.0}
"""A concentration that is found in tissue, by its unit."""
EXACT = 1e-3
OUTSIDE = np.zeros(GRID.shape, bool)
OUTSIDE[0] = OUTSIDE[:, 0] = True
"""Pixels that do not belong to the body: their absorption is not defined."""
DEFAULT_NAMES = ("oxyhaemoglobin", "deoxyhaemoglobin")
OXY, DEOXY = DEFAULT_NAMES


class ClearBody(FluenceModel):
    """Light of which nothing is lost, Phi = 1: with it, light and absorption agree from the first pass on."""

    name: ClassVar[str] = "clear-body"

    def fluence(self, boundary: Image, optics: Optics) -> Image:
        """Return 1 everywhere."""
        ones = np.ones((len(optics.wavelengths_nm), *boundary.grid.shape))
        return Image(ones, "fluence", "", boundary.grid, optics.wavelengths_nm)


def form_of_images(plugin: Unmixer) -> Iterator[str]:
    """It returns images by name on the grid, at least one, the same each time, finite or NaN."""
    problem = _problem(_amounts(plugin))
    found = plugin.unmix(problem)
    if not isinstance(found, Mapping) or not found:
        yield "it returns no images by name"
        return
    for name, image in found.items():
        if not isinstance(name, str) or not isinstance(image, Image) or image.grid != GRID:
            yield f"'{name}' is no image on the grid"
        elif np.isinf(image.values).any():
            yield f"'{name}' holds infinite pixels; what is undefined is NaN"
    again = plugin.unmix(problem)
    if any(not np.array_equal(image.values, again[name].values, equal_nan=True) for name, image in found.items()):
        yield "it returns something else the second time"
    for name in getattr(plugin, "chromophores", ()):
        if name not in found:
            yield f"'{name}' was asked for, and is not among {', '.join(found)}"


def exact_mixture(plugin: Unmixer) -> Iterator[str]:
    """From the absorption of known amounts of its chromophores it finds these amounts, and sO2 to 0.1 %."""
    amounts = _amounts(plugin)
    found = plugin.unmix(_problem(amounts))
    inside = ~OUTSIDE
    for name, amount in amounts.items():
        if name in found:
            error = difference(found[name].values[0, inside], amount[inside])
            if not error <= EXACT:
                yield f"'{name}' is wrong by {error:.1%} of it"
    if {OXY, DEOXY} <= amounts.keys() and "so2" in found:
        true = amounts[OXY] / (amounts[OXY] + amounts[DEOXY])
        off = np.abs(found["so2"].values[0] - true)[inside].max()
        if not off <= EXACT:
            yield f"so2 is wrong by up to {off:.3f}"


def proportion(plugin: Unmixer) -> Iterator[str]:
    """Twice the absorption is twice of each chromophore."""
    amounts = _amounts(plugin)
    once, twice = (plugin.unmix(_problem({k: f * v for k, v in amounts.items()})) for f in (0.5, 1.0))
    for name in amounts.keys() & once.keys():
        error = difference(twice[name].values[0, ~OUTSIDE], 2 * once[name].values[0, ~OUTSIDE])
        if not error <= EXACT:
            yield f"twice the absorption does not give twice of '{name}': it is off by {error:.1%}"


def pixels(plugin: Unmixer) -> Iterator[str]:
    """Each pixel is unmixed by itself: pixels that change places take their amounts with them."""
    amounts = _amounts(plugin)
    order = np.random.default_rng(0).permutation(int((~OUTSIDE).sum()))
    straight = plugin.unmix(_problem(amounts))
    mixed = plugin.unmix(_problem({name: _permuted(amount, order) for name, amount in amounts.items()}))
    for name in amounts.keys() & straight.keys():
        error = difference(mixed[name].values[0, ~OUTSIDE], straight[name].values[0, ~OUTSIDE][order])
        if not error <= EXACT:
            yield f"'{name}' in a pixel depends on where the others are: it changes by {error:.1%}"


def undefined(plugin: Unmixer) -> Iterator[str]:
    """A pixel whose absorption is NaN has no amount, and leaves the others as they are."""
    amounts = _amounts(plugin)
    problem = _problem(amounts)
    whole = plugin.unmix(problem)
    assert problem.absorption is not None
    values = problem.absorption.values.copy()
    values[3, 4, 5] = np.nan
    try:
        holed = plugin.unmix(replace(problem, absorption=replace(problem.absorption, values=values)))
    except Exception as raised:
        yield f"NaN in a pixel of the absorption raises {type(raised).__name__}: {raised}"
        return
    others = ~OUTSIDE
    others[4, 5] = False
    for name in amounts.keys() & whole.keys():
        error = difference(holed[name].values[0, others], whole[name].values[0, others])
        if not error <= EXACT:
            yield f"NaN in one pixel changes '{name}' in others by {error:.1%}"
        outside = whole[name].values[0, OUTSIDE]
        if np.isfinite(outside).any() and not np.abs(outside[np.isfinite(outside)]).max() <= EXACT:
            yield f"'{name}' has amounts outside of the body, where nothing is defined"


def _names(plugin: Unmixer) -> tuple[str, ...]:
    """Return the chromophores that an unmixer says it fits; where it does not say, haemoglobin."""
    names = tuple(getattr(plugin, "chromophores", DEFAULT_NAMES))
    return tuple(name for name in names if isinstance(name, str) and name in CHROMOPHORES) or DEFAULT_NAMES


def _amounts(plugin: Unmixer) -> dict[str, np.ndarray]:
    """Return how much there is of each chromophore, shape ``(y, x)``, no two pixels alike."""
    amounts = {}
    for seed, name in enumerate(_names(plugin)):
        typical = TYPICAL_PER_M.get(CHROMOPHORES[name].unit, 1.0)
        amounts[name] = typical * np.exp(0.3 * random(*GRID.shape, seed=seed))
    return amounts


def _problem(amounts: Mapping[str, np.ndarray]) -> UnmixProblem:
    """Return the mixture as an unmixer gets it, in a clear body."""
    absorption = sum(
        chromophore(name).spectrum(WAVELENGTHS_NM)[:, None, None] * amount for name, amount in amounts.items()
    )
    boundary = boundary_of(np.where(OUTSIDE, 1e-3, -1e-3), GRID)
    mean = np.mean(np.asarray(absorption)[:, ~OUTSIDE], axis=1)
    optics = Optics(WAVELENGTHS_NM, mean, np.full(len(WAVELENGTHS_NM), 1000.0))
    model = ClearBody()

    def image(values: np.ndarray, quantity: str, unit: str) -> Image:
        return Image(values, quantity, unit, GRID, WAVELENGTHS_NM)

    return UnmixProblem(
        image(CALIBRATION * np.where(OUTSIDE, 0.0, absorption), "initial_pressure", "a.u."),
        image(np.where(OUTSIDE, np.nan, absorption), "absorption", "1/m"),
        boundary,
        model.fluence(boundary, optics),
        model,
        optics,
        CALIBRATION,
    )


def _permuted(values: np.ndarray, order: np.ndarray) -> np.ndarray:
    out = values.copy()
    out[~OUTSIDE] = values[~OUTSIDE][order]
    return out


CHECKS = (form_of_images, exact_mixture, proportion, pixels, undefined)
