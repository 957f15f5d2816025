"""The convolution that shortens the way of LSQR."""

import numpy as np
import pytest

from oatkit.api import Problem
from oatkit.builtin.regularizers.identity import Identity
from oatkit.builtin.regularizers.laplacian import Laplacian
from oatkit.builtin.solvers.convolution import gains_of, penalty_gains
from oatkit.builtin.solvers.lsqr import Lsqr
from oatkit.builtin.solvers.preconditioner import Preconditioner
from small_problems import Counting, circles, scanned

SHAPE = (24, 20)


def test_the_gains_of_penalties_are_those_of_their_stencils():
    """Those of the identity are 1, those of the Laplacian the squares of its symbol."""
    np.testing.assert_allclose(penalty_gains(Identity(), SHAPE), 1, rtol=1e-12)
    y, x = (2 - 2 * np.cos(2 * np.pi * f) for f in (np.fft.fftfreq(SHAPE[0]), np.fft.rfftfreq(SHAPE[1])))
    np.testing.assert_allclose(penalty_gains(Laplacian(), SHAPE), (y[:, None] + x) ** 2, atol=1e-9)


def test_it_is_symmetric_and_undoes_itself():
    """M is symmetric, and M^-1 M x = x."""
    problem = circles()
    by = Preconditioner.of(problem, Laplacian(), 1e-2 * problem.norm**2)
    u, v = np.random.default_rng(0).standard_normal((2, *problem.shape))
    np.testing.assert_allclose(by.undo(by.apply(u)), u, atol=1e-10)
    assert np.vdot(u, by.apply(v)) == pytest.approx(np.vdot(by.apply(u), v), rel=1e-10)
    assert gains_of(problem).min() > 0


@pytest.mark.parametrize("coverage_deg", [90.0, 270.0])
def test_it_spares_products_and_changes_nothing_else(coverage_deg):
    """With and without, LSQR reaches one image; with, and at its own weight, in less than 0.7 of the products, all of
    which it reports.
    """
    problem = scanned(coverage_deg)
    counting = Counting(problem)
    counted = Problem(counting, problem.data, problem.shape)
    last = Lsqr().solve(counted)
    plain = Lsqr(preconditioner="none").solve(problem)
    assert last.converged
    assert plain.converged
    assert last.products == counting.forwards
    spent = problem.norm_products
    assert last.products - spent < 0.7 * (plain.products - spent)
    assert last.objective == pytest.approx(plain.objective, rel=1e-4)
    exact = Lsqr(preconditioner="none", tolerance=1e-8, n_iterations=3000).solve(problem).image
    assert np.linalg.norm(last.image - exact) <= 2 * np.linalg.norm(plain.image - exact)


def test_the_promise_is_on_the_gradient_of_the_image():
    """Where it says that the gradient fell to a part of its start, that of the image did, not that of its variables."""
    problem = circles()
    solver = Lsqr(tolerance=1e-4)
    last = solver.solve(problem)
    rows = solver.regularizer.operator(problem.shape)
    rough = rows.rmatvec(rows.matvec(last.image.ravel())).reshape(problem.shape)
    gradient = problem.adjoint(problem.forward(last.image) - problem.data) + last.details["weight"] * rough
    left = np.linalg.norm(gradient) / np.linalg.norm(problem.back_projected)
    assert left <= 1e-4
    assert f"{left:.1e}" in last.reason


def test_an_operator_that_is_no_convolution_goes_without():
    """Where pixels are seen with gains over two decades, the steps are those of plain LSQR, two products later."""
    gains = np.geomspace(1, 100, 36)
    problem = Problem(np.diag(gains), 1 / gains, (6, 6))
    common = {"weight": 1e-6, "regularizer": Identity(), "n_iterations": 10}
    steps = [s for s in Lsqr(**common).iterate(problem) if s.iteration]
    plain = [s for s in Lsqr(preconditioner="none", **common).iterate(problem) if s.iteration]
    assert [s.products - 2 for s in steps] == [s.products for s in plain]
    for one, other in zip(steps, plain, strict=True):
        np.testing.assert_array_equal(one.image, other.image)
