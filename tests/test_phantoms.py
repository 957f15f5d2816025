"""Phantoms against their closed forms, and against themselves on other grids."""

import numpy as np
import pytest

from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.simulate import PHANTOMS, breast, disc, star, truth, vessel
from oatkit.simulate.anatomy import SKIN_DEPTH, TUMOURS, Anatomy
from oatkit.simulate.raster import area_average


def square(pixels, side_m=22e-3, centre_m=(0.0, 0.0)):
    """A square grid."""
    return Grid((pixels, pixels), side_m / pixels, centre_m)


def mass_and_centroid(image):
    """The integral over the plane, m^2, and the centroid (y, x), m."""
    plane = image.values[0]
    y, x = image.grid.y_m @ plane.sum(1), image.grid.x_m @ plane.sum(0)
    return plane.sum() * image.grid.pixel_size_m**2, np.array([y, x]) / plane.sum()


@pytest.mark.parametrize("name", PHANTOMS)
def test_a_phantom_is_the_same_object_on_any_grid(name):
    """Mass and centroid on 100, 200 and 541 pixels agree to 1.5e-3 and 3 um."""
    masses, centroids = zip(*(mass_and_centroid(truth(name, square(n))) for n in (100, 200, 541)), strict=True)
    assert np.ptp(masses) <= 1.5e-3 * masses[-1]
    assert np.ptp(centroids, axis=0).max() <= 3e-6


@pytest.mark.parametrize("name", PHANTOMS)
def test_refinement_is_consistent(name):
    """Blocks of 2 x 2 pixels of a grid average to the pixels of the coarser one, to rounding."""
    coarse, fine = (truth(name, square(n)).values[0] for n in (110, 220))
    assert abs(fine.reshape(110, 2, 110, 2).mean((1, 3)) - coarse).max() <= 5e-14


@pytest.mark.parametrize("name", PHANTOMS)
def test_a_window_shows_a_part_of_the_object(name):
    """A small grid off the centre, wider than high, is a cut-out of the large one, to rounding."""
    large = truth(name, square(120))
    rows, columns = slice(40, 70), slice(20, 70)
    centre = (large.grid.y_m[rows].mean(), large.grid.x_m[columns].mean())
    part = truth(name, Grid((30, 50), large.grid.pixel_size_m, centre))
    assert abs(part.values[0] - large.values[0][rows, columns]).max() <= 5e-14
    assert part.values.any()


@pytest.mark.parametrize("name", PHANTOMS)
def test_a_phantom_is_an_initial_pressure_inside_its_body(name):
    """No pixel is negative, and none further from the origin than the body is anything but zero."""
    image = truth(name, square(200))
    y, x = image.grid.y_m[:, None], image.grid.x_m[None, :]
    assert image.values.min() == 0
    assert not image.values[0][np.hypot(y, x) > 9e-3 + image.grid.pixel_size_m].any()
    assert (image.quantity, image.unit, image.wavelengths_nm) == ("initial_pressure", "a.u.", ())


def test_a_disc_has_the_area_and_the_edge_of_a_circle():
    """Its mass is pi r^2 to 1e-3, its centroid its centre, and pixels off the edge are exactly 0 or 1."""
    image = disc(square(150), radius_m=4e-3, centre_m=(2e-3, -1e-3))
    mass, centroid = mass_and_centroid(image)
    assert mass == pytest.approx(np.pi * 4e-3**2, rel=1e-3)
    assert centroid == pytest.approx([2e-3, -1e-3], abs=1e-6)
    off = np.hypot(image.grid.y_m[:, None] - 2e-3, image.grid.x_m[None, :] + 1e-3) - 4e-3
    pixel = image.grid.pixel_size_m
    assert (image.values[0][off < -pixel] == 1).all()
    assert not image.values[0][off > pixel].any()
    assert ((image.values[0] > 0) & (image.values[0] < 1)).any()


def test_area_average_of_a_plane_is_the_plane():
    """A linear function has its own value at the centre of every pixel as its mean."""
    grid = Grid((7, 5), 1.3e-4, (1e-3, -2e-3))
    mean = area_average(lambda y, x: 3 * y - 2 * x + 1, grid)
    assert mean == pytest.approx(3 * grid.y_m[:, None] - 2 * grid.x_m[None, :] + 1, rel=1e-14)


