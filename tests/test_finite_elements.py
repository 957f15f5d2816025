"""The light that scans are simulated with: exact solutions, an independent assembly, and the light that corrects."""

from functools import cache

import numpy as np
import pytest
import skfem
from scipy.sparse.linalg import spsolve
from skfem.helpers import dot, grad

import oatkit
from lit_bodies import A_WATER, BREAST, REFERENCE_A, disc_solution
from oatkit.data import Grid, Image, Optics
from oatkit.errors import ValidationError
from oatkit.polygons import area
from oatkit.simulate import Band, PolarMesh, diffuse_light
from oatkit.simulate.finite_elements import WALL_FACTOR, incoming, matrices
from oatkit.simulate.raster import area_average

RADIUS = 10e-3
AT = np.array([0, 2.5, 5, 7.5, 10]) * 1e-3
DISC = {
    1.0: [0.2322024260, 0.2595296956, 0.3512210217, 0.5402441156, 0.8959372605],
    REFERENCE_A: [0.2282323332, 0.2550923735, 0.3452160025, 0.5310072645, 0.8806189279],
}
"""Phi at `AT` in a disc with mu_a = 0.2 and mu_s' = 12 per cm, by A, from the Bessel functions."""


@cache
def disc_mesh(n_rings):
    """A disc of 10 mm radius."""
    return PolarMesh(lambda angle: np.full(np.shape(angle), RADIUS), n_rings)


def bean(angle):
    """An outline without any symmetry, hollow on one side, m."""
    return 8e-3 * (1 + 0.2 * np.cos(2 * angle + 0.4) + 0.1 * np.sin(3 * angle))


@cache
def bean_mesh(n_rings):
    """A body with a hollow side."""
    return PolarMesh(bean, n_rings)


def constant(mesh, value):
    """A property that is the same in every triangle."""
    return np.full(len(mesh.triangles), float(value))


def disc_light(n_rings, band=None, a=A_WATER):
    """Phi at the nodes of a disc of the breast's optics."""
    mesh = disc_mesh(n_rings)
    return diffuse_light(mesh, constant(mesh, 20), constant(mesh, 1200), band, a)


def patchy(mesh, seed=0):
    """Optics that vary from triangle to triangle by an order of magnitude."""
    rng = np.random.default_rng(seed)
    absorption, scattering = np.exp(rng.standard_normal((2, len(mesh.triangles))))
    return 20 * absorption, 1200 * scattering


def test_wall_factor_is_that_of_tissue_in_water():
    """A is that of the Fresnel integrals for 1.4 in 1.33, to all the digits that are written."""
    assert pytest.approx(A_WATER, abs=5e-10) == WALL_FACTOR


@pytest.mark.parametrize("a", DISC)
def test_a_disc_is_the_bessel_function_with_order_two(a):
    """Half the distance of the rings leaves a quarter of the error; 80 rings are right to 1.5e-4 at five radii."""
    errors = []
    for n_rings in (20, 40, 80):
        found = disc_mesh(n_rings).interpolate(disc_light(n_rings, a=a), AT * np.sin(0.3), AT * np.cos(0.3))
        errors.append(abs(found / DISC[a] - 1).max())
    assert errors[2] < 1.5e-4
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("n_terms", [8, 24, 40])
def test_a_lit_band_is_its_series_of_bessel_functions(n_terms):
    """The fluence at z = 0 is the sum of c_n I0 with mu_a + D k_n^2 for mu_a, to 5e-4 of it with 80 rings."""
    band = Band(width_m=8e-3, period_m=80e-3, n_terms=n_terms)
    found = disc_mesh(80).interpolate(disc_light(80, band), AT, 0 * AT)
    n = np.arange(1, n_terms)
    weights = np.append(0.1, 2 * np.sin(np.pi * n * 0.1) / (np.pi * n))
    weights[-1] += 1 - weights.sum()
    exact = sum(w * disc_solution(AT, A_WATER, 2 * np.pi * k / 80e-3) for k, w in enumerate(weights))
    assert found == pytest.approx(exact, rel=5e-4)


def test_terms_that_are_expanded_are_the_terms():
    """In a patchy body, 24 terms expanded in a few snapshots differ from 24 that are solved for by less than 1e-6."""
    mesh, band = bean_mesh(30), Band()
    optics = patchy(mesh)
    plane, along = matrices(mesh, *optics, WALL_FACTOR)
    source = incoming(mesh, WALL_FACTOR)
    terms = [spsolve(plane + k**2 * along, source) for k in band.wave_numbers_per_m]
    assert diffuse_light(mesh, *optics, band) == pytest.approx(band.weights @ terms, rel=1e-6)


