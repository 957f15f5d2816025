"""The paper's experiments run, at a size of seconds, and end with a figure and a table that say what they should."""

import io
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from matplotlib.image import imread

from oatkit import Grid, Image, ResultError, ValidationError
from oatkit.drawing.page import png
from oatkit.drawing.plot import MOST_INSIDE, Curve, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.paper import ranking
from oatkit.paper.experiments import EXPERIMENTS
from oatkit.paper.fig6 import low_share, magnitude
from oatkit.paper.fig7 import SETTING as SPECTRAL_SETTING
from oatkit.paper.fig7 import STOPPED, fig7, spectra_of
from oatkit.paper.methods import L2, MAXENT
from oatkit.paper.outcome import Outcome
from oatkit.paper.running import run_experiment
from oatkit.paper.setting import Setting
from oatkit.paper.spectral import BELOW_SKIN_M, OFF_VESSELS_M, SpectralMouse, lowest_square
from oatkit.paper.star import Star
from oatkit.paper.sweep import sweep
from oatkit.registry import installed
from oatkit.scanfile import write_scan
from oatkit.shapes import MaskRegion
from oatkit.simulate import OxygenBody, mouse_body

SMALL = {"pixels": 48, "fine_pixels": 113, "detectors": 48, "per_decade": 1}
OTHER_SIZE = {
    "fig2": {"pixels": 80, "fine_pixels": 191, "detectors": 96},
    "fig7": {"wavelengths_nm": (680.0, 760.0, 900.0)},
}
SINGLE = [name for name in EXPERIMENTS if name != "ranking"]


def small(name: str) -> Setting:
    """The setting of an experiment at a size of seconds."""
    size = SMALL | OTHER_SIZE.get(name, {})
    return replace(import_module(f"oatkit.paper.{name}").SETTING, **size)


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Outcome]:
    """The ends of the experiments that were asked for, each run once."""
    return {}


def outcome(name: str, outcomes: dict[str, Outcome]) -> Outcome:
    """The end of an experiment."""
    if name not in outcomes:
        *lines, end = getattr(import_module(f"oatkit.paper.{name}"), name)(small(name))
        assert all(isinstance(line, str) for line in lines)
        outcomes[name] = end
    return outcomes[name]


