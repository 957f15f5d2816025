"""Solvers and penalties of other libraries, against oatkit's own and against solutions found independently."""

import sys
from importlib.metadata import entry_points

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from oatkit import plugin
from oatkit.api import Problem
from oatkit.registry import Registry
from oatkit.testing import check_plugin
from oatkit_pylops.fista import ProximalFista
from oatkit_pylops.lsqr import PylopsLsqr
from oatkit_pylops.penalties import L1, L21, Nuclear
from oatkit_pylops.split_bregman import SplitBregman

SHAPE = (7, 6)
ALL = (PylopsLsqr, SplitBregman, ProximalFista, L1, L21, L21(groups="rows"), Nuclear)


def small_problem(seed=0):
    """More data than pixels, signed and noisy, so that each objective has one minimum."""
    rng = np.random.default_rng(seed)
    n = SHAPE[0] * SHAPE[1]
    image = np.zeros(SHAPE)
    image[2:5, 1:4] = 2.0
    matrix = rng.standard_normal((2 * n, n))
    return Problem(matrix, matrix @ image.ravel() + 0.3 * rng.standard_normal(2 * n), SHAPE), matrix


def distance(found, expected):
    """|found - expected| / |expected|."""
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


@pytest.mark.parametrize(
    "one", ALL, ids=lambda one: f"{one.name}{'-rows' if getattr(one, 'groups', '') == 'rows' else ''}"
)
def test_each_keeps_what_a_user_relies_on(one):
    """The conformance suite of oatkit finds nothing wrong."""
    check_plugin(one)


def test_lsqr_is_the_solution_of_the_normal_equations_and_oatkits():
    """(A^T A + w) x = A^T b holds to 1e-9, and oatkit's `lsqr` with the penalty |x|^2 gives the same to 1e-9."""
    problem, matrix = small_problem()
    w = 7.0
    state = PylopsLsqr(weight=w, scaling="absolute", tolerance=1e-11).solve(problem)
    exact = np.linalg.solve(matrix.T @ matrix + w * np.eye(matrix.shape[1]), matrix.T @ problem.data)
    assert state.converged
    assert distance(state.image.ravel(), exact) < 1e-9
    identity = plugin("regularizer", "identity")()
    ours = plugin("solver", "lsqr")(weight=w, scaling="absolute", tolerance=1e-11, regularizer=identity).solve(problem)
    assert distance(state.image, ours.image) < 1e-9
    assert state.objective == pytest.approx(ours.objective, rel=1e-9)


def differences():
    """The matrix of forward differences along y and x."""
    (ny, nx), pixels = SHAPE, np.eye(SHAPE[0] * SHAPE[1]).reshape(-1, *SHAPE)
    along_y, along_x = np.diff(pixels, axis=1).reshape(ny * nx, -1), np.diff(pixels, axis=2).reshape(ny * nx, -1)
    return np.concatenate([along_y, along_x], axis=1).T


@pytest.mark.parametrize("w", [3.0, 40.0])
def test_split_bregman_reaches_the_optimum_of_its_dual(w):
    """The image is the exact one of the dual, a quadratic in a box, to 1e-4, and its objective to 1e-7.

    max over |u| <= w of -|R^-T D^T u / 2 - R x_ls|^2, with R^T R = A^T A; x = x_ls - (A^T A)^-1 D^T u / 2.
    """
    problem, matrix = small_problem()
    d = differences()
    r = np.linalg.cholesky(matrix.T @ matrix).T
    x_ls = np.linalg.lstsq(matrix, problem.data, rcond=None)[0]
    dual = lsq_linear(0.5 * np.linalg.solve(r.T, d.T), r @ x_ls, (-w, w), method="bvls", tol=1e-14)
    exact = x_ls - 0.5 * np.linalg.solve(matrix.T @ matrix, d.T @ dual.x)
    least = np.sum((matrix @ exact - problem.data) ** 2) + w * np.abs(d @ exact).sum()
    state = SplitBregman(weight=w, scaling="absolute", coupling=0.1, tolerance=1e-7, n_iterations=5000).solve(problem)
    assert state.converged
    assert distance(state.image.ravel(), exact) < 1e-4
    assert -1e-12 < state.objective / least - 1 < 1e-7


@pytest.mark.parametrize("name", ["l1", "tv"])
def test_fista_reaches_the_optimum_of_oatkits_own_solver(name):
    """With oatkit's penalties the objective is that of oatkit's own solver, signed, to 1e-8, and the image to 1e-4."""
    problem, _ = small_problem()
    common = {"weight": 20.0, "scaling": "absolute", "tolerance": 1e-9, "n_iterations": 5000}
    ours = plugin("solver", name)(non_negative=False, **common).solve(problem)
    theirs = ProximalFista(regularizer=plugin("regularizer", name)(), **common).solve(problem)
    assert theirs.converged
    assert distance(theirs.image, ours.image) < 1e-4
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-8)


@pytest.mark.parametrize("penalty", [L1(), L21(), L21(groups="rows"), Nuclear()], ids=lambda one: one.name)
def test_the_image_of_fista_is_a_fixed_point(penalty):
    """A step of proximal gradients, prox(x - A^T (A x - b) / |A|^2), moves it by less than 1e-7 of it."""
    problem, matrix = small_problem(1)
    w, largest = 25.0, np.linalg.norm(matrix, 2) ** 2
    state = ProximalFista(weight=w, scaling="absolute", regularizer=penalty, tolerance=1e-9, n_iterations=5000).solve(
        problem
    )
    ahead = state.image - problem.adjoint(problem.forward(state.image) - problem.data) / largest
    assert distance(penalty.prox(ahead, w / (2 * largest)), state.image) < 1e-7


def test_a_penalty_does_what_it_is_for():
    """Of an image of rank 1 with noise the nuclear norm leaves rank 1; L21 leaves whole columns, or rows, of zeros."""
    rng = np.random.default_rng(2)
    image = np.outer([0, 0, 5, 5, 0.0], [0, 6, 0, 0.0]) + 0.1 * rng.standard_normal((5, 4))
    assert np.linalg.matrix_rank(Nuclear().prox(image, 1.0)) == 1
    np.testing.assert_array_equal(L21().prox(image, 1.0).any(axis=0), [False, True, False, False])
    np.testing.assert_array_equal(L21(groups="rows").prox(image, 1.0).any(axis=1), [False, False, True, True, False])


@pytest.mark.parametrize(
    ("missing", "working"), [("pyproximal", {"pylops-lsqr", "pylops-split-bregman"}), ("pylops", set())]
)
def test_a_missing_library_is_named(missing, working, monkeypatch):
    """Without a library its plugins are listed as broken, with its name, and those of the other one work."""
    monkeypatch.setitem(sys.modules, missing, None)
    points = [point for point in entry_points(group="oatkit") if point.value.startswith("oatkit_pylops")]
    entries = Registry(points).entries
    assert {entry.name for entry in entries if entry.status == "ok"} == working
    broken = [entry for entry in entries if entry.status == "broken"]
    assert broken
    assert all(f"needs {missing}, which is not installed: pip install {missing}" in entry.problem for entry in broken)
