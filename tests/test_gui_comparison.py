"""Results kept and compared: side by side, their difference, and all as it was before afterwards."""

# First, since it skips this module where napari is missing.
from gui_viewers import GRID, WAVELENGTHS_NM, bench_without_window, disc_boundary, pressure, wait_for  # isort: split

from dataclasses import replace

import numpy as np
import pytest
from qtpy.QtCore import Qt

from oatkit import Grid, Image
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import KEY
from oatkit.gui.images.looks import CHANGE, Limits
from oatkit.gui.view.comparison import DIFFERENCE, Comparison, Likeness, difference
from oatkit.gui.view.widget import ViewWidget
from oatkit.gui.workbench import workbench
from oatkit.metrics import psnr, rmse, ssim
from oatkit.result import Result
from oatkit.store import load
from results import write_frames

A, B = "maxent-nlcg", "maxent-nlcg 2"


def result(seed=0, scale=1.0, **more):
    """A result of noise and a boundary, made by a solver with a name."""
    noise = pressure(seed)
    images = {"initial_pressure": replace(noise, values=np.float32(scale) * noise.values), "boundary": disc_boundary()}
    return Result({**images, **more}, pipeline={"reconstruct": {"use": A}})


def bench_with(*results, bench=None):
    """A workbench with results, all but the last kept, and their comparison."""
    bench = bench or bench_without_window()
    comparison = Comparison(bench)
    for one in results[:-1]:
        bench.layers.show_result(one)
        comparison.keep(comparison.suggested_name())
    bench.layers.show_result(results[-1])
    return bench, comparison


def visible(bench):
    """The keys of the layers that are seen."""
    return {layer.metadata[KEY]["key"] for layer in bench.viewer.layers if layer.visible}


def looks(bench):
    """All that a user sees of the layers."""
    grid = bench.viewer.canvas.grid
    layers = {
        layer.name: (layer.visible, tuple(getattr(layer, "contrast_limits", ())), layer.opacity, layer.blending,
                     layer.name_overlay.visible)
        for layer in bench.viewer.layers
    }  # fmt: skip
    return layers, grid.enabled, grid.stride, grid.shape, bench.viewer.canvas.overlays.text.visible


def test_a_kept_result_stays_as_it_was_when_another_takes_its_place():
    """Kept results go by the name of their solver, none twice, out of sight, with the images that they had."""
    first, second, third = result(1), result(2), result(3)
    bench, comparison = bench_with(first, second, third)
    assert comparison.groups == ["", A, B]
    assert comparison.images == ["initial_pressure"]
    assert visible(bench) == {"initial_pressure", "boundary"}
    for group, of in (("", third), (A, first), (B, second)):
        assert bench.layers.groups()[group]["initial_pressure"].metadata[KEY]["image"] is of["initial_pressure"]


def test_kept_results_are_renamed_shown_and_removed():
    """A new name is that of layers and keys; a name that is taken or no name changes nothing; what is gone is gone."""
    bench, comparison = bench_with(result(1), result(2), result(3))
    comparison.rename(A, "first")
    assert bench.layers.find("first/initial_pressure").name == "first: initial pressure"
    for name in (B, "", "a/b", "current"):
        with pytest.raises(ValidationError):
            comparison.rename("first", name)
    comparison.show("first", True)
    assert visible(bench) >= {"first/initial_pressure", "first/boundary"}
    comparison.show("first", False)
    assert visible(bench) == {"initial_pressure", "boundary"}
    comparison.remove("first")
    assert comparison.groups == ["", B]
    assert not any(layer.name.startswith("first") for layer in bench.viewer.layers)


def test_there_must_be_a_result_to_keep():
    """Without a result there is nothing to keep, and a sentence says so."""
    with pytest.raises(ValidationError, match="run the pipeline first"):
        Comparison(bench_without_window()).keep("a")