def test_a_band_of_a_whole_period_is_the_plane():
    """Light on all of z is the solution for k = 0."""
    assert disc_light(20, Band(80e-3, 80e-3)) == pytest.approx(disc_light(20), rel=1e-10)


@skfem.BilinearForm
def diffusion_form(u, v, w):
    """D grad u . grad v + mu_a u v."""
    return w["d"] * dot(grad(u), grad(v)) + w["mu"] * u * v


@skfem.BilinearForm
def mass_form(u, v, w):
    """D u v."""
    return w["d"] * u * v


@skfem.BilinearForm
def wall_form(u, v, w):
    """What flows out through the wall."""
    return u * v / (2 * WALL_FACTOR)


@skfem.LinearForm
def light_form(v, w):
    """What comes in through the wall."""
    return v / (2 * WALL_FACTOR)


def test_matrices_are_those_of_scikit_fem():
    """Both matrices and the source, with optics that change from triangle to triangle, equal to rounding."""
    mesh = bean_mesh(12)
    absorption, scattering = patchy(mesh)
    theirs = skfem.MeshTri(np.ascontiguousarray(mesh.points_m[:, ::-1].T), np.ascontiguousarray(mesh.triangles.T))
    basis = skfem.Basis(theirs, skfem.ElementTriP1())
    wall = skfem.FacetBasis(theirs, skfem.ElementTriP1())
    const = basis.with_element(skfem.ElementTriP0())
    d, mu = (const.interpolate(values) for values in (1 / (3 * (absorption + scattering)), absorption))
    expected = (
        diffusion_form.assemble(basis, d=d, mu=mu) + wall_form.assemble(wall),
        mass_form.assemble(basis, d=d),
    )
    for ours, other in zip(matrices(mesh, absorption, scattering, WALL_FACTOR), expected, strict=True):
        assert abs(ours - other).max() < 1e-14 * abs(other).max()
    assert incoming(mesh, WALL_FACTOR) == pytest.approx(light_form.assemble(wall), rel=1e-13)


def test_light_is_conserved():
    """What comes in through the wall of a patchy body leaves or is absorbed, to 1e-12 of it."""
    mesh = bean_mesh(40)
    absorption, scattering = patchy(mesh)
    fluence = diffuse_light(mesh, absorption, scattering)
    absorbed = (absorption * mesh.areas_m2) @ fluence[mesh.triangles].mean(axis=1)
    sides = np.hypot(*(mesh.points_m[mesh.wall[:, 1]] - mesh.points_m[mesh.wall[:, 0]]).T)
    net = sides @ (1 - fluence[mesh.wall].mean(axis=1)) / (2 * WALL_FACTOR)
    assert absorbed == pytest.approx(net, abs=1e-12 * sides.sum() / (2 * WALL_FACTOR))


def test_mirrored_bodies_have_mirrored_light():
    """A body turned over, left for right or top for bottom, has the same light turned over, to rounding."""
    rng = np.random.default_rng(3)
    y, x = rng.uniform(-5e-3, 5e-3, (2, 300))

    def light(turned_y, turned_x):
        def reach(angle):
            return bean(np.arctan2(turned_y * np.sin(angle), turned_x * np.cos(angle)))

        mesh = PolarMesh(reach, 20)
        middles = mesh.points_m[mesh.triangles].mean(axis=1) * (turned_y, turned_x)
        absorption = 20 * (1 + 500 * abs(middles[:, 0] - 2 * middles[:, 1]))
        return mesh.interpolate(diffuse_light(mesh, absorption, constant(mesh, 1200)), turned_y * y, turned_x * x)

    assert light(-1, 1) == pytest.approx(light(1, 1), rel=1e-11)
    assert light(1, -1) == pytest.approx(light(1, 1), rel=1e-11)


def test_triangles_fill_the_body():
    """Their areas sum up to that of the polygon of the wall; samples lie in their triangles, in equal parts."""
    mesh = bean_mesh(25)
    assert mesh.areas_m2.sum() == pytest.approx(area(mesh.points_m[mesh.wall[:, 0]]), rel=1e-12)
    assert mesh.samples_m.mean(axis=0) == pytest.approx(mesh.points_m[mesh.triangles].mean(axis=1), abs=1e-15)
    assert len(mesh.points_m) == 3 * 25 * 26 + 1


