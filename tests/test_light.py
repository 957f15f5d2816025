"""Passes between light and absorption: what is left unexplained is counted in every pixel."""

import numpy as np
import pytest

from oatkit import Grid, Image, Optics, plugin
from oatkit.light import CoarseLight, Passes

GRID = Grid((40, 40), 5e-4)
WAVELENGTHS = (700.0, 800.0, 900.0)


def passes(pressure: np.ndarray) -> Passes:
    """Passes for a disc in which one grey chromophore absorbs 1/m for each unit, with K = 2."""
    y, x = np.meshgrid(GRID.y_m, GRID.x_m, indexing="ij")
    boundary = Image(np.hypot(y, x) - 8e-3, "boundary", "m", GRID)
    optics = Optics(WAVELENGTHS, np.full(3, 20.0), np.full(3, 1000.0))
    model = plugin("fluence_model", "diffusion-fvm")()
    light = model.fluence(boundary, optics).values
    coarse = CoarseLight(model, boundary, optics, light, factor=1)
    return Passes(pressure, coarse, lambda mu_a: mu_a.mean(0, keepdims=True), np.ones((3, 1)), 2.0, 0.02)


def test_the_misfit_is_that_of_the_pressure():
    """It is |p0 - K Phi E c| / |p0| as written, also where a wavelength shows nothing in a pixel that absorbs."""
    pressure = np.random.default_rng(0).random((3, 40, 40))
    pressure[1, 15:25, 15:25] = 0
    made = passes(pressure)
    state = made.settle(3, 1e-9).state
    inside = made.model.inside
    left = pressure - 2.0 * state.light * state.fitted
    assert state.light[:, inside].min() > 0.02 * state.light[:, inside].max()
    expected = np.linalg.norm(left[:, inside]) / np.linalg.norm(pressure[:, inside])
    assert made.misfit(state) == pytest.approx(expected)