def test_side_by_side_shows_what_is_compared_and_goes_back():
    """The grid has the image of each result and nothing else; afterwards all looks as it did before."""
    bench, comparison = bench_with(result(1), result(2, 3.0))
    bench.layers.find("initial_pressure").contrast_limits = (0, 0.7)
    bench.layers.find("initial_pressure").opacity = 0.5
    before = looks(bench)
    comparison.compare("initial_pressure")
    assert visible(bench) == {"initial_pressure", f"{A}/initial_pressure"}
    layers = bench.viewer.layers
    tiles = {index for _, places in bench.viewer.canvas.grid.iter_viewboxes(layers) for index in places}
    assert {layers[index].name for index in tiles} == {"current", A}
    assert all(layers[index].name_overlay.visible for index in tiles)
    comparison.show(A, False)
    assert visible(bench) == {"initial_pressure"}
    comparison.side_by_side.leave()
    assert looks(bench) == before


def test_the_caption_speaks_of_every_tile():
    """Side by side, the wavelength is said once, and the share of negative pixels for each result by its name."""
    first, second = result(1), result(2)
    bench, comparison = bench_with(first, second)
    comparison.compare("initial_pressure")
    for plane, wavelength in enumerate(WAVELENGTHS_NM):
        bench.viewing.go_to(wavelength)
        shares = [100 * np.mean(of["initial_pressure"].values[plane] < 0) for of in (second, first)]
        assert bench.viewer.canvas.overlays.text.text == (
            f"{wavelength:g} nm\ncurrent: {shares[0]:.1f} % negative\n{A}: {shares[1]:.1f} % negative"
        )
    comparison.side_by_side.leave()
    assert "current" not in bench.viewer.canvas.overlays.text.text


def test_one_colour_stands_for_one_value_in_all_tiles():
    """Linked, tiles have the widest limits and follow the one that is moved; released, each has its own."""
    first, second = result(1), result(2, 3.0)
    bench, comparison = bench_with(first, second)
    comparison.compare("initial_pressure")
    one, other = comparison.side_by_side.tiles
    widest = Limits.of(second["initial_pressure"]).high
    assert one.contrast_limits[1] == other.contrast_limits[1] == pytest.approx(widest)
    one.contrast_limits = (0, 1.25)
    assert other.contrast_limits[1] == 1.25
    comparison.side_by_side.linked = False
    own = [Limits.of(of["initial_pressure"]).high for of in (second, first)]
    assert [tile.contrast_limits[1] for tile in (one, other)] == pytest.approx(own)
    one.contrast_limits = (0, 0.5)
    assert other.contrast_limits[1] != 0.5
    comparison.side_by_side.linked = True
    bench.viewing.contrast_held = False
    bench.viewing.go_to(900)
    brightest = max(Limits.of(of["initial_pressure"], 2).high for of in (first, second))
    assert one.contrast_limits[1] == other.contrast_limits[1] == pytest.approx(brightest)


def test_what_comes_while_tiles_are_shown_finds_its_place():
    """A solver at work gets a tile, other layers are hidden until the end, a new run is compared in the old tile."""
    bench, comparison = bench_with(result(1), result(2))
    comparison.compare("initial_pressure")
    bench.layers.show(pressure(7), "iterate", visible=True)
    bench.layers.show(Image(np.ones(GRID.shape), "absorption", "1/m", GRID), "other", visible=True)
    assert visible(bench) == {"initial_pressure", f"{A}/initial_pressure", "iterate"}
    bench.layers.remove("iterate")
    brighter = result(4, 10.0)
    bench.layers.show_result(brighter)
    assert visible(bench) == {"initial_pressure", f"{A}/initial_pressure"}
    limits = [tile.contrast_limits[1] for tile in comparison.side_by_side.tiles]
    assert limits == pytest.approx(2 * [Limits.of(brighter["initial_pressure"]).high])
    comparison.side_by_side.leave()
    assert "other" in visible(bench)
    comparison.compare("initial_pressure")
    bench.viewer.canvas.grid.enabled = False
    assert not comparison.side_by_side.active
    comparison.compare("initial_pressure")
    bench.layers.remove_group("")
    comparison.remove(A)
    assert not comparison.side_by_side.active
    assert not bench.viewer.canvas.grid.enabled


