"""Maximum entropy: the optimum, its certificate, and its independence of start, method and scale."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oatkit.api import Problem
from oatkit.builtin.regularizers.entropy import Entropy
from oatkit.builtin.solvers.maxent_newton import newton
from oatkit.builtin.solvers.maxent_nlcg import MaxEntNlcg, structural_prior
from oatkit.builtin.solvers.maxent_objective import EntropyObjective, certified, relative_entropy
from oatkit.errors import ValidationError
from small_problems import (
    PROBLEMS,
    Counting,
    blurred,
    circles,
    dense,
    minimised,
    noise_like,
    scaled,
    three_pixels,
    too_few_data,
)

TAUS = [1e2, 1.0, 1e-1, 1e-2, 1e-3, 1e-4]


def objective_of(problem, tau=1e-2, prior=0.1):
    """P of a problem at a dimensionless weight and flat prior."""
    level = problem.reference.level
    return EntropyObjective(problem, tau * problem.norm**2 * level, np.full(problem.shape, prior * level))


def run(points, objective, count):
    """The best point and relative gap after each of `count` applications of A^T A."""
    return [state for _, state in zip(range(count), certified(points, objective), strict=False)]


@pytest.mark.parametrize("method", ["newton", "paper"])
def test_three_pixels_of_the_paper(method):
    """A = 1, b = (1, 0, -1), weight 0.5 and the paper's m = 1: each pixel solves 2 (x - b) + (1 + log x) / 2 = 0."""
    solver = MaxEntNlcg(weight=0.5, prior=float(np.exp(-1)), scaling="absolute", tolerance=1e-10, method=method)
    last = solver.solve(three_pixels())
    expected = [[0.8044111805001373, 0.1794561281236487, 0.006563354704763892]]
    assert last.converged
    np.testing.assert_allclose(last.image, expected, atol=1e-7)
    assert last.objective == pytest.approx(
        last.residual_norm**2 + 0.5 * Entropy(prior=float(np.exp(-1))).value(last.image), rel=1e-12
    )


@pytest.mark.parametrize("tau", [1.0, 1e-1, 1e-2])
@pytest.mark.parametrize("name", PROBLEMS)
def test_agrees_with_an_independent_optimiser(name, tau):
    """Scipy's L-BFGS-B in log x finds no lower P, and P differs from ours by no more than 1e-9 of itself."""
    problem = PROBLEMS[name]()
    objective = objective_of(problem, tau)
    last = MaxEntNlcg(weight=tau, prior=0.1, tolerance=1e-10).solve(problem)
    matrix, entropy = dense(problem), Entropy(prior=float(objective.prior.flat[0]))

    def in_logs(z):
        x = entropy.prior * np.exp(z)
        misfit = matrix @ x - problem.data
        value = misfit @ misfit + objective.weight * entropy.value(x)
        return value, x * (2 * matrix.T @ misfit + objective.weight * z)

    z = np.zeros(problem.operator.shape[1])
    for darkest in (-4, -12, -60):  # let down in steps: a pixel that jumps into the dark never feels a gradient again
        z, lowest = minimised(in_logs, z, darkest)
    assert last.converged
    assert last.objective <= lowest * (1 + 1e-12)
    assert last.objective == pytest.approx(lowest, rel=1e-9)


@pytest.mark.parametrize("tau", TAUS)
@pytest.mark.parametrize("prior", ["structural", 1.0, 0.01])
@pytest.mark.parametrize("name", PROBLEMS)
def test_certified_from_a_cold_start(name, prior, tau):
    """Within 1000 applications every weight and prior is certified to 1e-4, by an image finite and not negative."""
    last = MaxEntNlcg(weight=tau, prior=prior, n_iterations=1000).solve(PROBLEMS[name]())
    assert last.converged, last.reason
    assert last.relative_gap <= 1e-4
    assert np.isfinite(last.image).all()
    assert last.image.min() >= 0


@pytest.mark.parametrize("make", [noise_like, too_few_data, circles])
def test_optimum_does_not_depend_on_the_start(make):
    """From the prior, a far too bright, a far too dark and a random image Newton's method ends at one image."""
    objective = objective_of(make())
    shape = objective.prior.shape
    starts = [np.zeros(shape), np.full(shape, 6.0), np.full(shape, -40.0), np.random.default_rng(0).normal(0, 4, shape)]
    ends = [run(newton(objective, start), objective, 600)[-1] for start in starts]
    for point, gap in ends:
        assert gap <= 1e-13
        np.testing.assert_allclose(point.image, ends[0][0].image, atol=1e-6 * ends[0][0].image.max())


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("tau", [1.0, 1e-2, 1e-3])
def test_certificate_is_never_below_the_true_gap(name, tau):
    """At every step the relative gap is at least (P - P*) / P, with P* from a solution to 1e-13."""
    objective = objective_of(PROBLEMS[name](), tau)
    history = run(newton(objective, np.zeros_like(objective.prior)), objective, 500)
    lowest = history[-1][0].value
    assert history[-1][1] <= 1e-12
    for point, gap in history:
        assert gap >= (point.value - lowest) / point.value - 1e-14


