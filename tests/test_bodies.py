"""Bodies: absorption and outline of one object, on any grid."""

import numpy as np
import pytest

from oatkit.api import FluenceModel
from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.polygons import area, centroid
from oatkit.simulate import BODIES, breast_body, disc_body, mouse_body, msot_geometry, star_body
from oatkit.simulate.mouse import AORTA, BONE

GRID = Grid((100, 100), 0.25e-3)

CASES = {**BODIES, "mouse with legs": lambda: mouse_body(2, legs=True), "small star": lambda: star_body(7e-3)}


class Homogeneous(FluenceModel):
    """Light of one value inside, which keeps what it was given."""

    name = "homogeneous"

    def fluence(self, boundary, optics):
        light = optics.absorption_per_m[:, None, None] * optics.reduced_scattering_per_m[:, None, None]
        return Image(light * (boundary.values < 0), "fluence", "", boundary.grid, optics.wavelengths_nm)


@pytest.mark.parametrize("name", CASES)
def test_a_body_absorbs_inside_its_outline_and_nowhere_else(name):
    """Pixels wholly outside the outline are zero, and those wholly inside are not."""
    body = CASES[name]()
    absorption, distance = body.absorption(GRID).values[0], body.boundary(GRID).values[0]
    assert not absorption[distance > GRID.pixel_size_m].any()
    assert (absorption[distance < -GRID.pixel_size_m] > 0).all()
    assert ((absorption > 0) & (abs(distance) < GRID.pixel_size_m / 2)).any()


@pytest.mark.parametrize("name", CASES)
def test_the_outline_encloses_the_area_of_the_body(name):
    """Its area is that of the plane where the density is not zero, counted on 50 um squares, to 1e-3."""
    body = CASES[name]()
    side = 5e-5 * (np.arange(500) - 249.5)
    counted = (body.density(side[:, None], side[None, :]) > 0).sum() * 5e-5**2
    assert abs(area(body.outline_m)) == pytest.approx(counted, rel=1e-3)


@pytest.mark.parametrize("name", CASES)
def test_a_boundary_is_a_distance(name):
    """It changes by at most a step's length between neighbours, and its slope is 1 in the middle half of pixels."""
    distance = CASES[name]().boundary(GRID).values[0]
    assert abs(np.diff(distance, axis=0)).max() <= GRID.pixel_size_m * (1 + 1e-2)
    slope = np.hypot(*np.gradient(distance, GRID.pixel_size_m))
    assert np.quantile(slope, [0.25, 0.75]) == pytest.approx([1, 1], abs=1e-2)


def test_a_disc_is_known_exactly():
    """Its boundary is |r - c| - R to 1 nm, its absorption 25 / m."""
    body = disc_body(6e-3, (2e-3, -1e-3))
    radius = np.hypot(GRID.y_m[:, None] - 2e-3, GRID.x_m[None, :] + 1e-3)
    assert abs(body.boundary(GRID).values[0] - (radius - 6e-3)).max() <= 2e-9
    assert (body.absorption(GRID).values[0][radius < 5.5e-3] == 25).all()


def test_values_are_those_of_the_phantoms_per_cm():
    """The star has 25 / m and tubes of 250 / m, the breast tumours of 100 / m at most."""
    assert set(np.unique(star_body().absorption(Grid((2, 2), 1e-5, (6.12e-3, 0))).values)) == {250.0}
    assert star_body().absorption(Grid((1, 1), 1e-5, (3e-3, 0))).values.item() == 25
    assert breast_body(4).absorption(GRID).values.max() == pytest.approx(100)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("legs", [False, True])
def test_a_mouse_fits_the_scanner(seed, legs):
    """It is 19 .. 21 mm wide, inside 25 mm with 1 mm to spare, far from the detectors, and holds blood and bone."""
    body = mouse_body(seed, legs)
    low, high = 1e3 * body.outline_m.min(0), 1e3 * body.outline_m.max(0)
    assert 19 <= high[1] - low[1] <= 21
    assert abs(np.array([low, high])).max() <= 11.5
    assert np.hypot(*body.outline_m.T).max() < 0.5 * np.hypot(*msot_geometry().detectors.positions_m.T).min()
    values = body.absorption(Grid((400, 400), 62.5e-6)).values
    assert values.max() == pytest.approx(100 * AORTA)
    assert values[values > 0].min() < 100 * BONE


def test_only_legs_hide_from_the_centre():
    """From its centroid, a mouse is seen to go around without turning back; one with legs turns back."""

    def turns_back(body):
        y, x = (body.outline_m - centroid(body.outline_m)).T
        step = np.diff(np.unwrap(np.arctan2(y, x)))
        return (np.sign(step) != np.sign(step.sum())).any()

    assert not any(turns_back(mouse_body(seed)) for seed in range(5))
    assert all(turns_back(mouse_body(seed, legs=True)) for seed in range(5))


def test_a_mouse_is_drawn_by_its_seed():
    """The same seed gives the same mouse to the bit, another seed another one."""
    first, again, other = (mouse_body(seed).absorption(GRID) for seed in (3, 3, 4))
    assert first == again
    assert first != other


def test_the_initial_pressure_is_absorption_times_fluence():
    """The model is asked with the body's own boundary and the given optics, and its fluence comes back as it is."""
    pressure, fluence = disc_body().lit(GRID, Homogeneous(), 1000.0, 30.0)
    assert fluence.values.max() == 30_000
    assert (pressure.values == disc_body().absorption(GRID).values * fluence.values).all()
    assert (pressure.quantity, pressure.unit, pressure.wavelengths_nm) == ("initial_pressure", "a.u.", (700.0,))


@pytest.mark.parametrize("make", [disc_body, star_body, lambda r: breast_body(0, r)])
def test_a_radius_in_millimetres_is_refused(make):
    """The unit is m, and the message says so."""
    with pytest.raises(ValidationError, match="5 mm is 5e-3"):
        make(9.0)