def test_the_difference_is_the_subtraction():
    """The layer has the values of one image less the other, blue below zero, red above, and says of what."""
    first, second = result(1), result(2)
    bench, comparison = bench_with(first, second)
    comparison.subtract("", A, "initial_pressure")
    layer = bench.layers.find(DIFFERENCE)
    expected = second["initial_pressure"].values - first["initial_pressure"].values
    assert np.array_equal(layer.metadata[KEY]["image"].values, expected)
    assert np.array_equal(layer.data, expected[:, ::-1])
    assert layer.colormap is CHANGE
    assert layer.contrast_limits[0] == -layer.contrast_limits[1]
    low, middle, high = layer.colormap.map([0.0, 0.5, 1.0])[:, :3]
    assert low[2] > low[0]
    assert np.ptp(middle) < 0.01
    assert high[0] > high[2]
    assert layer.metadata[KEY]["image"].history[-1]["what"] == f"current - {A}"
    assert layer.name == f"current - {A}: initial pressure"


def test_the_numbers_are_those_of_the_metrics_where_both_have_values():
    """Relative RMSE, PSNR and SSIM of the wavelength looked at equal the metrics; pixels without a value stay out."""
    first, second = result(1), result(2)
    bench, comparison = bench_with(first, second)
    comparison.subtract("", A, "initial_pressure")
    bench.viewing.go_to(WAVELENGTHS_NM[1])
    plane, truth = (of["initial_pressure"].values[1].astype(float) for of in (second, first))
    relative = np.linalg.norm(plane - truth) / np.linalg.norm(truth)
    expected = (relative, psnr(plane, truth), ssim(plane, truth))
    assert comparison.numbers() == "relative RMSE {:.3g} · PSNR {:.1f} dB · SSIM {:.3f}".format(*expected)
    holed = plane.copy()
    holed[:3] = np.nan
    found, mask = Likeness.of(holed, truth), np.isfinite(holed)
    assert found.pixels == mask.sum()
    assert found.relative_rmse == pytest.approx(rmse(plane, truth, mask) / np.sqrt((truth[mask] ** 2).mean()))
    with pytest.raises(ValidationError, match="zero everywhere"):
        Likeness.of(plane, 0 * truth)


def test_only_like_images_are_subtracted():
    """Other grids, wavelengths or units are refused in a sentence each."""
    image = pressure()
    finer = Image(image.values, image.quantity, image.unit, Grid(GRID.shape, 1e-4), image.wavelengths_nm)
    shifted = replace(image, wavelengths_nm=(700.0, 715.0, 901.0))
    for other, word in ((finer, "grids"), (shifted, "wavelengths"), (replace(image, unit="Pa"), "units")):
        with pytest.raises(ValidationError, match=word):
            difference(image, other, "")
    _, comparison = bench_with(result(1), result(2))
    with pytest.raises(ValidationError, match="no image named 'so2'"):
        comparison.subtract("", A, "so2")
    with pytest.raises(ValidationError, match="no result has"):
        comparison.compare("so2")


def test_the_difference_follows_frames_and_new_results(tmp_path):
    """Of stored results the frame looked at is subtracted; after another run the difference is that of the new one."""
    for name, seeds in (("a", (1, 2, 3)), ("b", (4, 5, 6))):
        write_frames(tmp_path / f"{name}.zarr", *(replace(result(seed), frame_index=i) for i, seed in enumerate(seeds)))
    bench, comparison = bench_with(result(9))
    for name in ("a", "b"):
        bench.layers.show_result(load(tmp_path / f"{name}.zarr"), name)
    comparison.subtract("a", "b", "initial_pressure")
    for frame in (0, 2, 1):
        bench.viewer.dims.set_current_step(0, frame)
        shown = bench.layers.find(DIFFERENCE).metadata[KEY]["image"]
        assert np.array_equal(shown.values, pressure(frame + 1).values - pressure(frame + 4).values)
    comparison.subtract("", "a", "initial_pressure")
    bench.layers.show_result(result(8))
    shown = bench.layers.find(DIFFERENCE).metadata[KEY]["image"]
    assert np.array_equal(shown.values, pressure(8).values - pressure(2).values)
    bench.layers.remove_group("a")
    bench.viewing.go_to(900)
    assert bench.layers.find(DIFFERENCE) is None


