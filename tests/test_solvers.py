"""What each of our solvers keeps to, and the least-squares solvers against direct and independent solutions."""

import copy
import pickle
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse.linalg

from oatkit.api import Detectors, Geometry, Grid, Problem
from oatkit.builtin.forward.arc import Arc
from oatkit.builtin.regularizers.identity import Identity
from oatkit.builtin.regularizers.laplacian import Laplacian
from oatkit.builtin.solvers.backprojection import Backprojection
from oatkit.builtin.solvers.lsqr import Lsqr
from oatkit.builtin.solvers.lsqr_threshold import LsqrThreshold
from oatkit.builtin.solvers.nnls import Nnls
from oatkit.errors import SolverError, ValidationError
from oatkit.masking import without_rows
from packages import built_in
from small_problems import PROBLEMS, Counting, blurred, circles, dense, noise_like, scaled, too_few_data

OURS = built_in("solver")
QUADRATIC = [Lsqr, LsqrThreshold, Nnls]
WEIGHTED = [cls for cls in OURS if "weight" in cls.model_fields]


def placed(problem):
    """The problem with detectors and a grid, for solvers that ask where things are."""
    angle = np.linspace(0, 5, 4)
    rows = problem.data.size
    detectors = Detectors(0.04 * np.column_stack([np.sin(angle), np.cos(angle)])[: 4 if rows % 4 == 0 else 1])
    # The record passes the grid at the detectors' distance.
    n_samples = rows // detectors.count
    geometry = Geometry(detectors, n_samples * 1e6, n_samples, 26e-6)
    return Problem(problem.operator, problem.data, problem.shape, geometry, Grid(problem.shape, 1e-4))


def named(cls):
    """What pytest calls a solver."""
    return cls.name


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("cls", OURS, ids=named)
def test_every_solver_yields_finite_images_and_an_honest_end(cls, name):
    """All images are finite, of the problem's shape and left alone afterwards; the last one alone says why it ended."""
    problem = placed(PROBLEMS[name]())
    states = list(cls().iterate(problem))
    kept = [copy.deepcopy(state.image) for state in states]
    for state, image in zip(states, kept, strict=True):
        assert state.image.shape == problem.shape
        assert np.isfinite(state.image).all()
        np.testing.assert_array_equal(state.image, image)
    assert not any(state.converged or state.reason for state in states[:-1])
    assert states[-1].reason
    misfit = dense(problem) @ states[-1].image.ravel() - problem.data
    if states[-1].details.get("pixels_set_to_zero", 0) == 0:
        assert states[-1].residual_norm == pytest.approx(np.linalg.norm(misfit), rel=1e-6)


@pytest.mark.parametrize("cls", OURS, ids=named)
def test_every_solver_is_deterministic(cls):
    """Two runs give the same image to the last bit, after pickling too."""
    problem = placed(circles())
    first = cls().solve(problem).image
    again = pickle.loads(pickle.dumps(cls())).solve(placed(circles())).image
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("cls", OURS, ids=named)
def test_every_solver_can_be_cancelled_between_products(cls):
    """No more than two applications of the operator or its adjoint, each way, lie between two iterates."""
    problem = placed(circles())
    operator = Counting(problem)
    steps = cls().iterate(Problem(operator, problem.data, problem.shape, problem.geometry, problem.grid))
    before = (0, 0)
    for _ in islice(steps, 60):
        now = (operator.forwards, operator.adjoints)
        assert max(now[0] - before[0], now[1] - before[1]) <= 2
        before = now
    steps.close()


@pytest.mark.parametrize("scaling", ["relative", "absolute"])
@pytest.mark.parametrize("make", [circles, too_few_data])
@pytest.mark.parametrize("cls", OURS, ids=named)
def test_products_count_every_application(cls, make, scaling):
    """Products are the calls of the operator and of its adjoint, the setting of the scale included, give or take one;
    with the scale known from another problem they are said to be the same.
    """
    problem = placed(make())
    operator = Counting(problem)
    solver = cls(scaling=scaling) if "scaling" in cls.model_fields else cls()
    again = Problem(operator, problem.data, problem.shape, problem.geometry, problem.grid)
    last = solver.solve(again)
    assert abs(operator.forwards - last.products) <= 1
    assert operator.adjoints == 0 or abs(operator.adjoints - last.products) <= 1
    assert solver.solve(replace(again)).products == last.products


@pytest.mark.parametrize("cls", QUADRATIC, ids=named)
def test_norm_is_sought_only_where_it_is_used(cls):
    """With an absolute weight LSQR starts after the one product that makes its preconditioner, and only `nnls`, whose
    steps need it, determines the norm.
    """
    zeros = [state for state in cls(scaling="absolute").iterate(circles()) if state.iteration == 0]
    assert (len(zeros) == 1) != (cls is Nnls)


