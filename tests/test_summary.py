"""What a run says on a terminal: a line for each image, whatever the number of its wavelengths."""

from dataclasses import replace

import numpy as np
import pytest

from oatkit.cli.summary import image_lines, summary
from oatkit.data import Grid, Image
from oatkit.words import plane_words
from results import make_result

GRID = Grid((4, 5), 1e-3)
INSIDE = np.add.outer(range(4), range(5)) < 6
BOUNDARY = Image(np.where(INSIDE, -1.0, 1.0), "boundary", "m", GRID)


def solved(count: int, gaps: tuple[float, ...]) -> Image:
    """An initial pressure at some wavelengths with its certificates; pixel k is negative at the wavelengths below k."""
    values = np.ones((count, 20))
    for index in range(count):
        values[index, : 2 * index] = -1.0
    found = {
        "products": tuple(range(40, 40 + count)),
        "residual_norm": tuple(0.5 + 0.01 * i for i in range(count)),
        "data_norm": (2.0,) * count,
        "relative_gap": gaps,
    }
    wavelengths = tuple(700.0 + 10 * i for i in range(count))
    return Image(values.reshape(count, 4, 5), "initial_pressure", "a.u.", GRID, wavelengths, diagnostics=found)


def plane(values, quantity: str, unit: str = "", **found) -> Image:
    """An image that belongs to no wavelength."""
    return Image(np.broadcast_to(np.asarray(values, float), (4, 5)), quantity, unit, GRID, diagnostics=found)


def test_few_wavelengths_get_a_line_each():
    """Up to three, with the negative pixels, the products, the residual and the certificate of each."""
    lines = list(image_lines("p", solved(3, (1e-3, 2e-3, float("nan")))))
    assert lines == [
        "p at 700 nm: 0 of 20 pixels negative (0.0 %), 40 products, residual 0.250 of the data, "
        "within 1.0e-03 of the optimum",
        "p at 710 nm: 2 of 20 pixels negative (10.0 %), 41 products, residual 0.255 of the data, "
        "within 2.0e-03 of the optimum",
        "p at 720 nm: 4 of 20 pixels negative (20.0 %), 42 products, residual 0.260 of the data",
    ]


def test_many_wavelengths_share_a_line():
    """It has the ends of each range, and the worst of what must not be large."""
    (line,) = image_lines("p", solved(4, (1e-3, 4e-3, 2e-3, 1e-3)))
    assert line == (
        "p at 4 wavelengths, 700 .. 730 nm: at most 6 of 20 pixels negative (30.0 %), 40 .. 43 products, "
        "residual 0.250 .. 0.265 of the data, within 4.0e-03 of the optimum"
    )


@pytest.mark.parametrize("missing", [float("nan"), float("inf"), None])
def test_a_certificate_of_some_wavelengths_is_not_that_of_all(missing):
    """Where some have none, the line says how many have one."""
    (line,) = image_lines("p", solved(4, (1e-3, missing, 2e-3, missing)))
    assert line.endswith("within 2.0e-03 of the optimum at 2 of 4 wavelengths")


def test_unsorted_and_repeated_wavelengths_are_counted_as_they_come():
    """Four planes are four wavelengths, and the range is that of the numbers."""
    image = replace(solved(4, (1e-3,) * 4), wavelengths_nm=(850.0, 700.0, 850.0, 760.0))
    assert next(image_lines("p", image)).startswith("p at 4 wavelengths, 700 .. 850 nm: ")


def test_light_has_one_range():
    """That of all planes, undefined pixels aside; there is no line of 'nan'."""
    values = np.linspace(0.1, 0.9, 80).reshape(4, 4, 5)
    values[0, 0, 0] = np.nan
    image = Image(values, "fluence", "", GRID, (1000.0, 700.0, 800.0, 900.0))
    (line,) = image_lines("fluence", image)
    assert line == "fluence at 4 wavelengths, 700 .. 1000 nm: 0.11 .. 0.9 of the incident light"
    assert plane_words(Image(np.full((4, 5), np.nan), "fluence", "", GRID), 0) == ["no pixel has a value"]


def test_saturation_is_told_by_its_quartiles_in_the_body():
    """Of 0.5, 0.52, ... they are the 25th, 50th and 75th percentile; what has no value is a share of the body."""
    values = np.full((4, 5), np.nan)
    values[INSIDE] = 0.5 + 0.02 * np.arange(INSIDE.sum())
    values[0, :3] = np.nan
    words = plane_words(plane(values, "so2"), 0, BOUNDARY)
    n = int(INSIDE.sum())
    low, median, high = np.percentile(values[np.isfinite(values)], [25, 50, 75])
    assert words == [
        f"median {median:.3f}, half of the pixels in {low:.3f} .. {high:.3f}",
        f"undefined in {300 / n:.1f} % of the body",
    ]
    assert plane_words(plane(values, "so2"), 0) == words[:1]


def test_saturation_without_a_value_says_so():
    """A frame without blood is a frame."""
    (line,) = image_lines("so2", plane(np.nan, "so2"), BOUNDARY)
    assert line.endswith("no pixel has a value, undefined in 100.0 % of the body")


def test_concentrations_have_a_mean_with_its_unit():
    """What was fitted to spectra does, under whatever name; other images say nothing."""
    assert plane_words(plane(0.25, "oxyhaemoglobin", "mol/m^3", fitted_to="absorption"), 0) == ["mean 0.25 mol/m^3"]
    assert plane_words(plane(0.25, "my-dye", fitted_to="initial_pressure"), 0) == ["mean 0.25"]
    assert plane_words(plane(0.25, "my-dye"), 0) == []


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("spectra", " (by the spectra)"),
        ("hand", " (by hand)"),
        ("the mean of [optics]", " (by the mean of [optics])"),
        (None, ""),
    ],
)
def test_absorption_says_what_calibrated_it(source, words):
    """The number and where it comes from; a scale that nobody knows is called arbitrary."""
    found = {"calibration": 1.50767} | ({"calibrated_by": source} if source else {})
    assert plane_words(plane(1.0, "absorption", "1/m", **found), 0) == [f"calibrated by K = 1.508 a.u. m{words}"]
    assert plane_words(plane(1.0, "absorption", "a.u."), 0) == ["in arbitrary units: no calibration"]


def test_a_sensitivity_is_told_by_its_size():
    """Signs do not count: changes of both have one median, and none of them is a fault."""
    values = np.linspace(0.01, 0.2, 20).reshape(4, 5) * np.where(np.eye(4, 5) > 0, -1, 1)
    image = plane(values, "so2_sensitivity_scattering", probe=0.2)
    (line,) = image_lines("so2_sensitivity_scattering", image)
    assert line == (
        "so2_sensitivity_scattering: for 20 % more mu_s', |change| 0.1050 in the median, 0.1905 at the 95th percentile"
    )


def test_a_summary_tells_each_image_once():
    """The scan, the images in their order, and every warning."""
    result = make_result(images={"initial_pressure": solved(12, (1e-3,) * 12), "boundary": BOUNDARY})
    lines = list(summary(result))
    assert [line.split(":")[0] for line in lines] == [
        "Scan_9", "initial_pressure at 12 wavelengths, 700 .. 810 nm", "boundary", "note",
    ]  # fmt: skip
