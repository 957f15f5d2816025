"""Absorption is p0 / (K Gamma Phi) inside the body, and says what of that was known."""

import numpy as np
import pytest

from oatkit import Grid, Image, ValidationError
from oatkit.quantification.absorption import absorption
from oatkit.tables import AbsorptionTable

GRID = Grid((20, 24), 2e-4)
WAVELENGTHS_NM = (700.0, 800.0)


def images(seed: int = 0) -> tuple[Image, Image, Image]:
    """Pressure, fluence and boundary of a disc that fills half of the grid; the pressure has both signs."""
    rng = np.random.default_rng(seed)
    y, x = np.meshgrid(GRID.y_m, GRID.x_m, indexing="ij")
    pressure = rng.standard_normal((2, *GRID.shape))
    light = rng.uniform(0.5, 1.0, (2, *GRID.shape))
    return (
        Image(pressure, "initial_pressure", "a.u.", GRID, WAVELENGTHS_NM),
        Image(light, "fluence", "", GRID, WAVELENGTHS_NM),
        Image(np.hypot(y, x) - 1.5e-3, "boundary", "m", GRID),
    )


def test_a_known_absorption_comes_back():
    """The pressure that mu_a makes with known K, Gamma and Phi gives mu_a in 1/m inside, NaN outside."""
    _, fluence, boundary = images()
    mu_a = np.random.default_rng(1).uniform(10, 300, fluence.values.shape)
    pressure = Image(7.0 * 0.2 * mu_a * fluence.values, "initial_pressure", "a.u.", GRID, WAVELENGTHS_NM)
    found = absorption(AbsorptionTable(calibration=7.0, grueneisen=0.2), pressure, fluence, boundary)
    inside = np.broadcast_to(boundary.values < 0, mu_a.shape)
    np.testing.assert_allclose(found.values[inside], mu_a[inside], rtol=1e-6)
    assert np.isnan(found.values[~inside]).all()
    assert found.unit == "1/m"
    assert found.diagnostics["calibration"] == 7.0
    assert found.diagnostics["notes"] == ()


def test_without_a_calibration_the_unit_is_arbitrary_and_said():
    """Where K is not known the unit is never one of absorption, and a note says why."""
    found = absorption(AbsorptionTable(), *images())
    assert found.unit == "a.u."
    assert found.diagnostics["calibration"] == "unknown"
    assert "arbitrary units" in found.diagnostics["notes"][0]


def test_the_sign_of_the_pressure_stays():
    """Correction divides by positive numbers, so no pixel changes its sign."""
    pressure, fluence, boundary = images()
    found = absorption(AbsorptionTable(), pressure, fluence, boundary)
    inside = np.broadcast_to(boundary.values < 0, pressure.values.shape)
    np.testing.assert_array_equal(np.sign(found.values[inside]), np.sign(pressure.values[inside]))


def test_the_fluence_is_not_taken_below_its_floor():
    """Where the light is darker than the floor, the floor divides, and the pixels are counted by wavelength."""
    pressure, fluence, boundary = images()
    light = np.array(fluence.values)
    dark = np.zeros(light.shape, bool)
    dark[1, 9:12, 10:13] = True
    light[dark] = 1e-9
    found = absorption(
        AbsorptionTable(floor=0.1), pressure, Image(light, "fluence", "", GRID, WAVELENGTHS_NM), boundary
    )
    inside = boundary.values[0] < 0
    expected = pressure.values[1][dark[1]] / (0.1 * light[1][inside].max())
    np.testing.assert_allclose(found.values[1][dark[1]], expected, rtol=1e-6)
    assert found.diagnostics["floored_pixels"] == (0, 9)


@pytest.mark.parametrize("what", ["grid", "wavelengths"])
def test_images_that_do_not_belong_together_are_refused(what):
    """Another grid or other wavelengths are a ValidationError, not a broadcast."""
    pressure, fluence, boundary = images()
    if what == "grid":
        boundary = Image(boundary.values, "boundary", "m", Grid(GRID.shape, 1e-4))
    else:
        fluence = Image(fluence.values, "fluence", "", GRID, (700.0, 801.0))
    with pytest.raises(ValidationError, match="must share grid and wavelengths"):
        absorption(AbsorptionTable(), pressure, fluence, boundary)