@given(st.integers(0, 10_000), st.floats(-2, 3), st.floats(-3, 1))
@settings(max_examples=60, deadline=None)
def test_gap_of_any_image_bounds_its_distance_from_the_optimum(seed, spread, log_tau):
    """For random images, not only those on the way, the gap is at least P - P*."""
    objective = objective_of(noise_like(), 10.0**log_tau)
    lowest = run(newton(objective, np.zeros_like(objective.prior)), objective, 60)[-1][0].value
    point = objective.at(np.random.default_rng(seed).normal(0, np.exp(spread), objective.prior.shape))
    assert point.gap >= (point.value - lowest) * (1 - 1e-10)


def test_gradient_is_the_derivative_of_the_objective():
    """Central differences of P agree with 2 A^T (A x - b) + w log(x / m)."""
    objective = objective_of(blurred())
    rng = np.random.default_rng(1)
    z = rng.standard_normal(objective.prior.shape)
    point = objective.at(z)
    for change in rng.standard_normal((3, *z.shape)):
        above, below = (objective.at(z + sign * 1e-5 * change).value for sign in (1, -1))
        slope = float((point.gradient * point.image * change).sum())
        assert (above - below) / 2e-5 == pytest.approx(slope, rel=1e-6)


def test_relative_entropy_keeps_its_digits_near_zero():
    """At log ratios from 1e-9 to 3 of both signs the divergence agrees with its series or closed form to 1e-11."""
    for u in np.concatenate([np.geomspace(1e-9, 3, 60), -np.geomspace(1e-9, 3, 60)]):
        one = np.ones((1, 1))
        found = relative_entropy(one, u * one, np.exp(-u) * one)
        terms = [(-u) ** k / np.prod(np.arange(1.0, k + 1)) for k in range(2, 40)]
        assert found == pytest.approx(np.sum(terms), rel=1e-11 if abs(u) != 1e-3 else 1e-9)


@pytest.mark.parametrize("prior", ["structural", 0.2])
@pytest.mark.parametrize(("operator", "data"), [(1e-3, 1.0), (1.0, 1e6), (40.0, 1e-9)])
def test_dimensionless_weight_and_prior_follow_the_scale(operator, data, prior):
    """A -> a A and b -> k b turn the image into k/a times itself."""
    solver = MaxEntNlcg(weight=3e-3, prior=prior, tolerance=1e-8)
    one, other = solver.solve(circles()), solver.solve(scaled(circles(), operator, data))
    np.testing.assert_allclose(other.image * operator / data, one.image, atol=1e-7 * one.image.max())
    assert one.converged
    assert other.converged


def test_absolute_and_relative_scaling_mean_the_same():
    """Tau and m / x_ref give the image of w = tau |A|^2 x_ref and m."""
    problem = circles()
    level = problem.reference.level
    relative = MaxEntNlcg(weight=0.02, prior=0.3).solve(problem)
    w = 0.02 * problem.norm**2 * level
    absolute = MaxEntNlcg(weight=w, prior=0.3 * level, scaling="absolute").solve(problem)
    np.testing.assert_allclose(absolute.image, relative.image, rtol=1e-12)
    assert relative.details["weight"] == pytest.approx(w)
    assert absolute.details["tau"] == pytest.approx(0.02)


def test_strong_weight_gives_the_prior_and_weak_weight_the_non_negative_fit():
    """At tau = 1e6 the image is m; at 1e-7 its residual is that of the non-negative least squares of scipy to 1e-3."""
    from scipy.optimize import nnls

    problem = noise_like()
    strong = MaxEntNlcg(weight=1e6, prior=0.5).solve(problem)
    np.testing.assert_allclose(strong.image, 0.5 * problem.reference.level, rtol=1e-5)
    weak = MaxEntNlcg(weight=1e-7, prior=0.5).solve(problem)
    assert weak.residual_norm == pytest.approx(nnls(dense(problem), problem.data)[1], rel=1e-3)


def test_structural_prior_is_the_blurred_base_image():
    """The prior is nowhere below 3 % of x_ref, and beyond that its sum is that of the base image's positive part."""
    reference = circles().reference
    prior = structural_prior(reference)
    assert prior.min() >= 0.03 * reference.level
    assert prior.sum() == pytest.approx(np.maximum(reference.base, 0).sum() + 0.03 * reference.level * prior.size)


