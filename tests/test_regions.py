"""Regions of interest against formulas for areas, and against themselves turned, mirrored and drawn otherwise."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.shapes import CORNERS, EllipseRegion, MaskRegion, PolygonRegion, RectangleRegion, core, rim

GRID = Grid((61, 61), 0.2e-3)
L_SHAPE = 1e-3 * np.array([(-4, -3), (-4, 5), (-1, 5), (-1, 1), (3, 1), (3, -3)], float)
"""Of 8 x 3 and 4 x 4 mm."""


def turned(points, angle_rad):
    """Points (y, x), turned anticlockwise about the origin."""
    y, x = points.T
    return np.column_stack(
        [np.cos(angle_rad) * y + np.sin(angle_rad) * x, np.cos(angle_rad) * x - np.sin(angle_rad) * y]
    )


SHAPES = {
    "ellipse": (lambda centre: EllipseRegion("e", centre, (1.7e-3, 3.1e-3), 0.4), np.pi * 1.7e-3 * 3.1e-3),
    "rectangle": (lambda centre: RectangleRegion("r", centre, (1.2e-3, 2.9e-3), 0.7), 4 * 1.2e-3 * 2.9e-3),
    "polygon": (lambda centre: PolygonRegion("p", turned(L_SHAPE, 0.3) + centre), 40e-6),
}
"""By name: the shape at a centre, and its area by formula, m^2."""


def area_error(shape, area, pixel_size_m, count):
    """The root mean square of the error of the area that pixels give, over positions of the shape."""
    pixels = int(14e-3 / pixel_size_m)
    grid = Grid((pixels, pixels), pixel_size_m)
    centres = np.random.default_rng(0).uniform(-0.5e-3, 0.5e-3, (count, 2))
    found = np.array([shape(tuple(c)).mask(grid).sum() for c in centres]) * pixel_size_m**2
    return np.sqrt(np.mean((found - area) ** 2))


@pytest.mark.parametrize("name", SHAPES)
def test_the_pixels_of_a_shape_cover_its_area(name):
    """The error of the area falls faster than the size of a pixel: by more than 4 for pixels of a quarter."""
    shape, area = SHAPES[name]
    coarse, fine = (area_error(shape, area, size, 40) for size in (0.2e-3, 0.05e-3))
    assert coarse < 0.01 * area
    assert fine < coarse / 4


MIRRORED = {
    "ellipse": lambda flip: EllipseRegion("e", (1e-3, flip * 1.3e-3), (1.7e-3, 3.1e-3), flip * 0.4),
    "rectangle": lambda flip: RectangleRegion("r", (1e-3, flip * 1.3e-3), (1.2e-3, 2.9e-3), flip * 0.7),
    "polygon": lambda flip: PolygonRegion("p", turned(L_SHAPE, 0.3) * (1, flip)),
}


@pytest.mark.parametrize("name", MIRRORED)
def test_a_mirrored_shape_has_the_mirrored_mask(name):
    """To change the sign of x, and of the angle, is to reverse the columns."""
    there, back = (MIRRORED[name](flip).mask(GRID) for flip in (1, -1))
    assert there.any()
    assert (back == there[:, ::-1]).all()


QUARTERS = {
    "ellipse": lambda n: EllipseRegion("e", turned_centre(n), (1.7e-3, 3.1e-3), 0.4 + n * np.pi / 2),
    "rectangle": lambda n: RectangleRegion("r", turned_centre(n), (1.2e-3, 2.9e-3), 0.7 + n * np.pi / 2),
    "polygon": lambda n: PolygonRegion("p", turned(L_SHAPE, 0.3 + n * np.pi / 2)),
}


def turned_centre(quarters):
    """The point (1.5, 0.9) mm after some quarters of a turn."""
    return tuple(turned(np.array([[1.5e-3, 0.9e-3]]), quarters * np.pi / 2)[0])


@pytest.mark.parametrize("name", QUARTERS)
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_turned_shape_has_the_turned_mask(name, quarters):
    """A quarter anticlockwise, y up, is a quarter of `numpy.rot90` the other way, since row 0 lies at the bottom."""
    start, end = (QUARTERS[name](n).mask(GRID) for n in (0, quarters))
    assert (end == np.rot90(start, -quarters)).all()


def test_a_positive_angle_turns_anticlockwise():
    """A long ellipse along x, turned by 45 degrees, holds the point up and to the right and not the one to the left."""
    mask = EllipseRegion("e", (0.0, 0.0), (0.5e-3, 4e-3), np.pi / 4).mask(GRID)
    assert mask[30 + 10, 30 + 10]
    assert not mask[30 + 10, 30 - 10]


def test_the_outline_of_an_ellipse_is_inscribed_in_it():
    """The polygon lies in the ellipse and holds the ellipse that is smaller by cos(pi / corners)."""
    grid = Grid((701, 701), 0.01e-3)
    ellipse = EllipseRegion("e", (0.2e-3, -0.1e-3), (1.7e-3, 3.1e-3), 0.4)
    inner = replace(ellipse, half_axes_m=tuple(np.cos(np.pi / CORNERS) * np.array(ellipse.half_axes_m)))
    polygon = PolygonRegion("p", ellipse.outline_m).mask(grid)
    assert (polygon <= ellipse.mask(grid)).all()
    assert (inner.mask(grid) <= polygon).all()


def test_the_outline_of_a_rectangle_is_that_rectangle():
    """The polygon of its corners has the same pixels, and runs anticlockwise."""
    rectangle = RectangleRegion("r", (0.3e-3, -0.4e-3), (1.2e-3, 2.9e-3), 0.7)
    assert (PolygonRegion("p", rectangle.outline_m).mask(GRID) == rectangle.mask(GRID)).all()
    y, x = rectangle.outline_m.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 == pytest.approx(4 * 1.2e-3 * 2.9e-3)


def test_a_shape_does_not_depend_on_where_the_grid_lies():
    """Where two grids have pixels in common, a shape has the same ones of them."""
    part = Grid((21, 31), GRID.pixel_size_m, (float(GRID.y_m[20]), float(GRID.x_m[25])))
    for shape, _ in SHAPES.values():
        region = shape((0.31e-3, -0.77e-3))
        assert (region.mask(part) == region.mask(GRID)[10:31, 10:41]).all()


def test_a_mask_belongs_to_its_grid():
    """It is given back as it was on its own grid, and refused on another one and in another shape."""
    pixels = np.random.default_rng(1).random(GRID.shape) < 0.5
    region = MaskRegion("m", pixels, GRID)
    assert (region.mask(GRID) == pixels).all()
    with pytest.raises(ValidationError, match=r"61 x 61 pixels of 0.2 mm, the image has 61 x 61 pixels of 0.1 mm"):
        region.mask(replace(GRID, pixel_size_m=1e-4))
    with pytest.raises(ValidationError, match="does not fit"):
        MaskRegion("m", pixels[:-1], GRID)


@pytest.fixture(scope="module")
def disc():
    """The signed distance to a circle of 4 mm."""
    grid = Grid((241, 241), 0.05e-3)
    return Image(np.hypot(grid.y_m[:, None], grid.x_m[None, :]) - 4e-3, "boundary", "m", grid)


def test_rim_and_core_share_the_body_between_them(disc):
    """No pixel is in both, and each one inside is in one."""
    outer, inner = (make(disc, 1e-3).mask(disc.grid) for make in (rim, core))
    assert not (outer & inner).any()
    assert ((outer | inner) == (disc.values[0] < 0)).all()


def test_the_rim_of_a_disc_is_a_ring(disc):
    """Its area is pi (R^2 - (R - d)^2), to a thousandth at 80 pixels a radius."""
    found = rim(disc, 1e-3).mask(disc.grid).sum() * disc.grid.pixel_size_m**2
    assert found == pytest.approx(np.pi * (4e-3**2 - 3e-3**2), rel=1e-3)


def test_rim_and_core_need_a_boundary_and_a_depth(disc):
    """Another image is refused, and so is a depth that is none, or in mm."""
    with pytest.raises(ValidationError, match="'fluence'"):
        rim(replace(disc, quantity="fluence"), 1e-3)
    for depth in (0.0, -1e-3, 2.0, float("nan")):
        with pytest.raises(ValidationError, match="the unit is m"):
            core(disc, depth)


WRONG = {
    "two corners": (lambda: PolygonRegion("w", np.zeros((2, 2))), "three corners"),
    "corners in mm": (lambda: PolygonRegion("w", 1e3 * L_SHAPE), "the unit is m"),
    "a corner that is no number": (lambda: PolygonRegion("w", np.array([(0, 0), (0, 1), (np.nan, 1)])), "nan"),
    "centre in mm": (lambda: EllipseRegion("w", (12.0, 0.0), (1e-3, 1e-3)), "the unit is m"),
    "no width": (lambda: RectangleRegion("w", (0.0, 0.0), (1e-3, 0.0)), "half_axes_m"),
    "degrees": (lambda: EllipseRegion("w", (0.0, 0.0), (1e-3, 1e-3), 30.0), "the unit is rad"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_shape_out_of_range_is_refused(what):
    """With the name of the region and a hint at what was meant."""
    make, message = WRONG[what]
    with pytest.raises(ValidationError, match=f"region 'w'.*{message}"):
        make()


def test_regions_are_equal_by_content():
    """However their numbers were made, and after pickling; another name is another region."""
    ours = EllipseRegion("a", (1e-3, 2e-3), (1e-3, 2e-3), 0.5)
    numpy = EllipseRegion("a", np.array([1e-3, 2e-3]), np.array([1e-3, 2e-3]), np.float64(0.5))
    assert ours == numpy == pickle.loads(pickle.dumps(ours))
    assert ours != replace(ours, name="b")