@pytest.mark.parametrize("cls", OURS, ids=named)
def test_every_solver_gives_zero_for_zero_data(cls):
    """No signal, no image: zero, converged, and said."""
    problem = circles()
    last = cls().solve(placed(Problem(problem.operator, 0 * problem.data, problem.shape)))
    assert not last.image.any()
    assert last.converged
    assert "zero" in last.reason


@pytest.mark.parametrize("cls", OURS, ids=named)
def test_every_solver_follows_the_scale(cls):
    """With dimensionless weights A -> a A and b -> k b turn the image into k/a times itself."""
    one = cls().solve(placed(circles())).image
    other = cls().solve(placed(scaled(circles(), 50.0, 1e-3))).image
    np.testing.assert_allclose(other * 50.0 / 1e-3, one, atol=1e-5 * abs(one).max())


@pytest.mark.parametrize("scaling", ["relative", "absolute"])
@pytest.mark.parametrize("weight", [1e-299, 1e-150, 1e-12, 1e-6, 1e6, 1e12, 1e150, 1e290])
@pytest.mark.parametrize("cls", WEIGHTED, ids=named)
def test_every_solver_survives_absurd_weights(cls, weight, scaling):
    """The image stays finite, and there is a reason."""
    for problem in (circles(), too_few_data()):
        last = cls(weight=weight, scaling=scaling, n_iterations=50).solve(placed(problem))
        assert np.isfinite(last.image).all()
        assert last.reason


@pytest.mark.parametrize("scaling", ["relative", "absolute"])
@pytest.mark.parametrize("weight", [1e-305, 1e305])
@pytest.mark.parametrize("cls", WEIGHTED, ids=named)
def test_weights_without_a_place_among_floats_are_refused(cls, weight, scaling):
    """A weight that leaves no room for products is a `ValidationError` that gives the range."""
    with pytest.raises(ValidationError, match="leaves the range of 1e-300 to 1e\\+300"):
        cls(weight=weight, scaling=scaling).solve(placed(circles()))


@pytest.mark.parametrize("cls", QUADRATIC, ids=named)
def test_no_convergence_is_claimed_where_numbers_are_too_small_to_square(cls):
    """At 1e200 times the norm the optimum is a constant image of order 1; whoever has not found it does not say so."""
    last = cls(weight=1e200).solve(noise_like())
    matrix = dense(noise_like())
    flat = max(0.0, matrix.sum(axis=1) @ noise_like().data / np.sum(matrix.sum(axis=1) ** 2))
    assert flat > 0.01
    assert not last.converged or last.image == pytest.approx(flat, rel=0.05)


@pytest.mark.parametrize("cls", OURS, ids=named)
def test_faulty_operator_ends_in_a_sentence(cls):
    """An operator that returns NaN raises `SolverError`; no image with NaN comes out."""
    problem = placed(circles())
    faulty = scipy.sparse.linalg.LinearOperator(
        problem.operator.shape,
        matvec=lambda image: np.full(problem.data.size, np.nan),
        rmatvec=lambda data: np.full(problem.shape, np.nan).ravel(),
        dtype=float,
    )
    with pytest.raises(SolverError, match="not finite"):
        cls().solve(Problem(faulty, problem.data, problem.shape, problem.geometry, problem.grid))


@pytest.mark.parametrize("cls", [cls for cls in OURS if "n_iterations" in cls.model_fields], ids=named)
def test_too_few_iterations_are_no_convergence(cls):
    """After a single step the solver says that it stopped, not that it converged, and what to do."""
    last = cls(n_iterations=1).solve(placed(circles()))
    assert not last.converged
    assert "n_iterations" in last.reason


def direct(problem, regularizer, tau):
    """The minimiser of |A x - b|^2 + tau |A|^2 |L x|^2 by a dense least-squares solve, and w."""
    matrix = dense(problem)
    w = tau * np.linalg.norm(matrix, 2) ** 2
    rough = regularizer.operator(problem.shape).matmat(np.eye(matrix.shape[1]))
    stack = np.vstack([matrix, np.sqrt(w) * rough])
    padded = np.concatenate([problem.data, np.zeros(len(rough))])
    return np.linalg.lstsq(stack, padded)[0].reshape(problem.shape), stack, padded


