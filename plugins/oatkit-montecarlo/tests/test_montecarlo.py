"""Photons in the body: against exact solutions of radiative transfer, and against diffusion where that holds."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.ndimage import gaussian_filter
from scipy.optimize import brentq
from scipy.special import expn

import oatkit
from oatkit.api import Grid, Image, Optics, SolverError, ValidationError
from oatkit.testing import check_plugin
from oatkit_montecarlo.body import Body
from oatkit_montecarlo.fresnel import reflected_shares
from oatkit_montecarlo.model import MonteCarlo

DiffusionFvm = oatkit.plugin("fluence_model", "diffusion-fvm")
MATCHED = {"index_body": 1.4, "index_couplant": 1.4}
TISSUE = Optics((800,), [20.0], [1200.0])
RADIUS = 10e-3


def slab(n, h, margin=2):
    """A slab of n pixels between two walls on faces of pixels, in one row: mirrored, so endless."""
    x = (np.arange(n + 2 * margin) - (n + 2 * margin - 1) / 2) * h
    return Image((abs(x) - n * h / 2)[None], "boundary", "m", Grid((1, n + 2 * margin), h))


def disc(n=100, width=24e-3, radius=RADIUS, centre=(0.13e-3, -0.21e-3)):
    """A disc off the middle of the grid."""
    grid = Grid((n, n), width / n)
    r = np.hypot(grid.y_m[:, None] - centre[0], grid.x_m - centre[1])
    return Image(r - radius, "boundary", "m", grid)


def star(n=80, width=24e-3):
    """The distance, to first order, from a five-pointed outline with hollows."""
    grid = Grid((n, n), width / n)
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    outline = 8e-3 * (1 + 0.2 * np.cos(5 * np.arctan2(y, x)))
    return Image(np.hypot(y, x) - outline, "boundary", "m", grid)


def patchy(shape, absorption, scattering):
    """Optics at one wavelength that vary from place to place."""
    noise = gaussian_filter(np.random.default_rng(0).standard_normal((2, *shape)), (0, 3, 3))
    return Optics((800,), absorption * np.exp(6 * noise[:1]), scattering * np.exp(4 * noise[1:]))


def lit(boundary, optics, **parameters):
    """The fluence in the body, shape ``(pixel,)``, with its standard error and what the model says of it."""
    image = MonteCarlo(**{"n_photons": 40_000, "error_map": True, **parameters}).fluence(boundary, optics)
    inside = boundary.values[0] < 0
    return image.values[0][inside], image.diagnostics["standard_error"][0][inside], image.diagnostics


def by_depth(values, boundary, edges_mm):
    """The mean over the pixels of each range of depth."""
    depth = -1e3 * boundary.values[0]
    return np.array([values[(depth >= a) & (depth < b)].mean() for a, b in pairwise(edges_mm)])


@pytest.mark.parametrize(
    ("body", "couplant", "factor"), [(1.4, 1.33, 1.16715841), (1.37, 1.33, 1.089333), (1.4, 1.0, 2.948500)]
)
def test_wall_reflects_as_the_fresnel_integrals_say(body, couplant, factor):
    """R_phi is that of adaptive quadrature, and (1 + R_j) / (1 - R_phi) the known factor A of the Robin condition."""

    def reflected(t):
        sine = np.sin(t) * body / couplant
        c, c_t = body * np.cos(t), couplant * np.sqrt(1 - sine**2)
        d, d_t = couplant * np.cos(t), body * np.sqrt(1 - sine**2)
        return (((c - c_t) / (c + c_t)) ** 2 + ((d - d_t) / (d + d_t)) ** 2) / 2

    critical = np.arcsin(couplant / body)
    below = quad(lambda t: np.sin(2 * t) * reflected(t), 0, critical, epsabs=1e-13, limit=200)[0]
    r_phi, r_j = reflected_shares(body, couplant)
    assert r_phi == pytest.approx(below + np.cos(critical) ** 2, rel=1e-10)
    assert (1 + r_j) / (1 - r_phi) == pytest.approx(factor, rel=3e-6)
    assert reflected_shares(1.4, 1.4) == pytest.approx((0, 0), abs=1e-14)


def test_cut_pixels_have_the_area_and_the_wall_of_the_disc():
    """Area and circumference of a disc converge with the square of the pixel; normals point outwards."""
    errors = []
    for n in (50, 200):
        body = Body.of(disc(n))
        h = 24e-3 / n
        area, length = body.share.sum() * h**2, body.wall.length.sum() * h
        errors.append([abs(area / (np.pi * RADIUS**2) - 1), abs(length / (2 * np.pi * RADIUS) - 1)])
        outwards = body.wall.middle - n / 2 - np.array([0.13e-3, -0.21e-3]) / h
        assert (np.sum(outwards * body.wall.outwards, axis=1) > 0.9 * RADIUS / h).all()
    assert (np.array(errors[1]) < np.array(errors[0]) / 8).all()


def test_collimated_light_in_a_clear_slab_is_beer_lambert():
    """Without scattering, light along the normals of both walls decays exponentially, to 1e-12 in every pixel."""
    n, mu = 50, 0.08
    optics = Optics((800,), [mu / 1e-4], [0.0])
    found, _, _ = lit(slab(n, 1e-4), optics, illumination="collimated", n_photons=1_000, **MATCHED)
    x = np.arange(n)
    mean = np.exp(-mu * x) * -np.expm1(-mu) / mu
    assert found == pytest.approx((mean + mean[::-1]) / 2, rel=1e-12)


def test_diffuse_light_in_a_clear_slab_is_the_exponential_integral():
    """Without scattering, Lambert's light from both walls is (E2(mu x) + E2(mu (L - x))) / 2, within its error."""
    n, mu = 40, 0.1
    found, error, _ = lit(slab(n, 1e-4), Optics((800,), [mu / 1e-4], [0.0]), n_photons=200_000, **MATCHED)
    x = np.arange(n + 1)
    mean = -np.diff(expn(3, mu * x)) / mu
    away = (found - (mean + mean[::-1]) / 2) / error
    assert np.median(error / found) < 5e-3
    assert abs(away).max() < 5
    assert 0.3 < np.mean(away**2) < 2.5