def test_many_layers_come_as_one():
    """Whoever follows the layers is told once of a whole result, with its first image selected."""
    bench = bench_without_window()
    told = []
    bench.viewing.changed.connect(lambda: told.append(bench.viewing.image))
    one = result(1)
    bench.layers.show_result(one)
    assert len(told) <= 2
    assert told[-1] is one["initial_pressure"]
    before = bench.viewer.layers.selection.active
    bench.layers.show_result(result(2), "kept", visible=False)
    assert bench.viewer.layers.selection.active is before


def test_the_panel_keeps_compares_and_subtracts(make_napari_viewer_proxy, qtbot):
    """By its buttons alone two results are kept, shown in two tiles of the canvas, subtracted, renamed and removed."""
    viewer = make_napari_viewer_proxy(show=True)
    bench = workbench(viewer)
    widget = ViewWidget(viewer)
    viewer.window.add_dock_widget(widget, name="View")
    panel = widget.comparison
    assert not panel.keep.isEnabled()
    bright = Image(np.ones((3, *GRID.shape)), "initial_pressure", "a.u.", GRID, WAVELENGTHS_NM)
    bench.layers.show_result(Result({"initial_pressure": bright}, pipeline={"reconstruct": {"use": A}}))
    wait_for(panel.keep.isEnabled, qtbot)
    assert panel.name.text() == A
    panel.keep.click()
    dim = replace(bright, values=0.5 * bright.values)
    bench.layers.show_result(Result({"initial_pressure": dim}, pipeline={"reconstruct": {"use": A}}))
    wait_for(lambda: panel.list.count() == 2 and panel.name.text() == B, qtbot)
    panel.beside.click()
    qtbot.wait(200)
    picture = viewer.screenshot(flash=False)[60:-60, :, 0].astype(int)
    white, grey = (picture == 255).sum(), (abs(picture - 127) <= 1).sum()
    assert white > 1000
    assert grey == pytest.approx(white, rel=0.05)
    panel.beside.click()
    assert not bench.viewer.canvas.grid.enabled
    assert (panel.first.currentData(), panel.second.currentData()) == ("", A)
    panel.subtract.click()
    assert (bench.layers.find(DIFFERENCE).data == -0.5).all()
    assert panel.numbers.text().startswith("relative RMSE 0.5 ")
    item = panel.list.item(1)
    item.setText("")
    assert "needs a name" in panel.message.text()
    panel.list.item(1).setText("first")
    assert bench.layers.find("first/initial_pressure") is not None
    panel.list.item(1).setCheckState(Qt.CheckState.Checked)
    assert bench.layers.find("first/initial_pressure").visible
    panel.list.setCurrentRow(1)
    panel.remove.click()
    assert panel.comparison.groups == [""]
    assert not panel.subtract.isEnabled()
    box = viewer.canvas.overlays.text
    for plane in (1, 2, 0):
        viewer.dims.set_current_step(0, plane)
    assert not box.box
    wait_for(lambda: box.box, qtbot)


def test_a_view_that_is_gone_is_told_nothing_more(qtbot):
    """After the widget is destroyed the viewer goes on without it."""
    bench = bench_without_window()
    widget = ViewWidget(bench.viewer)
    with qtbot.waitSignal(widget.destroyed):
        widget.deleteLater()
    assert (len(bench.viewing.changed), len(bench.side_by_side.changed)) == (0, 0)
    bench.layers.show_result(result())
