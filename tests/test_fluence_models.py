"""Light that is collimated, in a band or through water; walls at the edge; what fluence models refuse and note."""

import numpy as np
import pytest
from scipy.special import iv, kv

from lit_bodies import (
    A_WATER,
    BREAST,
    MODELS,
    MU_EFF,
    OFF_CENTRE,
    RADIUS,
    D,
    body,
    disc_solution,
    patchy,
    radii,
    solved,
    star,
)  # fmt: skip
from oatkit.builtin.fluence.beer_lambert import BeerLambert
from oatkit.builtin.fluence.cut_cells import CutCells, corner_values
from oatkit.builtin.fluence.diffusion_fvm import DiffusionFvm
from oatkit.data import Grid, Image, Optics
from oatkit.errors import SolverError, ValidationError
from oatkit.spectra import water_absorption_per_m


def test_collimated_light_is_a_ring_under_the_wall():
    """Beyond 1.5 mm of depth, a disc holds I0 and K0 of a ring at R - 1 / mu_s' with the power g / (2 A) per wall."""
    ring = RADIUS - 1 / 1200
    power = 2 * np.pi * RADIUS / (2 * A_WATER)
    at_wall = 2 * A_WATER * D * MU_EFF
    outwards = kv(0, MU_EFF * RADIUS) - at_wall * kv(1, MU_EFF * RADIUS)
    back = iv(0, MU_EFF * RADIUS) + at_wall * iv(1, MU_EFF * RADIUS)
    r = radii(0.12e-3, OFF_CENTRE)
    deep = r < RADIUS - 1.5e-3
    amplitude = power / (2 * np.pi * D) * (kv(0, MU_EFF * ring) - iv(0, MU_EFF * ring) * outwards / back)
    found = solved(r - RADIUS, 0.12e-3, model=DiffusionFvm(illumination="collimated"))
    assert found[deep] == pytest.approx(amplitude * iv(0, MU_EFF * r[deep]), rel=1e-3)


def test_collimated_light_brings_the_power_of_diffuse_light():
    """Without absorption and with matched indices, what leaves a disc, Phi / 2 per wall, is the g / 2 that came in."""
    optics = Optics((800,), [0.0], [1200.0])
    h = 0.24e-3
    r = radii(h)
    fluence = solved(r - RADIUS, h, optics, DiffusionFvm(illumination="collimated", index_couplant=1.4))
    # With no sink, Phi is constant inside the ring: the logarithm from there to the wall adds to the wall's Phi = 1.
    ring, diffusion = RADIUS - 1 / 1200, 1 / 3600
    assert fluence[r < 8e-3] == pytest.approx(1 + RADIUS * np.log(RADIUS / ring) / (2 * diffusion), rel=3e-3)


def series(r, n_terms):
    """The band series of 8 mm in 40 mm on a disc, from Bessel functions."""
    n = np.arange(n_terms)
    weights = 0.2 * np.sinc(n * 0.2) * np.where(n == 0, 1, 2)
    terms = [disc_solution(r, A_WATER, 2 * np.pi * k / 40e-3) for k in n]
    return np.tensordot(weights, terms, 1)


def test_band_is_the_series_in_three_dimensions():
    """Eight terms are within 1 % of 300 everywhere in a disc; its centre gets 0.56 of the light of the plane."""
    r = radii(0.12e-3)
    inside = r < RADIUS
    found = solved(r - RADIUS, 0.12e-3, model=DiffusionFvm(band_width=8.0))
    assert found[inside] == pytest.approx(series(r, 300)[inside], rel=0.01)
    long = solved(r - RADIUS, 0.12e-3, model=DiffusionFvm(band_width=8.0, n_harmonics=40))
    assert long[r < 9e-3] == pytest.approx(series(r, 40)[r < 9e-3], rel=1e-3)
    assert found[100, 100] / solved(r - RADIUS, 0.12e-3)[100, 100] == pytest.approx(0.56, abs=0.005)


@pytest.mark.parametrize("illumination", ["diffuse", "collimated"])
def test_band_of_a_whole_period_is_the_plane(illumination):
    """A band as wide as its period lights all of z: the fluence of the plane, to rounding."""
    distance = radii(0.4e-3) - RADIUS
    band = DiffusionFvm(illumination=illumination, band_width=40.0)
    plane = DiffusionFvm(illumination=illumination)
    found, known = (solved(distance, 0.4e-3, model=m) for m in (band, plane))
    assert found == pytest.approx(known, rel=1e-12)