@pytest.mark.parametrize("tau", [1e-2, 1e-4])
@pytest.mark.parametrize("regularizer", [Laplacian(), Identity()], ids=lambda r: r.name)
@pytest.mark.parametrize("make", [noise_like, too_few_data, blurred, circles])
def test_lsqr_is_the_direct_solution(make, regularizer, tau):
    """Run to a gradient of 1e-10, LSQR gives the image of a dense solve of the stack [A; sqrt(w) L]."""
    problem = make()
    expected, stack, padded = direct(problem, regularizer, tau)
    solver = Lsqr(weight=tau, regularizer=regularizer, tolerance=1e-10, n_iterations=5000)
    last = solver.solve(problem)
    assert last.converged
    np.testing.assert_allclose(last.image, expected, atol=1e-5 * abs(expected).max())
    assert last.objective == pytest.approx(np.sum((stack @ expected.ravel() - padded) ** 2), rel=1e-5)
    assert last.penalty == pytest.approx(regularizer.value(last.image), rel=1e-12)


def test_lsqr_iterates_are_those_of_scipy():
    """Step by step, and not preconditioned, the images are those of scipy's LSQR on the same stack."""
    problem = circles()
    w = 1e-2 * problem.norm**2
    rough = Laplacian().operator(problem.shape).matmat(np.eye(400))
    stack, padded = np.vstack([dense(problem), np.sqrt(w) * rough]), np.concatenate([problem.data, np.zeros(400)])
    solver = Lsqr(weight=1e-2, n_iterations=12, preconditioner="none")
    states = [s for s in solver.iterate(problem) if s.iteration]
    for state in states:
        expected = scipy.sparse.linalg.lsqr(stack, padded, atol=0, btol=0, iter_lim=state.iteration)[0]
        np.testing.assert_allclose(state.image.ravel(), expected, atol=1e-12 * abs(expected).max())


def test_absolute_weight_is_the_w_of_the_formula():
    """Scaling = "absolute" with w gives the direct solution for that very w."""
    problem = noise_like()
    matrix = dense(problem)
    expected = np.linalg.solve(matrix.T @ matrix + 3.7 * np.eye(30), matrix.T @ problem.data)
    solver = Lsqr(weight=3.7, scaling="absolute", regularizer=Identity(), tolerance=1e-13, n_iterations=500)
    np.testing.assert_allclose(solver.solve(problem).image.ravel(), expected, atol=1e-11)


@pytest.mark.parametrize("make", [noise_like, too_few_data, blurred, circles])
def test_threshold_is_the_positive_part_of_lsqr(make):
    """lsqr-threshold gives max(lsqr, 0) to the last bit, and counts the pixels that it set to zero."""
    signed, thresholded = Lsqr().solve(make()), LsqrThreshold().solve(make())
    np.testing.assert_array_equal(thresholded.image, np.maximum(signed.image, 0))
    assert thresholded.details["pixels_set_to_zero"] == (signed.image < 0).sum()
    after = np.linalg.norm(dense(make()) @ thresholded.image.ravel() - make().data)
    assert thresholded.details["residual_norm_after"] == pytest.approx(after, rel=1e-12)


@pytest.mark.parametrize("make", [noise_like, too_few_data, circles])
def test_nnls_is_the_active_set_solution(make):
    """On the stack [A; sqrt(w) L], scipy's active-set method finds the same objective to 1e-6 and the same image."""
    problem = make()
    solver = Nnls(weight=1e-2, tolerance=1e-8, n_iterations=20_000)
    last = solver.solve(problem)
    w = last.objective - last.residual_norm**2
    assert w == pytest.approx(1e-2 * problem.norm**2 * last.penalty, rel=1e-9)
    _, stack, padded = direct(problem, Laplacian(), 1e-2 * (problem.norm / np.linalg.norm(dense(problem), 2)) ** 2)
    expected, residual = scipy.optimize.nnls(stack, padded, maxiter=10_000)
    assert last.converged
    assert last.objective == pytest.approx(residual**2, rel=1e-6)
    np.testing.assert_allclose(last.image.ravel(), expected, atol=1e-4 * expected.max())
    assert last.image.min() >= 0


def test_nnls_meets_the_conditions_of_an_optimum():
    """At the end the gradient is not negative where the image is zero, and zero where it is not."""
    problem = blurred()
    last = Nnls(weight=1e-3, tolerance=1e-6, n_iterations=20_000).solve(problem)
    _, stack, padded = direct(problem, Laplacian(), 1e-3 * (problem.norm / np.linalg.norm(dense(problem), 2)) ** 2)
    gradient = stack.T @ (stack @ last.image.ravel() - padded)
    start = np.linalg.norm(stack.T @ padded)
    assert last.converged
    assert gradient[last.image.ravel() == 0].min() >= -1e-5 * start
    assert abs(gradient[last.image.ravel() > 0]).max() <= 1e-5 * start


