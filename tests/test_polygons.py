"""Polygons against formulas and against scikit-image."""

import numpy as np
import pytest

from oatkit.data import Grid
from oatkit.polygons import area, centroid, contains, crossings, resampled, signed_distance, without_loops

SQUARE = 1e-3 * np.array([(-2, -2), (-2, 4), (4, 4), (4, -2)], float)
"""Six millimetres wide, anticlockwise, its centre at (1, 1) mm."""


def circle(n=4096, radius_m=5e-3):
    """A regular polygon, anticlockwise."""
    angle = np.arange(n) * 2 * np.pi / n
    return radius_m * np.column_stack([np.sin(angle), np.cos(angle)])


def star(n=10):
    """A polygon with sharp hollows."""
    radius = np.where(np.arange(n) % 2, 2e-3, 6e-3)
    return circle(n, 1.0) * radius[:, None]


def test_the_distance_to_a_square_is_that_of_its_formula():
    """Outside corners it is the distance to the corner, elsewhere to the nearest side, to rounding."""
    grid = Grid((60, 50), 0.25e-3)
    y, x = abs(grid.y_m[:, None] - 1e-3) - 3e-3, abs(grid.x_m[None, :] - 1e-3) - 3e-3
    expected = np.hypot(np.maximum(y, 0), np.maximum(x, 0)) + np.minimum(np.maximum(y, x), 0)
    assert signed_distance(SQUARE, grid) == pytest.approx(expected, abs=1e-15)


def test_the_distance_to_a_circle_is_radial():
    """With 4096 corners it is |r| - R to within the sagitta R (pi / n)^2 / 2 of its sides."""
    grid = Grid((41, 41), 0.4e-3)
    off = signed_distance(circle(), grid) - (np.hypot(grid.y_m[:, None], grid.x_m[None, :]) - 5e-3)
    assert abs(off).max() <= 5e-3 * (np.pi / 4096) ** 2 / 2 + 1e-15


def test_the_nearest_side_is_found():
    """Around sharp hollows the distance agrees with that to a million points along the sides, to 1/16 pixel."""
    grid = Grid((40, 40), 0.4e-3)
    points = np.vstack(
        [a + np.linspace(0, 1, 2000)[:, None] * (b - a) for a, b in zip(star(), np.roll(star(), -1, 0), strict=True)]
    )
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    brute = np.min([np.hypot(y - p, x - q) for p, q in points[::5]], axis=0)
    assert abs(abs(signed_distance(star(), grid)) - brute).max() <= grid.pixel_size_m / 16


def test_inside_is_what_scikit_image_calls_inside():
    """`contains` agrees with skimage.measure.points_in_poly on a star with hollows."""
    from skimage.measure import points_in_poly

    grid = Grid((61, 47), 0.3e-3, (0.5e-3, -0.3e-3))
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    expected = points_in_poly(np.column_stack([y.ravel(), x.ravel()]), star()).reshape(grid.shape)
    assert 0 < expected.sum() < expected.size
    assert (contains(star(), grid) == expected).all()


def test_area_and_centroid_are_those_of_the_shape():
    """A square of side a has the area a^2, negative clockwise, and its centroid in the middle wherever corners lie."""
    more = np.insert(SQUARE, 1, [(-2e-3, x) for x in (-1e-3, 0, 1e-3)], axis=0)
    assert area(more) == pytest.approx(36e-6)
    assert area(more[::-1]) == pytest.approx(-36e-6)
    assert centroid(more) == pytest.approx([1e-3, 1e-3], abs=1e-15)
    assert centroid(more[::-1]) == pytest.approx([1e-3, 1e-3], abs=1e-15)


def test_resampled_points_are_evenly_spaced_on_the_polygon():
    """Their spacing along a square is the one asked for or a little less, and they lie on its sides."""
    points = resampled(SQUARE, 0.5e-3)
    assert len(points) == 48
    assert np.hypot(*(np.roll(points, -1, 0) - points).T) == pytest.approx(0.5e-3)
    assert np.isclose(abs(points - 1e-3).max(1), 3e-3, atol=1e-15).all()


def test_a_figure_of_eight_crosses_itself_once():
    """Its sides 0 and 2 cross; a convex polygon and a star have no crossing."""
    assert crossings(SQUARE[[0, 2, 1, 3]]).tolist() == [[0, 2]]
    assert len(crossings(SQUARE)) == len(crossings(star())) == len(crossings(circle(300))) == 0


def test_the_smaller_loop_is_removed():
    """A circle with a small loop outwards keeps its area to 1 % and crosses itself no more."""
    at, loop = 20, circle(12, 0.8e-3)[::-1] + circle(200)[20] * 1.3
    looped = np.insert(circle(200), at, np.roll(loop, 3, axis=0), axis=0)
    assert len(crossings(looped)) > 0
    cleaned = without_loops(looped)
    assert len(crossings(cleaned)) == 0
    assert area(cleaned) == pytest.approx(area(circle(200)), rel=0.01)