@pytest.mark.parametrize("couplant", [1.4, 1.33, 1.0, 1.6])
def test_body_without_absorption_is_filled_evenly(couplant):
    """Whatever the shape, the scattering and the indices, diffuse light that is not absorbed makes Phi = 1."""
    boundary = star()
    optics = patchy(boundary.values[0].shape, 0.0, 600.0)
    means = []
    for seed in range(6):
        found, error, told = lit(boundary, optics, index_couplant=couplant, seed=seed)
        means.append(np.average(found))
        assert np.median(abs(found - 1) / error) == pytest.approx(0.688, abs=0.12)
        assert told["absorbed"] == (0,)
    assert abs(np.mean(means) - 1) < 4 * np.std(means, ddof=1) / np.sqrt(len(means))
    assert np.std(means) < 0.01


def h_function(albedo, n=200):
    """Chandrasekhar's H of isotropic scattering at Gauss points between 0 and 1, with their weights."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    mu, weights = (nodes + 1) / 2, weights / 2
    h, rest = np.ones(n), np.sqrt(1 - albedo)
    for _ in range(500):
        h = 1 / (rest + albedo / 2 * ((weights * mu * h) / (mu[:, None] + mu)).sum(axis=1))
    return mu, weights, h


@pytest.mark.parametrize("albedo", [0.5, 0.9])
def test_half_space_absorbs_what_the_h_function_says(albedo):
    """Of diffuse light, 2 sqrt(1 - a) times the first moment of H is absorbed: exact, where diffusion is not."""
    mu, weights, h = h_function(albedo)
    assert weights @ h == pytest.approx(2 * (1 - np.sqrt(1 - albedo)) / albedo, rel=1e-6)
    exact = 2 * np.sqrt(1 - albedo) * (weights @ (mu * h))
    optics = Optics((800,), [(1 - albedo) * 1000], [albedo * 1000])
    absorbed = [lit(slab(80, 4e-4), optics, seed=s, n_photons=50_000, **MATCHED)[2]["absorbed"][0] for s in range(6)]
    assert abs(np.mean(absorbed) - exact) < 4 * np.std(absorbed, ddof=1) / np.sqrt(6)
    assert np.std(absorbed) < 2e-3


def slab_solution(n, step, albedo):
    """Phi in a slab under Lambert's light from both sides: Milne's integral equation, by Galerkin on its pixels.

    Phi = (E2(t) + E2(T - t)) / 2 + albedo / 2 int E1(|t - t'|) Phi(t') dt', in free paths; E3'' = E1, E3' = -E2.
    """
    apart = abs(np.subtract.outer(np.arange(n), np.arange(n))) * step
    kernel = expn(3, abs(apart - step)) - 2 * expn(3, apart) + expn(3, apart + step)
    np.fill_diagonal(kernel, 2 * step - 1 + 2 * expn(3, step))
    direct = -np.diff(expn(3, np.arange(n + 1) * step)) / (2 * step)
    return np.linalg.solve(np.eye(n) - albedo / (2 * step) * kernel, direct + direct[::-1])


@pytest.mark.parametrize("albedo", [0.5, 0.9, 0.99])
def test_slab_is_the_solution_of_the_integral_equation(albedo):
    """From the wall to the middle of a slab of six free paths, Phi is that of radiative transfer, within its error."""
    n, step = 60, 0.1
    exact, coarser = (slab_solution(n * m, step / m, albedo).reshape(n, m).mean(axis=1) for m in (8, 4))
    assert exact == pytest.approx(coarser, rel=2e-4)
    optics = Optics((800,), [(1 - albedo) * 1000], [albedo * 1000])
    runs = [lit(slab(n, step * 1e-3), optics, n_photons=60_000, seed=seed, **MATCHED)[0] for seed in range(16)]
    error = np.std(runs, axis=0, ddof=1) / 4
    away = np.mean(runs, axis=0) - exact
    assert abs(away / exact).max() < 0.01
    assert abs(away / error).max() < 4.5
    assert np.mean((away / error) ** 2) < 2.5


def test_deep_light_decays_by_the_root_of_the_transport_equation():
    """Deep in a slab of albedo 0.9 the decay k solves a / (2 k) ln((1 + k) / (1 - k)) = 1: 0.525, not 0.548."""
    root = brentq(lambda k: 0.45 / k * np.log((1 + k) / (1 - k)) - 1, 0.1, 0.99)
    assert root == pytest.approx(0.5254, abs=1e-4)
    n, h = 150, 2e-4
    found, _, _ = lit(slab(n, h), Optics((800,), [100.0], [900.0]), n_photons=200_000, **MATCHED)
    free_paths = (np.arange(n) + 0.5) * h * 1000
    halved = (found + found[::-1])[: n // 2] / 2
    deep = (free_paths[: n // 2] > 5) & (free_paths[: n // 2] < 11)
    slope = -np.polyfit(free_paths[: n // 2][deep], np.log(halved[deep]), 1)[0]
    assert slope == pytest.approx(root, rel=0.015)


@pytest.mark.parametrize("extra", [{}, {"band_width": 8.0}], ids=["plane", "band"])
def test_diffusion_agrees_deep_in_tissue(extra):
    """More than two free paths under the wall of a disc of tissue, diffusion and transport differ by under 1.5 %."""
    boundary, edges = disc(), np.array([2, 3, 4.5, 6, 8, 9.5])
    photons = MonteCarlo(n_photons=400_000, **extra).fluence(boundary, TISSUE).values[0]
    diffusion = DiffusionFvm(**extra).fluence(boundary, TISSUE).values[0]
    assert by_depth(photons, boundary, edges) == pytest.approx(by_depth(diffusion, boundary, edges), rel=0.015)


def test_diffusion_agrees_in_a_patchy_body_of_any_outline():
    """In a star whose coefficients vary by place, both models agree to 3 % in the mean over the deep pixels."""
    boundary = star()
    optics = patchy(boundary.values[0].shape, 20.0, 1500.0)
    photons = MonteCarlo(n_photons=400_000).fluence(boundary, optics).values[0]
    diffusion = DiffusionFvm().fluence(boundary, optics).values[0]
    deep = boundary.values[0] < -1.5e-3
    assert np.median(abs(photons / diffusion - 1)[deep]) < 0.03
    assert np.mean((photons / diffusion)[deep]) == pytest.approx(1, abs=0.015)


def test_collimated_light_agrees_with_the_buried_source_deep_in_tissue():
    """Four free paths and more under the wall, light along the normals is the source at 1 / mu_s', to 4 %."""
    boundary, edges = disc(), np.array([3.5, 5, 7, 9])
    photons = MonteCarlo(n_photons=300_000, illumination="collimated").fluence(boundary, TISSUE).values[0]
    diffusion = DiffusionFvm(illumination="collimated").fluence(boundary, TISSUE).values[0]
    assert by_depth(photons, boundary, edges) == pytest.approx(by_depth(diffusion, boundary, edges), rel=0.04)