def ring(count=128, degrees=360.0):
    """Detectors on a ring of 40 mm that record what comes from a square of 20 mm."""
    angles = np.deg2rad(degrees * np.arange(count) / count)
    detectors = Detectors(0.04 * np.column_stack([np.sin(angles), np.cos(angles)]))
    return Geometry(detectors, 40e6, 1000, 15e-6)


def seen_by(geometry, image, grid):
    """The problem whose data are the signals of an image."""
    operator = Arc().operator(geometry, grid)
    return Problem(operator, operator.matvec(image.ravel()), grid.shape, geometry, grid)


def test_backprojection_finds_a_gaussian_in_its_place():
    """On a full ring a Gaussian of 0.5 mm comes back at its place, to a pixel, and at 0.8 to 1.5 of its height."""
    grid = Grid((100, 100), 2e-4)
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    for centre in [(0.0, 0.0), (4e-3, -2e-3)]:
        image = np.exp(-((y - centre[0]) ** 2 + (x - centre[1]) ** 2) / (2 * 5e-4**2))
        found = Backprojection().solve(seen_by(ring(), image, grid)).image
        peak = np.unravel_index(found.argmax(), found.shape)
        assert np.hypot(y[peak] - centre[0], x[peak] - centre[1]) <= 3e-4
        assert 0.8 <= found.max() <= 1.5


def test_backprojection_turns_with_the_object():
    """On a ring of 64, turning the object by 90 degrees turns the image."""
    grid = Grid((64, 64), 3e-4)
    image = np.zeros(grid.shape)
    image[20:28, 35:50] = 1
    found = Backprojection().solve(seen_by(ring(64), image, grid)).image
    turned = Backprojection().solve(seen_by(ring(64), np.rot90(image), grid)).image
    np.testing.assert_allclose(turned, np.rot90(found), atol=1e-4 * abs(found).max())


@pytest.mark.parametrize("count", [1, 2, 3])
def test_backprojection_takes_degenerate_arrays(count):
    """One, two or three detectors, and several at one place, give a finite image."""
    grid = Grid((20, 20), 1e-3)
    image = np.zeros(grid.shape)
    image[8:12, 8:12] = 1
    few = ring(count)
    doubled = Geometry(Detectors(np.vstack([few.detectors.positions_m] * 2)), 40e6, 1000, 15e-6)
    for geometry in (few, doubled):
        assert np.isfinite(Backprojection().solve(seen_by(geometry, image, grid)).image).all()


def test_backprojection_leaves_out_what_is_not_valid():
    """With every second detector and a block of others invalid, the image is that of the array without them."""
    grid = Grid((40, 40), 5e-4)
    image = np.zeros(grid.shape)
    image[10:20, 15:30] = 1
    whole = seen_by(ring(), image, grid)
    valid = np.arange(128) % 2 == 0
    valid[30:50] = False
    rows = np.repeat(valid, 1000)
    masked = Problem(without_rows(whole.operator, rows), np.where(rows, whole.data, 0), grid.shape, ring(), grid, valid)
    kept = replace(ring(), detectors=Detectors(ring().detectors.positions_m[valid]))
    found, expected = (Backprojection().solve(p) for p in (masked, seen_by(kept, image, grid)))
    np.testing.assert_allclose(found.image, expected.image, atol=1e-6 * abs(expected.image).max())
    assert found.iteration == valid.sum()


def test_backprojection_without_a_valid_detector_is_zero():
    """Where no detector is valid the image is zero, and that is said."""
    problem = seen_by(ring(), np.ones((20, 20)), Grid((20, 20), 1e-3))
    none = np.zeros(128, dtype=bool)
    operator, data = without_rows(problem.operator, np.repeat(none, 1000)), 0 * problem.data
    last = Backprojection().solve(Problem(operator, data, problem.shape, problem.geometry, problem.grid, none))
    assert not last.image.any()
    assert "zero" in last.reason


def test_backprojection_leaves_out_records_that_miss_the_pixel():
    """A second ring, so far away that its records end before any sound arrives, changes nothing."""
    grid = Grid((40, 40), 5e-4)
    image = np.zeros(grid.shape)
    image[10:20, 15:30] = 1
    near = ring(64)
    both = replace(near, detectors=Detectors(np.vstack([near.detectors.positions_m, 10 * near.detectors.positions_m])))
    found, expected = (Backprojection().solve(seen_by(g, image, grid)).image for g in (both, near))
    np.testing.assert_allclose(found, expected, atol=1e-6 * abs(expected).max())


def test_backprojection_needs_to_know_where():
    """Without geometry and grid it says what is missing."""
    with pytest.raises(ValidationError, match="geometry and its grid"):
        Backprojection().solve(circles())
