"""Sirt keeps its promises."""

import numpy as np

from oatkit.api import Problem
from oatkit.testing import check_plugin
from oatkit_sirt.plugin import Sirt


def test_it_keeps_what_a_user_relies_on():
    """The conformance suite of oatkit finds nothing wrong."""
    check_plugin(Sirt)


def test_scaling_a_row_changes_nothing():
    """A detector a hundred times as loud gives the same image: each row counts by its direction alone.

    Rows that touch one pixel have norms that signs tell exactly, so that this holds to rounding.
    """
    matrix = np.concatenate([np.eye(4), np.diag([2.0, 1.0, 0.5, 3.0])])
    data = matrix @ np.array([1.0, 2.0, 0.0, 4.0]) + np.array([0.3, -0.1, -0.5, 0.2, 0, 0, 0.2, 0])
    loud = np.array([1, 1, 1, 5, 1, 1, 1, 2.0])
    one, other = (
        Sirt(tolerance=1e-9).solve(Problem(scale[:, None] * matrix, scale * data, (2, 2)))
        for scale in (np.ones(8), loud)
    )
    np.testing.assert_allclose(other.image, one.image, rtol=1e-6, atol=1e-9)


def test_it_finds_the_weighted_least_squares_image():
    """Of pixels that are each seen twice it takes the mean of what the two rows say, and zero for a negative mean."""
    matrix = np.concatenate([np.eye(3), 2 * np.eye(3)])
    found = Sirt(tolerance=1e-9).solve(Problem(matrix, np.array([1.0, 2.0, -3.0, 6.0, 4.0, 2.0]), (1, 3)))
    np.testing.assert_allclose(found.image, [[2.0, 2.0, 0.0]], atol=1e-8)
    assert found.converged
