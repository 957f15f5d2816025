"""What a problem takes and refuses, and the norm that scales it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.sparse
from scipy.sparse.linalg import LinearOperator

from oatkit.api import Detectors, Geometry, Grid, Problem
from oatkit.builtin.solvers.lsqr import Lsqr
from oatkit.builtin.solvers.maxent_nlcg import MaxEntNlcg
from oatkit.errors import SolverError, ValidationError
from oatkit.laplacian import laplacian
from oatkit.masking import without_rows
from oatkit.scale import returned, spectral_norm
from small_problems import PROBLEMS, Counting, circles, dense, noise_like


class Plain:
    """An operator that knows no more than it must."""

    def __init__(self, matrix):
        self.matrix, self.shape = matrix, matrix.shape

    def matvec(self, image):
        return self.matrix @ image

    def rmatvec(self, data):
        return self.matrix.T @ data


class Slotted:
    """One that takes no weak reference."""

    __slots__ = ("matrix", "shape")
    __init__, matvec, rmatvec = Plain.__init__, Plain.matvec, Plain.rmatvec


@dataclass
class Unhashable:
    """One with value equality, which has no hash."""

    matrix: np.ndarray
    matvec, rmatvec = Plain.matvec, Plain.rmatvec

    @property
    def shape(self):
        return self.matrix.shape


class AllEqual(Plain):
    """One that claims to equal every other."""

    def __eq__(self, other):
        return True

    def __hash__(self):
        return 0


class OnlyForward:
    """One whose adjoint scipy cannot know."""

    def __init__(self, matrix):
        self.matrix, self.shape, self.dtype = matrix, matrix.shape, matrix.dtype

    def matvec(self, image):
        return self.matrix @ image


KINDS = [Plain, Slotted, Unhashable, AllEqual, np.asarray, scipy.sparse.csr_array, scipy.sparse.coo_matrix]


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("solver", [Lsqr(), MaxEntNlcg()], ids=lambda solver: solver.name)
def test_every_kind_of_operator_is_taken(solver, kind, masked):
    """Whatever object holds the matrix, the image is the same, with some rows masked out, too."""
    matrix, problem = dense(noise_like()), noise_like()
    rows = np.arange(60) % 7 != 3 if masked else np.ones(60, dtype=bool)
    expected = solver.solve(Problem(matrix * rows[:, None], problem.data * rows, problem.shape)).image
    operator = without_rows(Problem(kind(matrix), problem.data, problem.shape).operator, rows)
    found = solver.solve(Problem(operator, problem.data * rows, problem.shape)).image
    np.testing.assert_allclose(found, expected, atol=1e-8 * abs(expected).max())


@pytest.mark.parametrize("kind", [Plain, Slotted, Unhashable, AllEqual], ids=lambda kind: kind.__name__)
def test_operators_do_not_share_a_norm(kind):
    """A second operator has its own norm, be it equal to the first or at the place in memory where the first was."""
    for factor in (1.0, 2.0, 3.0):
        problem = Problem(kind(factor * np.eye(3)), np.ones(3), (1, 3))
        assert problem.norm == pytest.approx(factor, rel=1e-12)


def test_norm_is_sought_once_for_each_operator():
    """Two problems of one operator pay for its norm once."""
    operator = Counting(circles())
    first = Problem(operator, circles().data, circles().shape)
    paid = first.norm, operator.forwards
    second = replace(first, data=2 * first.data)
    assert (second.norm, operator.forwards) == paid
    assert second.norm_products == first.norm_products == paid[1]


@pytest.mark.parametrize("n", [20, 50, 100, 200])
def test_norm_of_the_laplacian(n):
    """The spectral norm of the Laplacian, 4 (1 + cos(pi / n)), is never exceeded and missed by less than 2e-3."""

    def apply(image):
        return laplacian(image.reshape(n, n)).ravel()

    found, _ = returned(spectral_norm(apply, apply, (n * n, n * n)))
    exact = 4 * (1 + np.cos(np.pi / n))
    assert exact * (1 - 2e-3) <= found <= exact * (1 + 1e-12)


@pytest.mark.parametrize("name", PROBLEMS)
def test_norm_of_small_problems(name):
    """The spectral norm is that of a dense decomposition, from below, to 5e-6."""
    problem = PROBLEMS[name]()
    exact = np.linalg.norm(dense(problem), 2)
    assert exact * (1 - 5e-6) <= problem.norm <= exact * (1 + 1e-12)


GEOMETRY = Geometry(Detectors([[0.04, 0.0], [0.0, 0.04]]), 40e6, 3)

BAD = {
    "complex data": ({"data": np.ones(6) * 1j}, "expected one or more real numbers as data, got 6 of complex128"),
    "text": ({"data": ["a"] * 6}, "expected one or more real numbers as data, got 6 of <U1"),
    "no data": ({"data": []}, "expected one or more real numbers as data, got 0 of float64"),
    "too few data": ({"data": np.ones(5)}, r"operator of shape \(6, 4\) does not map an image of .* to 5 data"),
    "NaN": ({"data": [1, 2, 3, 4, 5, np.nan]}, "1 of 6 data are not finite"),
    "huge data": ({"data": [1e200] * 6}, r"the largest of the data is 1e\+200"),
    "tiny data": ({"data": [1e-200] * 6}, "the largest of the data is 1e-200"),
    "empty image": ({"shape": (0, 3)}, r"two whole numbers above 0, \(ny, nx\), got \(0, 3\)"),
    "negative shape": ({"shape": (-2, -2)}, r"got \(-2, -2\)"),
    "broken shape": ({"shape": (2.0, 2.0)}, r"got \(2.0, 2.0\)"),
    "three axes": ({"shape": (1, 2, 2)}, r"got \(1, 2, 2\)"),
    "no axis": ({"shape": 4}, "got 4"),
    "another shape": ({"shape": (3, 3)}, r"does not map an image of shape \(3, 3\)"),
    "a word as operator": ({"operator": "arc"}, "the operator is of type str; expected a matrix"),
    "a cube as operator": ({"operator": np.ones((6, 2, 2))}, "the operator is of type ndarray; expected a matrix"),
    "complex operator": ({"operator": np.ones((6, 4)) * 1j}, "the operator is complex"),
    "another geometry": ({"geometry": replace(GEOMETRY, n_samples=4)}, r"geometry of shape \(2, 4\) does not fit 6"),
    "another grid": ({"grid": Grid((4, 1), 1e-3)}, r"grid of shape \(4, 1\) does not fit an image of \(2, 2\)"),
    "valid as numbers": ({"valid": np.ones(2)}, r"one bool for each detector, shape \(2,\), got float64"),
    "too many valid": ({"valid": np.ones(3, dtype=bool)}, r"shape \(2,\), got bool of shape \(3,\)"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_problems_get_a_sentence(case):
    """What is no problem is a `ValidationError` that says what was found and what was expected."""
    changes, message = BAD[case]
    good = {"operator": np.ones((6, 4)), "data": np.ones(6), "shape": (2, 2), "geometry": GEOMETRY}
    assert Problem(**good).data.size == 6
    with pytest.raises(ValidationError, match=message) as caught:
        Problem(**{**good, **changes})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("operator", "message"),
    [
        (OnlyForward(np.eye(4)), "no adjoint; expected a method rmatvec"),
        (LinearOperator((4, 4), matvec=lambda x: x, dtype=float), "no adjoint; expected a method rmatvec"),
        (Plain(np.diag([1, np.inf, 1, 1])), "of 4 values of its product are not finite"),
        (Plain(np.diag([1, 1e200, 1, 1])), r"1 of 4 values of its product are not finite or beyond 1e\+150"),
        (Plain(1j * np.eye(4)), "its product is 4 of complex128; expected 4 real numbers"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_faulty_operators_get_a_sentence(operator, message):
    """What an operator may not do is a `SolverError` as soon as it does it."""
    with pytest.raises(SolverError, match=message):
        Lsqr().solve(Problem(operator, np.ones(4), (2, 2)))


def test_product_of_the_wrong_size_gets_a_sentence():
    """A product that does not have the promised length is a `SolverError`."""
    operator = Plain(np.eye(4))
    operator.matrix = np.ones((5, 4))
    with pytest.raises(SolverError, match="its product is 5 of float64; expected 4 real numbers"):
        Problem(operator, np.ones(4), (2, 2)).forward(np.ones(4))