def test_the_star_has_the_mass_of_its_outline_and_tubes():
    """It is 0.25 times the area inside the outline, integrated over the angle, and 2.25 times that of two tubes."""
    angle = np.arange(3600) * 2 * np.pi / 3600
    outline = 0.76 + 0.16 * np.sin(5 * angle) + 0.05 * np.cos(2 * angle + 0.7) + 0.03 * np.sin(3 * angle)
    expected = 0.25 * np.pi * (outline**2).mean() + 2.25 * 2 * np.pi * 0.11**2
    mass, _ = mass_and_centroid(star(square(200), radius_m=8e-3))
    assert mass == pytest.approx(expected * 8e-3**2, rel=1.5e-3)


def test_the_star_has_a_tube_at_its_centre_and_one_near_its_upper_edge():
    """There the value is the paper's 2.5 OD, ten times that of the agar around."""
    point = [star(Grid((1, 1), 1e-4, (y, 0.0))).values.item() for y in (0.0, 0.4 * 9e-3, 0.68 * 9e-3)]
    assert point == [2.5, 0.25, 2.5]


@pytest.mark.parametrize("seed", range(12))
def test_every_breast_has_its_tissues(seed):
    """Its tumours have their contrast and do not touch each other or the skin, which has its own value all around."""
    anatomy = Anatomy.draw(seed)
    for (y, x, radius), value in zip(anatomy.tumours, TUMOURS, strict=True):
        rim = y + radius * np.sin(np.arange(0, 6, 0.3)), x + radius * np.cos(np.arange(0, 6, 0.3))
        depth = [anatomy.depth(np.array([[a]]), np.array([[b]])).item() for a, b in zip(*rim, strict=True)]
        assert anatomy.density(np.array([[y]]), np.array([[x]])) == value
        assert min(depth) > SKIN_DEPTH
    pairs = [(a, b) for i, a in enumerate(anatomy.tumours) for b in anatomy.tumours[:i]]
    assert all(np.hypot(*(a - b)[:2]) > a[2] + b[2] for a, b in pairs)
    assert breast(square(100), seed=seed).values.max() <= 1


def test_a_breast_is_drawn_by_its_seed():
    """The same seed gives the same body to the bit, another seed another one."""
    assert breast(square(60), seed=3) == breast(square(60), seed=3)
    assert breast(square(60), seed=3) != breast(square(60), seed=4)


def test_a_picture_keeps_its_orientation():
    """Row 0 of a picture is at the top, so its upper right corner lands at positive y and x."""
    picture = np.zeros((8, 8), np.uint8)
    picture[1, 6] = 3
    mass, centroid = mass_and_centroid(vessel(square(80), picture=picture, side_m=16e-3))
    assert centroid == pytest.approx([5e-3, 5e-3], abs=1e-6)
    assert mass == pytest.approx(3 * 2e-3**2, rel=1e-3)


def test_the_vessels_are_sparse():
    """The default picture is a network: it spans most of the field and covers little of it."""
    image = vessel(square(200))
    rows, columns = np.nonzero(image.values[0] > 0.3)
    assert 0.01 < len(rows) / 200**2 < 0.06
    assert min(np.ptp(rows), np.ptp(columns)) > 130


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda g: truth("brest", g), "no phantom named 'brest'; did you mean 'breast'"),
        (lambda g: disc(g, radius_m=np.nan), "phantom radius: nan is outside"),
        (lambda g: star(g, radius_m=8), "5 mm is 5e-3"),
        (lambda g: vessel(g, picture=np.array([[0.0, np.nan]])), "picture: nan is outside"),
        (lambda g: vessel(g, picture=-np.ones((2, 2))), "picture: -1 is outside"),
        (lambda g: vessel(g, picture=np.ones((2, 2, 3))), r"expected numbers of shape \(rows, columns\)"),
        (lambda g: truth(lambda grid: disc(square(5)), g), "on the grid that was asked for"),
        (lambda g: truth(lambda grid: Image(np.full(grid.shape, np.nan), "", "", grid), g), "expected a finite image"),
    ],
)
def test_what_is_no_phantom_is_refused(call, message):
    """Unknown names, slipped units and unusable pictures are errors that say so."""
    with pytest.raises(ValidationError, match=message):
        call(square(20))
