"""Light in the body: against Bessel functions, a finite-element solver, and what diffusion must conserve."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.sparse import diags_array
from scipy.sparse.linalg import spsolve
from scipy.special import iv, kv

from lit_bodies import (
    A_WATER,
    BREAST,
    MODELS,
    MU_EFF,
    OFF_CENTRE,
    RADIUS,
    REFERENCE_A,
    D,
    body,
    disc_solution,
    patchy,
    radii,
    relative,
    solved,
    star,
)
from oatkit.builtin.fluence.band_series import band_series
from oatkit.builtin.fluence.beer_lambert import BeerLambert
from oatkit.builtin.fluence.cut_cells import CutCells
from oatkit.builtin.fluence.diffusion import Medium, diffusion_matrix, factorized, wall_conductance
from oatkit.builtin.fluence.diffusion_fvm import DiffusionFvm
from oatkit.builtin.fluence.fresnel import wall_factor
from oatkit.builtin.fluence.shifted import shifted
from oatkit.data import Optics

MATCHED = DiffusionFvm(index_couplant=1.4)


@pytest.mark.parametrize(
    ("body_index", "couplant", "printed"), [(1.4, 1.33, 1.16715841), (1.37, 1.33, 1.089333), (1.4, 1.0, 2.948500)]
)
def test_wall_factor_is_that_of_the_fresnel_integrals(body_index, couplant, printed):
    """A is (1 + R_eff) / (1 - R_eff), as adaptive quadrature over the angle in the body gives it."""

    def reflected(t):
        sine = np.sin(t) * body_index / couplant
        if sine >= 1:
            return 1.0
        c, c_t = body_index * np.cos(t), couplant * np.sqrt(1 - sine**2)
        d, d_t = couplant * np.cos(t), body_index * np.sqrt(1 - sine**2)
        return (((c - c_t) / (c + c_t)) ** 2 + ((d - d_t) / (d + d_t)) ** 2) / 2

    critical = np.arcsin(couplant / body_index)

    def average(weight):
        return sum(
            quad(lambda t: weight(t) * reflected(t), *ends, epsabs=1e-13, limit=200)[0]
            for ends in ((0, critical), (critical, np.pi / 2))
        )

    fluence = average(lambda t: 2 * np.sin(t) * np.cos(t))
    current = average(lambda t: 3 * np.sin(t) * np.cos(t) ** 2)
    effective = (fluence + current) / (2 - fluence + current)
    assert wall_factor(body_index, couplant) == pytest.approx((1 + effective) / (1 - effective), rel=1e-11)
    assert wall_factor(body_index, couplant) == pytest.approx(printed, rel=3e-6)


def test_wall_of_equal_indices_reflects_nothing():
    """A is 1 where the indices are equal, and above 1 where they differ either way."""
    assert wall_factor(1.4, 1.4) == pytest.approx(1, abs=1e-14)
    assert wall_factor(1.33, 1.4) > 1


def test_breast_attenuates_as_printed():
    """0.2 and 12 per cm give D = 0.27322404 mm and mu_eff = 0.27055499 per mm."""
    assert pytest.approx(0.27322404, abs=5e-9) == D * 1e3
    assert pytest.approx(0.27055499, abs=5e-9) == MU_EFF * 1e-3
    deep = BeerLambert().fluence(body(np.array([[-1e-3, -2e-3], [-1e-3, 1e-3]]), 1e-3), BREAST).values[0]
    assert deep[0, 1] / deep[0, 0] == pytest.approx(np.exp(-0.27055499), rel=1e-8)


TABLE = {
    1.0: [0.2322024260, 0.2595296956, 0.3512210217, 0.5402441156, 0.8959372605],
    REFERENCE_A: [0.2282323332, 0.2550923735, 0.3452160025, 0.5310072645, 0.8806189279],
}


@pytest.mark.parametrize(("model", "a"), [(MATCHED, 1.0), (DiffusionFvm(), REFERENCE_A)])
def test_disc_is_the_bessel_function(model, a):
    """In a disc Phi = I0(mu_eff r) / (I0(mu_eff R) + 2 A D mu_eff I1(mu_eff R)), to 3e-4 with pixels of 0.06 mm."""
    r = np.array([0, 2.5e-3, 5e-3, 7.5e-3, 10e-3])
    assert disc_solution(r, a) == pytest.approx(TABLE[a], abs=1e-10)
    r = radii(0.06e-3)
    assert relative(solved(r - RADIUS, 0.06e-3, model=model), disc_solution(r, a), r < RADIUS) < 3e-4


@pytest.mark.parametrize("centre", [(0, 0), OFF_CENTRE])
@pytest.mark.parametrize(("model", "a"), [(MATCHED, 1.0), (DiffusionFvm(), A_WATER)])
def test_disc_converges_with_order_above_one_and_a_half(model, a, centre):
    """Four halvings of the pixel divide the error of a disc by more than 2^6, wherever its centre lies in a pixel."""
    errors = []
    for h in (0.96e-3, 0.06e-3):
        r = radii(h, centre)
        errors.append(relative(solved(r - RADIUS, h, model=model), disc_solution(r, a), r < RADIUS))
    assert np.log2(errors[0] / errors[1]) / 4 > 1.5


def test_disc_in_strong_scattering_stays_near_where_pixels_are_coarse():
    """Pixels of 1.2 mean free paths, where centres outside may not be extrapolated freely, are right to 0.5 %."""
    optics = Optics((800,), [20.0], [5000.0])
    diffusion = 1 / (3 * 5020)
    kappa = np.sqrt(20 / diffusion)
    r = radii(0.24e-3, OFF_CENTRE)
    exact = iv(0, kappa * r) / (iv(0, kappa * RADIUS) + 2 * A_WATER * diffusion * kappa * iv(1, kappa * RADIUS))
    assert relative(solved(r - RADIUS, 0.24e-3, optics), exact, r < RADIUS) < 5e-3


def cut(distance, h):
    """The cut cells, their matrix for the breast at the reference's A, and the wall's conductances."""
    cells = CutCells.of(distance, h)
    diffusion = np.full(len(cells.cells), D)
    conductance = wall_conductance(cells, diffusion, REFERENCE_A)
    return cells, diffusion_matrix(cells, diffusion, np.full(len(cells.cells), 20.0), conductance), conductance


@pytest.mark.parametrize("margin", [0, 3], ids=["wall at the edge of the grid", "wall inside the grid"])
def test_slab_lit_from_the_left_is_the_discrete_closed_form(margin):
    """A slab between two walls on faces is a l^i + b l^(N-1-i): the printed values, to 1e-12."""
    h, n = 0.2e-3, 50
    x = (np.arange(n + 2 * margin) - (n + 2 * margin - 1) / 2) * h
    cells, matrix, conductance = cut(np.tile(abs(x) - n * h / 2, (3, 1)), h)
    left = cells.wall_normal[:, 1] < 0
    light = np.bincount(cells.wall_cell, np.where(left, conductance, 0), len(cells.cells))
    fluence = factorized(matrix)(light).reshape(3, n)
    known = {0: 0.8288979275880445, 24: 0.2168482561134431, 49: 0.019451116061757624}
    for i, value in known.items():
        assert fluence[:, i] == pytest.approx(value, rel=1e-12)
    c = 1 + 20 * h**2 / (2 * D)
    decay = c - np.sqrt(c**2 - 1)
    i = np.arange(n)
    basis = np.column_stack([decay**i, decay ** (n - 1 - i)])
    a_b = np.linalg.solve(basis[[0, -1]], fluence[1, [0, -1]])
    assert fluence[1] == pytest.approx(basis @ a_b, rel=1e-12)


def test_two_layers_converge_to_their_bessel_series():
    """A disc in a disc, their border along pixels: I0 inside, I0 and K0 outside; the order is about 1."""
    border, inner, outer = 5e-3, (60.0, 2000.0), (10.0, 800.0)
    d1, d2 = (1 / (3 * sum(pair)) for pair in (inner, outer))
    k1, k2 = np.sqrt(inner[0] / d1), np.sqrt(outer[0] / d2)
    at_wall = 2 * A_WATER * d2 * k2
    equations = [
        [iv(0, k1 * border), -iv(0, k2 * border), -kv(0, k2 * border)],
        [d1 * k1 * iv(1, k1 * border), -d2 * k2 * iv(1, k2 * border), d2 * k2 * kv(1, k2 * border)],
        [0, iv(0, k2 * RADIUS) + at_wall * iv(1, k2 * RADIUS), kv(0, k2 * RADIUS) - at_wall * kv(1, k2 * RADIUS)],
    ]
    a, b, c = np.linalg.solve(equations, [0, 0, 1])
    errors = []
    for h in (0.96e-3, 0.12e-3):
        r = np.maximum(radii(h), 1e-9)
        exact = np.where(r < border, a * iv(0, k1 * r), b * iv(0, k2 * r) + c * kv(0, k2 * r))
        optics = Optics((800,), *(np.where(r < border, p, q)[None] for p, q in zip(inner, outer, strict=True)))
        errors.append(relative(solved(r - RADIUS, h, optics), exact, r < RADIUS))
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) / 3 > 0.9


@pytest.mark.parametrize("name", MODELS)
def test_light_is_conserved(name):
    """What comes in leaves or is absorbed, to 1e-10 of it, at every wavelength in a patchy star."""
    distance = star(0.2e-3)
    image = MODELS[name].fluence(body(distance, 0.2e-3), patchy(distance.shape))
    assert len(image.diagnostics["energy_balance"]) == 2
    assert max(image.diagnostics["energy_balance"]) <= 1e-10
    assert (image.values > 0).all()


def test_flow_through_the_wall_is_what_is_absorbed():
    """Summed from the image alone, absorption in a disc is the flow -D dPhi/dn of the Bessel function, to 0.1 %."""
    h = 0.12e-3
    r = radii(h)
    fluence = solved(r - RADIUS, h)
    cells = CutCells.of(r - RADIUS, h)
    shown = np.isin(cells.cells, np.flatnonzero(r < RADIUS))
    absorbed = 20 * (cells.volume[shown] @ fluence.ravel()[cells.cells[shown]])
    rim = 20 * cells.volume[~shown].sum() * disc_solution(RADIUS, A_WATER)
    flow = (1 - disc_solution(RADIUS, A_WATER)) / (2 * A_WATER) * 2 * np.pi * RADIUS
    assert absorbed + rim == pytest.approx(flow, rel=1e-3)


def test_fluence_is_never_negative_and_never_above_the_light():
    """Under diffuse light 0 <= Phi <= max g, in a patchy star and outside of it."""
    distance = star(0.2e-3)
    values = MODELS["diffuse"].fluence(body(distance, 0.2e-3), patchy(distance.shape)).values
    assert values.min() > 0
    assert values.max() <= 1
    assert solved(distance, 0.2e-3, Optics((800,), [0.0], [1200.0])) == pytest.approx(1, rel=1e-11)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("turn", [np.rot90, np.flipud, np.fliplr, np.transpose])
def test_turning_the_body_turns_the_fluence(name, turn):
    """A quarter turn, flips and the exchange of the axes commute with the model."""
    distance, optics = star(0.4e-3), patchy((65, 65))
    distance = distance + np.linspace(0, 1e-3, 65)[:, None]
    turned = Optics(optics.wavelengths_nm, *(
        np.array([turn(plane) for plane in v]) for v in (optics.absorption_per_m, optics.reduced_scattering_per_m)
    ))  # fmt: skip
    plain = MODELS[name].fluence(body(distance, 0.4e-3), optics).values
    found = MODELS[name].fluence(body(turn(distance), 0.4e-3), turned).values
    assert found == pytest.approx(np.array([turn(plane) for plane in plain]), rel=1e-10)


def test_fluence_is_linear_in_the_light():
    """The fluence of two lights at once is the sum of both."""
    cells, matrix, conductance = cut(star(0.4e-3), 0.4e-3)
    lights = np.random.default_rng(1).uniform(size=(2, len(conductance)))
    solve = factorized(matrix)
    one, two, both = (
        solve(np.bincount(cells.wall_cell, conductance * g, len(cells.cells))) for g in (*lights, lights.sum(axis=0))
    )
    assert one + two == pytest.approx(both, rel=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_only_optical_lengths_count(name):
    """Everything twice as long and half as absorbing and scattering, the fluence is the same."""
    distance, optics = star(0.4e-3), patchy((65, 65))
    model = MODELS[name].model_copy(update={"ring_radius": None})
    half = Optics(optics.wavelengths_nm, optics.absorption_per_m / 2, optics.reduced_scattering_per_m / 2)
    twice = model.model_copy(update={k: 2 * v for k in ("band_width", "band_period") if (v := getattr(model, k))})
    plain = model.fluence(body(distance, 0.4e-3), optics).values
    assert twice.fluence(body(2 * distance, 0.8e-3), half).values == pytest.approx(plain, rel=1e-11)


def test_finite_elements_agree_on_a_star():
    """scikit-fem's solution in a five-pointed body differs by no more than both errors, as their refinement shows."""
    from skfem import Basis, BilinearForm, ElementTriP2, FacetBasis, LinearForm, MeshTri, asm
    from skfem.helpers import dot, grad

    coarse, fine = (solved(star(h, n), h) for h, n in ((0.36e-3, 65), (0.12e-3, 195)))
    fine = fine[1::3, 1::3]  # every third pixel has its centre where a coarse one has it
    distance = star(0.36e-3, 65)
    where = distance < -0.36e-3
    at = (np.arange(65) - 32) * 0.36e-3
    y, x = np.meshgrid(at, at, indexing="ij")
    found = []
    for refinements in (4, 5):
        mesh = MeshTri.init_circle(refinements)
        scale = 0.8 * RADIUS * (1 + 0.2 * np.cos(5 * np.arctan2(mesh.p[1], mesh.p[0])))
        mesh = MeshTri(mesh.p * scale, mesh.t)
        basis, wall = Basis(mesh, ElementTriP2()), FacetBasis(mesh, ElementTriP2())
        inside = BilinearForm(lambda u, v, _: D * dot(grad(u), grad(v)) + 20 * u * v)
        robin = BilinearForm(lambda u, v, _: u * v / (2 * A_WATER))
        light = LinearForm(lambda v, _: v / (2 * A_WATER))
        from scipy.sparse.linalg import spsolve

        solution = spsolve((asm(inside, basis) + asm(robin, wall)).tocsc(), asm(light, wall))
        found.append(basis.interpolator(solution)(np.array([x[where], y[where]])))
    errors = np.linalg.norm(found[1] - found[0]) + np.linalg.norm((fine - coarse)[where])
    assert np.linalg.norm(found[1] - fine[where]) < errors
    assert errors < 0.01 * np.linalg.norm(found[1])


@pytest.mark.parametrize("absorption", [0.0, 20.0, 600.0])
def test_equations_that_differ_by_a_shift_are_solved_as_if_each_were_factorized(absorption):
    """One factorization and a small basis give every term of the band that eight factorizations give, to 1e-9."""
    h = 0.4e-3
    cells = CutCells.of(radii(h) - RADIUS, h)
    medium = Medium.of(cells, Optics((700,), [absorption], [1200.0]), 0, radii(h) < RADIUS)
    conductance = wall_conductance(cells, medium.diffusion, A_WATER)
    plane = diffusion_matrix(cells, medium.diffusion, medium.absorption, conductance)
    along, source = medium.diffusion * cells.volume, np.bincount(cells.wall_cell, conductance, len(cells.cells))
    shifts = band_series(8e-3, 40e-3, 8)[0] ** 2
    found = shifted(plane, along, source, shifts, medium.slowest_decay(cells))
    for shift, term in zip(shifts, found, strict=True):
        expected = spsolve((plane + diags_array(shift * along)).tocsc(), source)
        assert term == pytest.approx(expected, rel=0, abs=1e-9 * expected.max())