def column(end: Outcome, name: str) -> list[str]:
    """One column of an outcome's table."""
    heading, *rows = end.table
    return [row[list(heading).index(name)] for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize("name", SINGLE)
def test_every_experiment_ends_with_a_figure_and_the_papers_numbers(name, outcomes, tmp_path):
    """Each writes a picture and a table in which each of the paper's figures has ours and a reason beside it."""
    end = outcome(name, outcomes)
    picture, table = end.write(tmp_path)
    assert imread(picture).shape[0] > 500
    text = table.read_text()
    assert text.startswith(f"# {name}: ")
    assert end.beside
    for row in end.beside:
        assert all((row.what, row.paper, row.ours, row.why))
        assert row.ours in text
    assert "nan" not in text


@pytest.mark.slow
def test_non_negative_methods_have_no_negative_pixel(outcomes):
    """In fig1 every method but least squares counts zero negative pixels in the body."""
    end = outcome("fig1", outcomes)
    counts = dict(zip(column(end, "method"), column(end, "negative pixels in the body"), strict=True))
    assert {name: count for name, count in counts.items() if count != "0"}.keys() <= {"L2"}
    assert len(counts) == 7


@pytest.mark.slow
def test_the_rule_loses_what_the_table_says(outcomes):
    """The PSNR lost by the L-curve's weight is the difference of the two columns, and never negative."""
    end = outcome("fig1", outcomes)
    heading, *rows = end.table
    best, by_rule, lost = (i for i, name in enumerate(heading) if name in ("PSNR, dB", "lost, dB"))
    for row in rows:
        assert float(row[lost]) == pytest.approx(float(row[best]) - float(row[by_rule]), abs=0.011)
        assert float(row[lost]) >= 0


@pytest.mark.slow
def test_the_correction_brings_the_tubes_together(outcomes):
    """In fig2 the deep tube is below two thirds of the shallow one before the correction, within a fifth after it.

    Fed back, what is wrong in a coarse reconstruction is amplified: only the one nearest to the truth is held to it.
    """
    end = outcome("fig2", outcomes)
    before, after = (column(end, name) for name in ("deep over shallow tube before", "after"))
    assert max(map(float, before)) < 0.67
    held = [float(a) for name, a in zip(column(end, "method"), after, strict=True) if name != "MaxEnt, fed back"]
    assert all(0.8 < ratio < 1.2 for ratio in held)
    assert len(held) == 7


@pytest.mark.slow
def test_both_starts_end_at_one_certified_optimum(outcomes):
    """In fig4 certified images have no negative pixel; the printed iteration from A^T b has, and leaves the reals."""
    rows = outcome("fig4", outcomes).table[1:]
    printed, certified = rows[:2], rows[2:]
    assert [row[2] for row in certified] == ["0", "0"]
    assert all(float(row[4]) <= 1e-4 for row in certified)
    assert int(printed[0][2].replace(",", "")) > 0
    assert float(printed[0][3].rstrip("%")) > 0


@pytest.mark.slow
def test_spectra_without_negative_values_come_from_the_non_negative_methods(outcomes):
    """In fig7, thresholded L2 and MaxEnt have no negative pixel in either region; signed L2 has, in the tissue."""
    end = outcome("fig7", outcomes)
    rows = list(zip(*(column(end, name) for name in ("region", "method", "negative pixels")), strict=True))
    shares = {(region, method): float(share.split()[0]) for region, method, share in rows}
    assert len(shares) == 10
    assert {key for key, share in shares.items() if share > 0} == {("tissue", "L2"), ("tissue", STOPPED)}


@pytest.mark.slow
def test_a_real_scan_without_regions_is_read_at_its_rim_and_core(tmp_path):
    """Given a scan of two wavelengths without regions, fig7 shows rim and core of the body, and claims no truth."""
    path = tmp_path / "scan.h5"
    write_scan(SpectralMouse(replace(small("fig7"), wavelengths_nm=(700.0, 850.0))).scan, path)
    *_, end = fig7(replace(small("fig7"), scan=path))
    assert {(region, known) for region, *_, known in end.table[1:]} == {("rim", "not known"), ("core", "not known")}
    assert set(column(end, "wavelengths with a mean below 0")) <= {f"{n} of 2" for n in range(3)}


def test_a_scan_of_one_wavelength_has_no_spectra(small_scan_file):
    """Fig7 says that a scan was taken at one wavelength only, and what to do, before anything is reconstructed."""
    with pytest.raises(ValidationError, match=r"small.h5: it was taken at 700 nm only; .* leave the scan out"):
        next(fig7(replace(SPECTRAL_SETTING, scan=small_scan_file)))


def test_the_square_of_tissue_is_the_lowest_of_all():
    """No square off skin and vessels has a lower mean, and this one keeps its distance from both."""
    grid, body = Grid((60, 60), 0.4e-3), OxygenBody.draw(1)
    image = Image(np.random.default_rng(0).normal(size=(3, 60, 60)), "initial_pressure", "", grid, (700, 800, 900))
    boundary = body.boundary(grid)
    found = lowest_square(image, boundary, body.vessels).mask(grid)
    near = boundary.values[0] > -BELOW_SKIN_M
    for vessel in body.vessels:
        near |= np.hypot(*np.meshgrid(*(grid.x_m - vessel.centre_m[1], grid.y_m - vessel.centre_m[0]))) <= (
            vessel.half_axes_m[0] + OFF_VESSELS_M
        )
    means = [
        image.values[:, i : i + 5, j : j + 5].mean()
        for i, j in np.ndindex(56, 56)
        if not near[i : i + 5, j : j + 5].any()
    ]
    assert found.sum() == 25
    assert not near[found].any()
    assert image.values[:, found].mean() == pytest.approx(min(means), abs=1e-12)


def test_spectra_are_in_the_order_of_wavelengths():
    """Whatever the order of the scan, a spectrum rises in wavelength, each mean, spread and share at its own."""
    grid, values = Grid((2, 1), 1e-3), np.array([[[3.0], [5.0]], [[-1.0], [1.0]]])
    image, everywhere = Image(values, "initial_pressure", "", grid, (800, 700)), np.ones((2, 1), bool)
    found = spectra_of({"an image": image}, [MaskRegion("all", everywhere, grid)])["all", "an image"]
    assert found.wavelengths_nm.tolist() == [700, 800]
    assert found.mean.tolist() == [0, 4]
    assert found.std.tolist() == [1, 1]
    assert found.negative_share == 0.25
    assert found.below_zero == "0 of 2"


@pytest.mark.slow
def test_the_ranking_scores_every_installed_solver():
    """One condition and two seeds: each solver has a row, and the wins add up to the number of images."""
    setting = replace(ranking.SETTING, **SMALL, seeds=2, bodies=("disc",))
    *_, end = ranking.ranking(setting, {"90°": {"coverage_deg": 90.0}})
    assert column(end, "method") == [method.label for method in ranking.all_methods()]
    assert {method.use for method in ranking.all_methods()} == {cls.name for cls in installed().of_kind("solver")}
    assert sum(int(cell.split()[0]) for cell in column(end, "best of all")) == 2


def test_a_sweep_knows_its_best_weight():
    """The best index is that of the largest PSNR, and thresholding lowers no PSNR of a non-negative truth."""
    star = Star(replace(Setting(), **SMALL))
    found = sweep(L2, star.problem, 1, star.truth[0].values[0])
    assert found.scores[found.best] == max(found.scores)
    assert all(np.array(found.thresholded("").scores) >= np.array(found.scores))
    assert found.weights == L2.weights(1) == pytest.approx([1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1])
    assert MAXENT.solver().name == "maxent-nlcg"


def test_low_frequencies_are_those_of_large_structures():
    """A wave of 4 mm lies below the limit of 0.5 per mm, one of 1 mm above it."""
    setting = Setting(pixels=80)
    truth = mouse_body().absorption(setting.grid)
    for length_mm, share in ((4.0, 1.0), (1.0, 0.0)):
        wave = np.sin(2 * np.pi * 1e3 * setting.grid.x_m / length_mm) + np.zeros((80, 1))
        assert low_share(replace(truth, values=wave)) == pytest.approx(share, abs=1e-9)
    assert magnitude(truth).values.shape == (1, 80, 80)


def test_an_experiment_writes_over_nothing(tmp_path):
    """A figure that is there already is kept, before any work is done, and a folder that cannot be made is said."""
    (tmp_path / "fig3.png").write_text("mine")
    with pytest.raises(ValidationError, match="exists already"):
        next(run_experiment("fig3", tmp_path))
    with pytest.raises(ValidationError, match="did you mean 'fig3'"):
        next(run_experiment("fig33", tmp_path))
    with pytest.raises(ResultError, match="cannot be made"):
        next(run_experiment("fig3", tmp_path / "fig3.png" / "below"))


def test_a_panel_can_carry_an_outline():
    """The outline of a body is drawn over a picture in a colour that is neither grey nor the red of negatives."""
    body, grid = mouse_body(), Setting(pixels=60, field_of_view_mm=25.0).grid
    figure = sheet([[Panel("mouse", body.absorption(grid), (), 0, body.boundary(grid))]])
    pixels = imread(io.BytesIO(png(figure)))[..., :3]
    drawn = (pixels[..., 2] > 0.9) & (pixels[..., 0] < 0.3)
    assert 500 < drawn.sum() < 0.05 * drawn.size


def test_a_long_legend_covers_neither_its_curves_nor_the_next_plot():
    """Of more than a few curves the legend stands to the right of the axes, before what comes next."""
    curves = tuple(Curve(f"MaxEnt, structural prior {i}", (0, 1), (0, i)) for i in range(MOST_INSIDE + 1))
    figure = sheet([], [Plot("plot", curves, "x", "y")] * 2)
    png(figure)
    first, second = figure.axes
    legends = [axes.get_legend().get_window_extent() for axes in (first, second)]
    assert legends[0].x0 >= first.get_window_extent().x1
    assert legends[0].x1 <= second.get_tightbbox().x0
    assert legends[1].x1 <= figure.bbox.x1