@pytest.mark.parametrize("weight", [1e-12, 1e-7, 1e7, 1e12])
@pytest.mark.parametrize("prior", ["structural", 1e-8, 1e8])
def test_absurd_weights_and_priors_give_a_finite_image_and_a_reason(weight, prior):
    """Whatever the numbers, the image is finite and not negative, and a gap above the tolerance is no convergence."""
    last = MaxEntNlcg(weight=weight, prior=prior, n_iterations=60).solve(circles())
    assert np.isfinite(last.image).all()
    assert last.image.min() >= 0
    assert last.reason
    assert last.converged == (last.relative_gap <= 1e-4)


def test_overflowing_bound_is_said_to_be_uncertified():
    """After one step at a very weak weight the bound overflows: the gap is infinite and the reason says so."""
    last = MaxEntNlcg(weight=1e-6, n_iterations=1).solve(circles())
    assert last.relative_gap == np.inf
    assert not last.converged
    assert "uncertified" in last.reason


def test_prior_beyond_floats_is_refused():
    """A weight and a prior whose product overflows end in a sentence, not in NaN."""
    with pytest.raises(ValidationError, match="range of floats"):
        MaxEntNlcg(weight=1.0, prior=1e308, scaling="absolute").solve(noise_like())


def test_zero_data():
    """With a relative scale the image is zero and certified; with an absolute one it is the optimum, above zero."""
    problem = Problem(dense(noise_like()), np.zeros(60), (5, 6))
    nothing = MaxEntNlcg().solve(problem)
    assert nothing.converged
    assert not nothing.image.any()
    assert "zero" in nothing.reason
    absolute = MaxEntNlcg(weight=1.0, prior=0.3, scaling="absolute").solve(problem)
    assert absolute.converged
    assert 0 < absolute.image.min() < absolute.image.max() < 0.3


def test_paper_method_stalls_or_stops_honestly_at_weak_weights():
    """Where the paper's method has not arrived it says so, and its certificate still holds."""
    problem = circles()
    slow = MaxEntNlcg(weight=1e-3, method="paper", n_iterations=40).solve(problem)
    best = MaxEntNlcg(weight=1e-3, tolerance=1e-10).solve(problem)
    assert not slow.converged
    assert "newton" in slow.reason or "raise" in slow.reason
    assert (slow.objective - best.objective) / slow.objective <= slow.relative_gap


@pytest.mark.parametrize("name", PROBLEMS)
def test_paper_method_reaches_the_same_optimum_at_strong_weights(name):
    """Both methods end at one value of P within the sum of their certificates."""
    one, other = (MaxEntNlcg(weight=0.3, prior=0.3, method=m).solve(PROBLEMS[name]()) for m in ("newton", "paper"))
    assert one.converged
    assert other.converged
    assert one.objective == pytest.approx(other.objective, rel=2e-4)
    np.testing.assert_allclose(one.image, other.image, atol=0.05 * one.image.max())


def test_certificate_and_objective_only_improve():
    """From one iterate to the next P never rises, nor does the bound on P* fall."""
    states = [s for s in MaxEntNlcg(weight=1e-3).iterate(circles()) if s.iteration]
    values = [s.objective for s in states]
    bounds = [s.objective * (1 - s.relative_gap) for s in states]
    assert values == sorted(values, reverse=True)
    assert all(b - a >= -1e-12 * values[0] for a, b in pairwise(bounds) if np.isfinite(a))


def test_products_of_the_paper_method():
    """The number of products is that of the calls of the operator and of its adjoint, give or take one."""
    operator = Counting(circles())
    last = MaxEntNlcg(weight=0.1, method="paper").solve(Problem(operator, circles().data, circles().shape))
    assert abs(operator.adjoints - last.products) <= 1
    assert abs(operator.forwards - last.products) <= 1


@pytest.mark.slow
def test_real_mouse_is_certified(mouse_scan):
    """The real frame by the preset: finite, not negative, certified to 1e-4 within 60 applications after the scale."""
    import oatkit

    image = oatkit.run(oatkit.Pipeline.load("maxent"), oatkit.read(mouse_scan), frame=0)["initial_pressure"]
    assert np.isfinite(image.values).all()
    assert image.values.min() >= 0
    assert image.diagnostics["relative_gap"][0] <= 1e-4
    assert image.diagnostics["iteration"][0] <= 60


@pytest.mark.parametrize("prior", [1e3, 1e6])
def test_a_large_prior_does_not_hide_the_gap(prior):
    """However large a constant the prior adds to P, what is called converged is the optimum of a far stricter run."""
    rng = np.random.default_rng(0)
    matrix = rng.random((20, 12))
    problem = Problem(matrix, matrix @ rng.random(12), (3, 4))
    loose, strict = (
        MaxEntNlcg(weight=1.0, prior=prior, scaling="absolute", tolerance=t, n_iterations=20_000).solve(problem)
        for t in (1e-4, 1e-9)
    )
    assert loose.converged
    assert strict.converged
    assert np.linalg.norm(loose.image - strict.image) <= 0.04 * np.linalg.norm(strict.image)
