"""The convolution that stands in for A^T A, the descent on it, and images that solvers begin near."""

from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest
from scipy.sparse.linalg import LinearOperator

from oatkit import ValidationError, plugin
from oatkit.api import Problem
from oatkit.builtin.regularizers.laplacian import Laplacian
from oatkit.builtin.solvers.projected_gradient import projected_gradient
from oatkit.builtin.solvers.quadratic_objective import QuadraticObjective
from oatkit.builtin.solvers.quasi_newton import quasi_newton
from oatkit.builtin.solvers.stand_in import Model, StandIn
from oatkit.weights import choose, with_weight
from small_problems import Counting, circles, noise_like, scanned

SHAPE = (24, 20)
RNG = np.random.default_rng(4)


def convolution(width=1.2):
    """A circular Gaussian blur, and data of a few bright pixels."""
    y, x = (np.minimum(np.arange(n), n - np.arange(n)) for n in SHAPE)
    spectrum = np.fft.rfft2(np.exp(-(y[:, None] ** 2 + x**2) / (2 * width**2)))

    def apply(image):
        return np.fft.irfft2(np.fft.rfft2(image.reshape(SHAPE)) * spectrum, s=SHAPE).ravel()

    n = SHAPE[0] * SHAPE[1]
    operator = LinearOperator((n, n), matvec=apply, rmatvec=apply, dtype=float)
    return Problem(operator, apply(np.random.default_rng(5).exponential(size=n) ** 3), SHAPE)


@pytest.fixture(name="scanned", scope="module")
def scanned_once():
    """A scan's problem on 64 x 64 pixels."""
    return scanned()


def normal(problem, image):
    """A^T A x."""
    return problem.adjoint(problem.forward(image))


def test_a_wide_convolution_is_found_by_one_product():
    """Where A is a convolution whose gains change slowly, the stand-in is A^T A to the smoothing of its gains."""
    problem = convolution(width=0.35)
    x = RNG.standard_normal(SHAPE)
    exact = normal(problem, x)
    assert np.linalg.norm(StandIn.of(problem).apply(x) - exact) < 0.05 * np.linalg.norm(exact)


def test_what_was_learnt_last_holds_exactly(scanned):
    """After it has learnt s -> y the stand-in maps s to y; it stays symmetric and positive."""
    stand_in = StandIn.of(scanned)
    for _ in range(4):
        step = RNG.standard_normal(scanned.shape)
        stand_in.learn(step, normal(scanned, step))
        np.testing.assert_allclose(
            stand_in.apply(step), normal(scanned, step), atol=1e-9 * abs(step).max() * scanned.norm**2
        )
    u, v = RNG.standard_normal((2, *scanned.shape))
    assert np.vdot(u, stand_in.apply(v)) == pytest.approx(np.vdot(stand_in.apply(u), v), rel=1e-9)
    assert np.vdot(u, stand_in.apply(u)) > 0


def test_a_model_has_the_slope_of_the_problem_where_it_was_made(scanned):
    """At x0 its slope is A^T (A x0 - b)."""
    x = RNG.standard_normal(scanned.shape)
    slope = scanned.adjoint(scanned.forward(x) - scanned.data)
    model = Model.at(StandIn.of(scanned), x, slope)
    np.testing.assert_allclose(model.adjoint(model.forward(x) - model.data), slope, atol=1e-9 * abs(slope).max())


def test_the_objective_never_rises(scanned):
    """Each point of the descent lies lower than the one before, its slope is that of its image, and no stand-in on the
    way has a larger curvature than is said.
    """
    objective = QuadraticObjective.of(scanned, Laplacian(), 1e-2 * scanned.norm**2)

    ratios = []

    def minimise(model, curvature, point):
        leading = np.ones(scanned.shape)
        for _ in range(100):
            leading = model.stand_in.apply(leading / np.linalg.norm(leading))
        ratios.append(np.linalg.norm(leading) / curvature)
        start = replace(objective, problem=model, curvature=curvature).at(point.image)
        return next(islice(projected_gradient(start), 40, None)).image

    points = list(islice(quasi_newton(objective.at(np.zeros(scanned.shape)), minimise), 8))
    values = [p.value for p in points]
    assert len(values) == 8
    assert max(ratios) < 1, ratios
    assert all(b < a for a, b in pairwise(values))
    true = objective.at(points[-1].image)
    np.testing.assert_allclose(points[-1].slope, true.slope, atol=1e-5 * abs(true.slope).max())