@pytest.mark.parametrize("couplant", ["h2o", "d2o"])
@pytest.mark.parametrize("name", ["diffusion-fvm", "beer-lambert"])
def test_water_takes_light_on_its_way(name, couplant):
    """In the water the fluence is exp(-mu_a d); a centred disc gets all its light so attenuated."""
    model = {"diffusion-fvm": DiffusionFvm, "beer-lambert": BeerLambert}[name]
    r = radii(0.24e-3)
    optics = Optics((700, 970), [20.0, 20.0], [1200.0, 1200.0])
    dry = model().fluence(body(r - RADIUS, 0.24e-3), optics).values
    wet = model(ring_radius=30.0, couplant=couplant).fluence(body(r - RADIUS, 0.24e-3), optics).values
    outside = r >= RADIUS
    assert (dry[:, outside] == 1).all()
    for index, absorption in enumerate(water_absorption_per_m((700, 970), couplant)):
        assert wet[index][outside] == pytest.approx(np.exp(-absorption * (30e-3 - r[outside])), rel=1e-12)
        way = np.exp(-absorption * 20e-3)
        # The middles of the pieces of wall are chords: up to h^2 / 8 R, 1 um, inside of the circle.
        assert wet[index][~outside] == pytest.approx(dry[index][~outside] * way, rel=2e-6 * absorption)


def test_light_comes_from_the_ring_about_its_centre():
    """With the ring and the body moved together, the light moves with them."""
    r = radii(0.4e-3, n=60)
    centre = (3e-3, -2e-3)
    moved = Image(r - RADIUS, "boundary", "m", Grid(r.shape, 0.4e-3, centre))
    there = DiffusionFvm(ring_radius=20.0, ring_centre=(3.0, -2.0)).fluence(moved, Optics((970,), [20.0], [1200.0]))
    here = DiffusionFvm(ring_radius=20.0).fluence(body(r - RADIUS, 0.4e-3), Optics((970,), [20.0], [1200.0]))
    assert there.values == pytest.approx(here.values, rel=1e-12)


def test_edge_of_the_grid_is_a_mirror():
    """Half a disc that the edge of the grid cuts off has the fluence of the whole one, and a note says so.

    The wall meets the edge along its tangent, which is off the circle by h^2 / 8 R, 1 um, at half a pixel.
    """
    whole = radii(0.24e-3, n=100) - RADIUS
    half = Image(whole[50:], "boundary", "m", Grid((50, 100), 0.24e-3))
    image = DiffusionFvm().fluence(half, BREAST)
    assert image.values[0] == pytest.approx(solved(whole, 0.24e-3)[50:], rel=1e-4)
    assert "cut off by the edge" in " ".join(image.diagnostics["notes"])
    assert DiffusionFvm().fluence(body(whole, 0.24e-3), BREAST).diagnostics["notes"] == ()


def test_bodies_apart_do_not_know_of_each_other():
    """Two bodies, one of them of a single pixel, have each the fluence that it has alone."""
    distance = radii(0.4e-3, n=80) - RADIUS
    rows, columns = np.indices(distance.shape)
    speck = 0.4e-3 * np.hypot(rows - 3, columns - 4) - 0.1e-3
    both = solved(np.minimum(distance, speck), 0.4e-3)
    assert both[distance < 0] == pytest.approx(solved(distance, 0.4e-3)[distance < 0], rel=1e-12)
    assert both[3, 4] == pytest.approx(solved(speck, 0.4e-3)[3, 4], rel=1e-12)
    assert both[3, 4] < 1


@pytest.mark.parametrize("name", MODELS)
def test_images_of_equal_pixels_are_numbers(name):
    """Optics given as images, of any value outside the body, equal the same optics given as numbers."""
    distance = star(0.4e-3)
    image = np.where(distance < 0, 1.0, 0.0)
    pictures = Optics((800,), 20 * image[None], 1200 * image[None])
    found = MODELS[name].fluence(body(distance, 0.4e-3), pictures).values
    assert found == pytest.approx(MODELS[name].fluence(body(distance, 0.4e-3), BREAST).values, rel=1e-12)


def test_divergence_theorem_holds_in_every_cut_cell():
    """However a rough wall goes, its outward normals and the open faces of each cell sum up to zero."""
    distance = np.random.default_rng(3).standard_normal((30, 40))
    cells = CutCells.of(distance, 2.0)
    corners = corner_values(distance)

    def open_part(a, b):
        low, high = np.minimum(a, b), np.maximum(a, b)
        return np.where(high < 0, 1.0, np.where(low < 0, low / np.where(low < 0, low - high, 1), 0.0))

    rows, columns = open_part(corners[:, :-1], corners[:, 1:]), open_part(corners[:-1], corners[1:])
    through = np.stack([np.diff(rows, axis=0), np.diff(columns, axis=1)], axis=-1) * 2.0
    for axis in (0, 1):
        wall = np.bincount(cells.wall_cell, cells.wall_length * cells.wall_normal[:, axis], len(cells.cells))
        assert wall + through[..., axis].ravel()[cells.cells] == pytest.approx(0, abs=1e-13)


