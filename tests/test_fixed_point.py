"""Absorption and light that belong together: fed back, the absorption that made the data comes out."""

from dataclasses import replace

import numpy as np
import pytest

from oatkit import Grid, Image, Optics, plugin
from oatkit.quantification.fixed_point import fixed_point
from oatkit.simulate import Body, star_body
from oatkit.tables import AbsorptionTable

GRID = Grid((60, 60), 20e-3 / 60)
FINER = 5
"""How many pixels of the simulation lie along one of the image."""
SCATTERING = np.array([1000.0])
MODEL = plugin("fluence_model", "diffusion-fvm")()


def averaged(image: Image) -> np.ndarray:
    """The mean of a fine image over each pixel of the coarse grid."""
    return image.values[0].reshape(60, FINER, 60, FINER).mean(axis=(1, 3))


def star() -> tuple[Body, Image, Image, Optics]:
    """The star phantom, its pressure simulated on a finer grid, its outline, and the optics of agar alone."""
    body = star_body()
    fine = Grid((60 * FINER, 60 * FINER), GRID.pixel_size_m / FINER)
    mu_a = body.absorption(fine)
    light = MODEL.fluence(body.boundary(fine), Optics((700.0,), mu_a.values, SCATTERING))
    pressure = averaged(Image(mu_a.values * light.values, "initial_pressure", "a.u.", fine))
    agar = Optics((700.0,), np.array([25.0]), SCATTERING)
    return body, Image(pressure, "initial_pressure", "a.u.", GRID, (700.0,)), body.boundary(GRID), agar


def deep_tube() -> np.ndarray:
    """The core of the tube in the middle."""
    y, x = np.meshgrid(GRID.y_m, GRID.x_m, indexing="ij")
    return np.hypot(y, x) < 0.6e-3


def fed_back(passes: int, calibration: float | None, mean_per_m: float = 25.0) -> tuple[Image, Image]:
    """Absorption and fluence of the star after so many passes."""
    _, pressure, boundary, agar = star()
    optics = Optics(agar.wavelengths_nm, np.array([mean_per_m]), SCATTERING)
    fluence = MODEL.fluence(boundary, agar)
    table = AbsorptionTable(calibration=calibration, passes=passes)
    return fixed_point(table, MODEL, optics, pressure, fluence, boundary)


def test_the_absorption_that_made_the_data_comes_out():
    """With the right calibration the tube in the middle comes out within 3 % of 250 / m; one pass is 30 % off."""
    once, _ = fed_back(1, 1.0)
    often, _ = fed_back(15, 1.0)
    assert once.values[0][deep_tube()].mean() < 0.7 * 250
    assert often.values[0][deep_tube()].mean() == pytest.approx(250, rel=0.03)
    assert often.unit == "1/m"
    assert often.diagnostics["notes"] == ()


def test_absorption_and_light_belong_together():
    """At the fixed point the pressure is absorption times fluence, and the fluence is that of the absorption."""
    _, pressure, boundary, _ = star()
    mu_a, light = fed_back(15, 1.0)
    inside = boundary.values[0] < 0
    np.testing.assert_allclose((mu_a.values * light.values)[0][inside], pressure.values[0][inside], rtol=1e-5)
    again = MODEL.fluence(
        boundary, Optics((700.0,), np.where(inside, np.nan_to_num(mu_a.values), 25.0).astype(float), SCATTERING)
    )
    np.testing.assert_allclose(again.values[0][inside], light.values[0][inside], rtol=2e-3)


def test_the_mean_of_the_body_stands_in_for_a_calibration():
    """Without K, and with the true mean absorption of the body, the same image comes out up to its scale."""
    body, _, boundary, _ = star()
    mean = float(body.absorption(GRID).values[0][boundary.values[0] < 0].mean())
    by_mean, _ = fed_back(15, None, mean)
    known, _ = fed_back(15, 1.0)
    assert by_mean.unit == "a.u."
    tube, agar = deep_tube(), (boundary.values[0] < -1e-3) & (body.absorption(GRID).values[0] < 26)
    contrasts = [image.values[0][tube].mean() / image.values[0][agar].mean() for image in (by_mean, known)]
    assert contrasts[0] == pytest.approx(contrasts[1], rel=0.05)


def test_passes_that_have_not_settled_are_said():
    """After two passes the absorption still moves, which a note says with the share; each pass is recorded."""
    found, _ = fed_back(2, 1.0)
    assert len(found.diagnostics["change"]) == 1
    assert "changed the absorption by" in found.diagnostics["notes"][0]
    changes = [change for (change,) in fed_back(15, 1.0)[0].diagnostics["change"]]
    assert changes[-1] < 1e-3 < changes[0]


def test_a_calibration_a_fifth_too_low_makes_a_deep_tube_five_times_too_absorbing():
    """With 0.8 of the right calibration the tube in the middle comes out with 4.5 to 5.5 times its absorption."""
    found, _ = fed_back(15, 0.8)
    assert 4.5 < found.values[0][deep_tube()].mean() / 250 < 5.5


@pytest.mark.parametrize(("calibration", "sentence"), [(0.8, "passed mu_s'"), (4.0, "check the calibration")])
def test_a_wrong_calibration_is_said(calibration, sentence):
    """A calibration too low drives absorption to its limit, one too high far below the stated mean; both are said."""
    found, _ = fed_back(15, calibration)
    assert any(sentence in note for note in found.diagnostics["notes"])


def test_one_calibration_holds_at_all_wavelengths():
    """Without K, only the mean over all wavelengths need be known: a body half as absorbing comes out as that."""
    body, pressure, boundary, _ = star()
    fine = Grid((60 * FINER, 60 * FINER), GRID.pixel_size_m / FINER)
    half = replace(body.absorption(fine), values=body.absorption(fine).values / 2)
    light = MODEL.fluence(body.boundary(fine), Optics((800.0,), half.values, SCATTERING))
    dimmer = averaged(replace(half, values=half.values * light.values))
    both = Image(np.stack([pressure.values[0], dimmer]), "initial_pressure", "a.u.", GRID, (700.0, 800.0))
    mean = 0.75 * float(body.absorption(GRID).values[0][boundary.values[0] < 0].mean())
    optics = Optics(both.wavelengths_nm, np.full(2, mean), np.repeat(SCATTERING, 2))
    found, _ = fixed_point(AbsorptionTable(passes=15), MODEL, optics, both, MODEL.fluence(boundary, optics), boundary)
    tubes = found.values[:, deep_tube()].mean(1)
    assert tubes[1] / tubes[0] == pytest.approx(0.5, rel=0.03)


def test_negative_pixels_take_nothing_from_the_mean():
    """Without K, pixels far below zero leave the light as zeros would: the mean is that of what absorbs."""
    _, pressure, boundary, agar = star()
    y, x = np.meshgrid(GRID.y_m, GRID.x_m, indexing="ij")
    corner = np.hypot(y - 3e-3, x) < 1e-3
    signed, zeroed = (
        Image(np.where(corner, value, pressure.values), "initial_pressure", "a.u.", GRID, pressure.wavelengths_nm)
        for value in (-100.0, 0.0)
    )
    light = MODEL.fluence(boundary, agar)
    table = AbsorptionTable(passes=6)
    lights = [fixed_point(table, MODEL, agar, image, light, boundary)[1].values for image in (signed, zeroed)]
    assert lights[0] == pytest.approx(lights[1], rel=1e-6)