@pytest.mark.parametrize("make", [circles, noise_like, convolution])
def test_the_optimum_is_that_of_plain_projected_gradients(make):
    """Whether the operator is nearly shift-invariant or not, `nnls` ends where FISTA alone ends."""
    problem = make()
    solver = plugin("solver", "nnls")(weight=1e-2, tolerance=1e-8, n_iterations=5000)
    objective = QuadraticObjective.of(problem, Laplacian(), 1e-2 * problem.norm**2)
    plain = next(islice(projected_gradient(objective.at(np.zeros(problem.shape))), 20000, None))
    last = solver.solve(problem)
    assert last.converged
    np.testing.assert_allclose(last.image, plain.image, atol=1e-5 * abs(plain.image).max())


def test_few_products_suffice_on_a_scan(scanned):
    """`nnls` takes less than a third of the products of FISTA to the same tolerance."""
    objective = QuadraticObjective.of(scanned, Laplacian(), 1e-2 * scanned.norm**2)
    start = objective.at(np.zeros(scanned.shape))
    goal = 1e-3 * np.linalg.norm(start.slope)
    plain = next(i for i, p in enumerate(projected_gradient(start), 1) if p.left <= goal)
    counting = Counting(scanned)
    solver = plugin("solver", "nnls")(weight=1e-2, tolerance=1e-3)
    last = solver.solve(Problem(counting, scanned.data, scanned.shape))
    assert last.converged
    assert last.products - scanned.norm_products < plain / 3


def test_maximum_entropy_begins_near_a_start(scanned):
    """From the image of nearby data it takes fewer products, and ends as near to the optimum as from afar."""
    solver = plugin("solver", "maxent-nlcg")(tolerance=1e-4)
    near = replace(scanned, data=0.9 * scanned.data)
    cold = solver.solve(near)
    warm = solver.solve(replace(near, start=solver.solve(scanned).image))
    assert warm.converged
    assert warm.products < cold.products
    assert abs(warm.objective - cold.objective) <= 1e-4 * max(warm.objective, cold.objective)


@pytest.mark.slow
def test_weights_on_one_path_take_fewer_products_than_alone(scanned):
    """A rule tries its weights from the strongest to the weakest, each begun near the one before: all images are
    certified as alone, by less than nine tenths of the products; the scale is set once.
    """
    solver = plugin("solver", "maxent-nlcg")()
    shown = []
    choose(solver, scanned, "l-curve", on_point=lambda point, last: shown.append((point.weight, last)))
    alone = [with_weight(solver, weight).solve(replace(scanned)) for weight, _ in shown]
    assert all(last.converged for _, last in shown)
    spent = scanned.settling_products
    assert {last.products - last.iteration for _, last in shown} == {spent}
    on_path, by_themselves = (sum(last.products - spent for last in lasts) for lasts in ([x for _, x in shown], alone))
    assert on_path < 0.9 * by_themselves
    for (_, near), far in zip(shown, alone, strict=True):
        assert abs(near.objective - far.objective) <= 1e-4 * max(near.objective, far.objective)


def test_a_weak_weight_is_certified_from_afar(scanned):
    """From a cold start at a weight a hundred times below the default, and with a large flat prior, the gap falls to
    1e-4 within the products that a solver takes unless told otherwise.
    """
    for prior in ("structural", 0.5):
        last = plugin("solver", "maxent-nlcg")(weight=1e-4, prior=prior).solve(scanned)
        assert last.converged, last.reason


@pytest.mark.parametrize("start", [np.zeros((3, 3)), np.full((24, 20), np.nan)])
def test_a_start_is_an_image_of_the_problem(start):
    """A start of another shape, or with NaN, is refused."""
    with pytest.raises(ValidationError, match="expected start as an image of shape"):
        replace(convolution(), start=start)


@pytest.mark.parametrize("level", [0.0, -1.0])
def test_a_useless_start_does_no_harm(scanned, level):
    """A dark or negative start is not begun with."""
    last = plugin("solver", "maxent-nlcg")().solve(replace(scanned, start=np.full(scanned.shape, level)))
    assert last.converged


def test_a_detector_that_sees_nothing_has_no_stand_in():
    """Where the pixel in the middle is not seen there is none, and the solvers do without."""
    matrix = np.eye(9)
    matrix[4, 4] = 0
    problem = Problem(matrix, np.arange(9.0), (3, 3))
    assert StandIn.of(problem) is None
    assert plugin("solver", "nnls")(weight=1e-6).solve(problem).converged