def test_cut_cells_have_the_area_and_the_wall_of_a_disc():
    """Area and wall of a disc are right to (h / R)^2."""
    for h in (0.48e-3, 0.12e-3):
        cells = CutCells.of(radii(h, OFF_CENTRE) - RADIUS, h)
        assert cells.volume.sum() == pytest.approx(np.pi * RADIUS**2, rel=(h / RADIUS) ** 2)
        assert cells.wall_length.sum() == pytest.approx(2 * np.pi * RADIUS, rel=(h / RADIUS) ** 2)


@pytest.mark.parametrize(("attenuation", "mu"), [("effective", MU_EFF), ("absorption", 20.0)])
def test_beer_lambert_is_an_exponential_of_depth(attenuation, mu):
    """Phi = exp(-mu d) at the depth d of every pixel; of images, mu is the mean over the body."""
    distance = star(0.4e-3)
    model = BeerLambert(attenuation=attenuation)
    values = model.fluence(body(distance, 0.4e-3), BREAST).values[0]
    assert values == pytest.approx(np.exp(mu * np.minimum(distance, 0)), rel=1e-12)
    optics = patchy(distance.shape)
    mu_a, mu_s = (v[0][distance < 0] for v in (optics.absorption_per_m, optics.reduced_scattering_per_m))
    mean = np.mean(np.sqrt(3 * mu_a * (mu_a + mu_s)) if attenuation == "effective" else mu_a)
    values = model.fluence(body(distance, 0.4e-3), optics).values[0]
    assert values == pytest.approx(np.exp(mean * np.minimum(distance, 0)), rel=1e-12)


def test_no_body_is_no_result():
    """A boundary without a pixel inside is a `SolverError` of every model."""
    for model in (DiffusionFvm(), BeerLambert()):
        with pytest.raises(SolverError, match="no pixel lies inside"):
            model.fluence(body(np.ones((5, 5)), 1e-3), BREAST)


@pytest.mark.parametrize(
    ("distance", "optics", "words"),
    [
        (np.full((4, 4), np.nan), BREAST, "finite"),
        (np.full((4, 4), -1e-3), Optics((800,), [0.0], [0.0]), "diffusion has no meaning"),
        (np.full((4, 4), -1e-3), Optics((800,), np.ones((1, 3, 3)), [1200.0]), r"\(4, 4\), got \(3, 3\)"),
    ],
)
def test_impossible_input_is_refused(distance, optics, words):
    """A distance that is not finite, light that neither scatters nor is absorbed, images of another grid."""
    with pytest.raises(ValidationError, match=words):
        DiffusionFvm().fluence(body(distance, 1e-3), optics)


def test_impossible_settings_are_refused():
    """A band wider than its period, a mask for a distance, collimated light that nothing scatters, unknown water."""
    with pytest.raises(ValidationError, match="band_width"):
        DiffusionFvm(band_width=50.0)
    with pytest.raises(ValidationError, match="signed distance in m"):
        DiffusionFvm().fluence(Image(-np.ones((4, 4)), "mask", "", Grid((4, 4), 1e-3)), BREAST)
    disc = body(radii(1e-3) - RADIUS, 1e-3)
    with pytest.raises(ValidationError, match="mu_s'"):
        DiffusionFvm(illumination="collimated").fluence(disc, Optics((800,), [20.0], [0.0]))
    with pytest.raises(ValidationError, match="1200 nm"):
        DiffusionFvm(ring_radius=30.0).fluence(disc, Optics((1200,), [20.0], [1200.0]))


def test_notes_say_where_the_model_ends():
    """Absorption above scattering, pixels far above the free path, and a body beyond the ring are noted."""
    disc = body(radii(1e-3) - RADIUS, 1e-3)
    optics = Optics((700, 800), [2000.0, 20.0], [1200.0, 1200.0])
    notes = DiffusionFvm(ring_radius=9.0).fluence(disc, optics).diagnostics["notes"]
    for words in ("beyond the ring", "At 700 nm the body absorbs more", "Pixels of 1 mm are large"):
        assert sum(words in note for note in notes) == 1
    assert "beyond the ring" in BeerLambert(ring_radius=9.0).fluence(disc, BREAST).diagnostics["notes"][0]