def test_scattering_forward_is_similar_to_scattering_anywhere():
    """With anisotropy 0.8 and the same mu_s', the light deep in tissue is that of isotropic scattering, to 2 %."""
    boundary, edges = disc(60), np.array([2, 4, 6, 9])
    one, two = (MonteCarlo(n_photons=200_000, anisotropy=g).fluence(boundary, TISSUE).values[0] for g in (0.0, 0.8))
    assert by_depth(two, boundary, edges) == pytest.approx(by_depth(one, boundary, edges), rel=0.02)


def test_no_light_is_lost():
    """Absorbed, escaped and changed by the roulette sum to what came in, to 1e-12, in a patchy star and a dark one."""
    boundary = star()
    for absorption in (20.0, 2000.0):
        _, _, told = lit(boundary, patchy(boundary.values[0].shape, absorption, 1200.0), band_width=6.0)
        assert told["energy_balance"][0] < 1e-12


def test_image_holds_what_is_absorbed():
    """Summed from the image, mu_a Phi is the share of the light that was absorbed, to 1e-12."""
    boundary = slab(60, 2e-4)
    found, _, told = lit(boundary, Optics((800,), [100.0], [1000.0]))
    r_phi, _ = reflected_shares(1.4, 1.33)
    came_in = 2 * (1 - r_phi) / 4
    assert 100.0 * found.sum() * 2e-4 / came_in == pytest.approx(told["absorbed"][0], rel=1e-12)


