"""Profiles along a line against analytic images and another implementation, and the width of peaks."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from oatkit import Grid, Image
from oatkit.errors import ValidationError
from oatkit.regions.profile import MOST_POINTS, highest_peak, line_profile

GRID = Grid((40, 60), 2e-4, (1e-3, -5e-4))
"""Neither square nor centred."""
START, END = (-2.1e-3, -5.3e-3), (4.2e-3, 4.7e-3)


def image_of(function, grid=GRID):
    """A function of (y, x), m, on a grid."""
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    return Image(function(y, x), "absorption", "1/m", grid)


def gaussian(sigma, centre=(1e-3, -5e-4)):
    """A round peak of height 2."""
    return lambda y, x: 2 * np.exp(-((y - centre[0]) ** 2 + (x - centre[1]) ** 2) / (2 * sigma**2))


def test_a_ramp_is_read_exactly():
    """Along any line the profile of a linear function is that function, at equal steps of half a pixel or less."""
    profile = line_profile(image_of(lambda y, x: 3 + 200 * y - 700 * x), START, END)
    length = np.hypot(6.3e-3, 10e-3)
    assert profile.distance_m[0] == 0
    assert profile.distance_m[-1] == pytest.approx(length, rel=1e-14)
    steps = np.diff(profile.distance_m)
    assert np.ptp(steps) < 1e-15
    assert 0.98e-4 < steps[0] <= 1e-4
    part = profile.distance_m / length
    y, x = (a + part * (b - a) for a, b in zip(START, END, strict=True))
    assert np.allclose(profile.values[0], 3 + 200 * y - 700 * x, rtol=1e-12, atol=0)


def test_it_is_what_scipy_finds():
    """On noise at several wavelengths the profile equals scipy's linear interpolation."""
    values = np.random.default_rng(0).standard_normal((3, *GRID.shape))
    image = Image(values, "initial_pressure", "a.u.", GRID, (700, 800, 900))
    profile = line_profile(image, START, END)
    points = np.linspace(START, END, len(profile.distance_m))
    at = [(points[:, i] - centres[0]) / GRID.pixel_size_m for i, centres in enumerate((GRID.y_m, GRID.x_m))]
    for plane, found in zip(values, profile.values, strict=True):
        assert np.allclose(found, map_coordinates(plane, at, order=1, cval=np.nan), rtol=1e-10, atol=1e-12)


def test_there_is_no_value_beyond_the_image():
    """A line that leaves the image has values between the outermost pixel centres, and nowhere else."""
    profile = line_profile(image_of(lambda y, x: np.ones_like(y)), (1e-3, -10e-3), (1e-3, 10e-3))
    x = -10e-3 + profile.distance_m
    within = (x >= GRID.x_m[0] - 1e-10) & (x <= GRID.x_m[-1] + 1e-10)
    assert np.array_equal(np.isfinite(profile.values[0]), within)


def test_a_pixel_without_a_value_reaches_as_far_as_its_neighbours():
    """Beside a pixel of NaN there is none either, up to the centres of its neighbours, which have their own."""
    values = np.ones(GRID.shape)
    values[20, 30] = np.nan
    row = (float(GRID.y_m[20]), float(GRID.x_m[27])), (float(GRID.y_m[20]), float(GRID.x_m[33]))
    found = line_profile(Image(values, "absorption", "1/m", GRID), *row).values[0]
    assert np.isnan(found).tolist() == [False] * 5 + [True] * 3 + [False] * 5
    beside = [(y + GRID.pixel_size_m, x) for y, x in row]
    assert np.isfinite(line_profile(Image(values, "absorption", "1/m", GRID), *beside).values).all()


@pytest.mark.parametrize("sigma", [0.8e-3, 1.3e-3])
def test_the_width_of_a_gaussian_is_that_of_the_formula(sigma):
    """The full width at half maximum of a round Gaussian is 2 sqrt(2 ln 2) sigma in every direction."""
    for angle in np.deg2rad([0, 17, 45, 90]):
        along = 3.4e-3 * np.array([np.sin(angle), np.cos(angle)])
        ends = [tuple(np.array(GRID.centre_m) + sign * along) for sign in (-1, 1)]
        profile = line_profile(image_of(gaussian(sigma)), *ends)
        peak = highest_peak(profile.distance_m, profile.values[0])
        # A chord lies below its curve by at most h^2 / 8 times the curvature, here 2 / sigma^2 in each of y and x, at
        # the maximum as on the flanks, whose slope is 2 sqrt(2 ln 2) / (2 sigma) of the half height.
        sag = 2 * GRID.pixel_size_m**2 / 8 * 2 / sigma**2
        slope = np.sqrt(2 * np.log(2)) / sigma
        assert peak.width_m == pytest.approx(2 * np.sqrt(2 * np.log(2)) * sigma, abs=2 * 1.5 * sag / slope)
        assert peak.height == pytest.approx(2, abs=sag)
        assert peak.at_m == pytest.approx(3.4e-3, abs=GRID.pixel_size_m)


def test_of_two_peaks_the_higher_one_is_measured():
    """Triangles of known width: the width is that of the higher one, to rounding."""
    x = np.linspace(0, 20, 401)
    values = np.maximum(0, 1 - abs(x - 5) / 2) + 3 * np.maximum(0, 1 - abs(x - 14) / 1.5)
    peak = highest_peak(x, values)
    assert (peak.at_m, peak.width_m) == pytest.approx((14, 1.5))


@pytest.mark.parametrize(
    "values", [[0, 0, 0], [-1, -2, -1], [3, 2, 2], [1, 2, 1.5], [np.nan] * 3, [1, np.nan, 4, np.nan, 0], []]
)
def test_what_does_not_fall_to_its_half_has_no_width(values):
    """Zeros, negative values, a peak cut off by the end of the line or by a pixel without a value: no width."""
    assert highest_peak(np.arange(float(len(values))), np.array(values, float)) is None


@pytest.mark.parametrize("ends", [(START, START), ((0, np.nan), END), ((0, 0), (2, 0)), ((0, 0), (np.inf, 0))])
def test_a_line_that_is_none_is_refused(ends):
    """A line without a length, with an end that is no number, or metres away is refused in words."""
    with pytest.raises(ValidationError, match="line"):
        line_profile(image_of(gaussian(1e-3)), *ends)


def test_no_step_asks_for_all_memory():
    """A step so small that the profile would not fit into memory is refused."""
    with pytest.raises(ValidationError, match=f"{MOST_POINTS} steps"):
        line_profile(image_of(gaussian(1e-3)), START, END, 1e-12)