def test_no_two_rings_are_further_apart_than_asked():
    """With a spacing of 0.4 mm, nodes of neighbouring rings in one direction are at most that far apart."""
    mesh = PolarMesh.with_spacing(bean, 0.4e-3)
    apart = bean(np.linspace(0, 2 * np.pi, 1000)) / mesh.n_rings
    assert 0.38e-3 < apart.max() <= 0.4e-3


def test_interpolation_is_exact_at_nodes_and_of_order_two_between():
    """Nodes get their own values; between them, the mean error of a smooth function falls to a quarter."""
    rng = np.random.default_rng(1)
    radius, angle = bean(angle := rng.uniform(0, 2 * np.pi, 2000)) * np.sqrt(rng.uniform(size=2000)), angle
    y, x = radius * np.sin(angle), radius * np.cos(angle)

    def smooth(y, x):
        return np.sin(300 * y) * np.exp(200 * x)

    errors = []
    for n in (20, 40, 80):
        mesh = bean_mesh(n)
        values = smooth(*mesh.points_m.T)
        assert mesh.interpolate(values, *mesh.points_m.T) == pytest.approx(values, abs=1e-12)
        errors.append(np.linalg.norm(mesh.interpolate(values, y, x) - smooth(y, x)))
    assert np.log2(np.divide(errors[:-1], errors[1:])).min() > 1.8


def test_beyond_the_outline_is_the_light_of_the_wall():
    """A point outside has the value of the wall in its direction."""
    mesh = bean_mesh(20)
    angle = np.linspace(0, 6, 50)
    at_wall, outside = (
        mesh.interpolate(mesh.points_m[:, 0], r * np.sin(angle), r * np.cos(angle)) for r in (bean(angle), 20e-3)
    )
    assert outside == pytest.approx(at_wall, abs=1e-12)


def test_light_that_corrects_agrees_where_a_disc_has_a_dark_part():
    """Finite volumes on cut pixels and these triangles differ by less than 1e-3, and half as much when refined."""
    model = oatkit.plugin("fluence_model", "diffusion-fvm")()

    def mu_a(y, x):
        return np.where(np.hypot(y - 2e-3, x + 3e-3) <= 1.5e-3, 150.0, 20.0)

    differences = []
    for pixel, n_rings in ((0.2e-3, 50), (0.1e-3, 100)):
        grid = Grid((int(22e-3 / pixel),) * 2, pixel)
        y, x = grid.y_m[:, None], grid.x_m[None, :]
        distance = np.hypot(y, x) - RADIUS
        optics = Optics((800,), area_average(mu_a, grid)[None], BREAST.reduced_scattering_per_m)
        theirs = model.fluence(Image(distance, "boundary", "m", grid), optics).values[0]
        mesh = disc_mesh(n_rings)
        absorption = mu_a(*np.moveaxis(mesh.samples_m, 2, 0)).mean(axis=0)
        ours = mesh.interpolate(diffuse_light(mesh, absorption, constant(mesh, 1200)), y, x)
        inside = distance < 0
        differences.append(np.sqrt(np.mean((ours / theirs - 1)[inside] ** 2)))
    assert differences[0] < 1e-3
    assert differences[1] < differences[0] / 2


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: PolarMesh(lambda a: 1e-2 * (1.05 + np.cos(300 * a)), 60), "jagged"),
        (lambda: PolarMesh.with_spacing(bean, 0.1), "0.1 mm is 1e-4"),
        (lambda: PolarMesh.with_spacing(bean, np.nan), "spacing_m"),
        (lambda: Band(width_m=90e-3), "a period is the limit"),
        (lambda: Band(n_terms=1), "n_terms"),
        (lambda: diffuse_light(disc_mesh(4), constant(disc_mesh(4), 0), constant(disc_mesh(4), 0)), "both 0"),
        (lambda: diffuse_light(disc_mesh(4), constant(disc_mesh(4), np.nan), constant(disc_mesh(4), 1)), "1/m"),
        (lambda: diffuse_light(disc_mesh(4), np.array([20.0]), np.array([1200.0])), "each of 96 triangles"),
    ],
)
def test_what_has_no_meaning_is_refused(ask, words):
    """A torn outline, lengths in mm, a band wider than its period, optics that are none."""
    with pytest.raises(ValidationError, match=words):
        ask()