def test_spread_between_seeds_is_the_error_that_is_claimed():
    """The variance of a pixel over independent seeds is the square of its claimed standard error, on average."""
    boundary = disc(40)
    runs = [lit(boundary, TISSUE, seed=seed, n_photons=10_000)[:2] for seed in range(16)]
    values, errors = (np.array(part) for part in zip(*runs, strict=True))
    assert values.var(axis=0, ddof=1).mean() == pytest.approx((errors**2).mean(), rel=0.1)


def test_four_times_the_photons_halve_the_error():
    """The variance falls with the number of photons."""
    boundary = disc(40)
    few, many = (np.mean(lit(boundary, TISSUE, n_photons=n)[1] ** 2) for n in (20_000, 80_000))
    assert few / many == pytest.approx(4, rel=0.15)


def test_number_of_threads_does_not_show(monkeypatch):
    """One thread and three give the same bits; another seed gives others."""
    boundary = disc(40)
    found = []
    for threads, seed in (("1", 5), ("3", 5), ("3", 6)):
        monkeypatch.setenv("OATKIT_THREADS", threads)
        found.append(lit(boundary, TISSUE, n_photons=5_003, seed=seed)[0])
    assert (found[0] == found[1]).all()
    assert (found[0] != found[2]).any()


def test_wavelengths_of_one_scattering_share_their_paths():
    """Weighted on one set of paths, each wavelength is what it is alone, to rounding: here no photon gets faint."""
    boundary = disc(40)
    together = MonteCarlo(n_photons=5_000).fluence(boundary, Optics((700, 750, 800), [0.5, 3, 1], [900, 700, 900]))
    alone = [
        MonteCarlo(n_photons=5_000).fluence(boundary, Optics((w,), [a], [s])).values[0]
        for w, a, s in ((700, 0.5, 900), (750, 3, 700), (800, 1, 900))
    ]
    assert together.values == pytest.approx(np.array(alone), rel=1e-12)
    assert (together.values[0] >= together.values[2]).all()


def test_wide_band_is_the_plane():
    """A band of a metre gives what light all along the body gives; a narrow one gives less."""
    boundary = disc(40)
    wide, narrow, plane = (lit(boundary, TISSUE, n_photons=5_000, band_width=w)[0] for w in (1000.0, 6.0, None))
    assert wide == pytest.approx(plane, rel=1e-12)
    assert (narrow <= plane).all()
    assert narrow.mean() < 0.9 * plane.mean()


def test_body_cut_off_by_the_grid_is_mirrored():
    """Half a disc at the edge of the grid is lit as the half of the whole disc, and a note says what was done."""
    grid = Grid((50, 100), 0.24e-3, (6e-3, 0.0))
    half = Image(np.hypot(grid.y_m[:, None], grid.x_m) - RADIUS, "boundary", "m", grid)
    whole = disc(centre=(0.0, 0.0))
    one, two = (MonteCarlo(n_photons=200_000).fluence(b, TISSUE) for b in (half, whole))
    edges = np.array([0.3, 2, 4, 6, 9])
    assert by_depth(one.values[0], half, edges) == pytest.approx(by_depth(two.values[0], whole, edges), rel=0.02)
    assert any("mirrored" in note for note in one.diagnostics["notes"])


def test_couplant_shows_the_light_that_it_leaves():
    """Outside of the body the image is exp(-mu_a way), the way from the ring straight to the centre."""
    boundary = disc(40)
    model = MonteCarlo(n_photons=1_000, ring_radius=20.0, couplant_absorption=(0.1, 0.3))
    image = model.fluence(boundary, Optics((700, 800), [20.0, 20.0], [1200.0, 1200.0]))
    r = np.hypot(boundary.grid.y_m[:, None], boundary.grid.x_m)
    outside = boundary.values[0] >= 0
    for plane, mu in zip(image.values, (10.0, 30.0), strict=True):
        assert plane[outside] == pytest.approx(np.exp(-mu * np.maximum(20e-3 - r, 0))[outside], rel=1e-12)
    assert np.isfinite(image.values).all()
    assert (image.values[0] >= image.values[1]).all()


def test_noise_is_said():
    """A note gives the median relative error over the body, which is that of the error map."""
    boundary = disc(40)
    found, error, told = lit(boundary, TISSUE)
    median = np.median(error / found)
    assert told["relative_error_median"][0] == pytest.approx(median)
    assert f"{median:.2%}" in told["notes"][0]


def test_pixels_that_no_photon_reaches_are_told():
    """Deep in a black body the fluence is 0, finite, and a note says that it is not known."""
    found, _, told = lit(disc(40), Optics((800,), [20_000.0], [1000.0]), n_photons=1_000)
    assert (found >= 0).all()
    assert (found == 0).any()
    assert any("not known" in note for note in told["notes"])


@pytest.mark.parametrize(
    ("parameters", "optics", "words"),
    [
        ({"couplant_absorption": (1.0, 2.0), "ring_radius": 20.0}, TISSUE, "couplant_absorption: expected one number"),
        ({}, Optics((800,), np.ones((1, 3, 3)), [1200.0]), "optics.absorption_per_m: expected images of shape"),
        ({"n_photons": 10**10}, TISSUE, "take fewer photons"),
    ],
)
def test_what_does_not_fit_is_refused(parameters, optics, words):
    """Numbers for other wavelengths, images of another shape and work without end are refused in a sentence."""
    with pytest.raises(ValidationError, match=words):
        MonteCarlo(**parameters).fluence(disc(40), optics)


def test_boundary_without_body_is_refused():
    """Where no pixel is inside there is nothing to light, and an image in another unit is no boundary."""
    grid = Grid((4, 4), 1e-3)
    with pytest.raises(SolverError, match="no body"):
        MonteCarlo().fluence(Image(np.ones((4, 4)), "boundary", "m", grid), TISSUE)
    with pytest.raises(ValidationError, match="signed distance in m"):
        MonteCarlo().fluence(Image(-np.ones((4, 4)), "mask", "", grid), TISSUE)


@pytest.mark.parametrize("illumination", ["diffuse", "collimated"])
def test_it_is_what_oatkit_asks_of_a_fluence_model(illumination):
    """The conformance suite finds nothing."""
    check_plugin(MonteCarlo(n_photons=30_000, illumination=illumination))
