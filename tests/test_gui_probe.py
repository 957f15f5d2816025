"""The probe: its numbers are those of the regions and of `oatkit roi`, its fits those of the unmixer."""

# First, since it skips this module where napari is missing.
from gui_viewers import GRID, WAVELENGTHS_NM, bench_without_window, disc_boundary, pressure, wait_for  # isort: split

import csv
import json
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from napari.components import ViewerModel
from napari.utils._proxies import ReadOnlyWrapper
from napari.utils.interactions import mouse_move_callbacks, mouse_press_callbacks, mouse_release_callbacks
from qtpy.QtCore import QEvent, QPointF, Qt
from qtpy.QtGui import QMouseEvent
from qtpy.QtWidgets import QApplication

from oatkit import Grid, Image
from oatkit.api import UnmixProblem
from oatkit.drawing.plot import Curve, Plot
from oatkit.errors import ValidationError
from oatkit.gui.parts.plots import PlotView
from oatkit.gui.probe.chromophore_fit import fit_spectrum
from oatkit.gui.probe.layer import ProbeLayer
from oatkit.gui.probe.probe import (
    COLOURED,
    LIVE,
    NOTHING_TO_FIT,
    Probe,
    fit_lines,
    plots_of,
    seen,
    spectra_of,
    values_of,
)
from oatkit.gui.probe.profile import peak_lines, profile_csv, profile_plots, traces
from oatkit.gui.probe.widget import NOTHING_SHOWN, ProbeWidget
from oatkit.regions import EllipseRegion, PolygonRegion, RectangleRegion, region_table, save_regions
from oatkit.registry import plugin
from oatkit.result import Result
from oatkit.spectra import CHROMOPHORES
from oatkit.store import load
from packages import run_oatkit
from results import write_frames

PLACES = [
    EllipseRegion("1", (1.2e-3, 0.3e-3), (6e-4, 9e-4), 0.4),
    RectangleRegion("2", (0.1e-3, -2e-3), (5e-4, 3e-4), -1.1),
    PolygonRegion("3", [(0.0, -1e-3), (2.2e-3, 0.0), (1e-3, 1.5e-3), (1.4e-3, -2e-3)]),
    EllipseRegion("outside", (0.5, 0.5), (1e-3, 1e-3)),
    RectangleRegion(LIVE, (1e-3, -5e-4), (1e-1, 1e-1)),
]


def absorption(seed=1, unit="1/m"):
    """Positive numbers, of which a third are missing."""
    values = np.random.default_rng(seed).random((3, *GRID.shape), np.float32)
    return Image(np.where(values > 0.3, values, np.float32("nan")), "absorption", unit, GRID, WAVELENGTHS_NM)


def saturation(value=0.7):
    """An image of one plane, on another grid than the others."""
    return Image(np.full((10, 12), value, np.float32), "so2", "", Grid((10, 12), 4e-4, (1e-3, 0.0)))


def images():
    """Images of several units, wavelengths and grids, by the names that results have."""
    return {"initial_pressure": pressure(), "absorption": absorption(), "so2": saturation()}


@pytest.fixture
def bench():
    """A workbench without a window, with a result of which all is visible."""
    made = bench_without_window()
    show(made, images() | {"boundary": disc_boundary()})
    return made


def show(bench, shown):
    """Show a result with all of its images."""
    bench.layers.show_result(Result(shown))
    for layer in bench.viewer.layers:
        layer.visible = True


def test_the_numbers_are_those_of_the_regions(bench):
    """For any place, outside or NaN or larger than the image, the rows equal those of `region_table` to the bit."""
    rows = Probe().rows(list(seen(bench.layers)), PLACES)
    assert sorted(rows, key=str) == sorted(region_table(images(), PLACES), key=str)


def test_the_numbers_are_those_of_the_command_line(bench, tmp_path):
    """`oatkit roi` on the saved result and the saved places prints the same rows."""
    write_frames(tmp_path / "result.zarr", Result(images()))
    save_regions(PLACES, tmp_path / "places.toml")
    done = run_oatkit("roi", str(tmp_path / "result.zarr"), "-r", str(tmp_path / "places.toml"), "--json")
    printed = {(row["image"], row["region"], row["wavelength_nm"]): row for row in json.loads(done.stdout)}
    rows = Probe().rows(list(seen(bench.layers)), PLACES)
    assert len(rows) == len(printed)
    for row in rows:
        for name in ("mean", "std", "median", "pixels", "unit", "negative_share"):
            assert printed[row.image, row.region, row.wavelength_nm][name] == getattr(row, name)


def test_only_what_moves_is_measured_again(bench, monkeypatch):
    """With two places pinned, a move of the live one measures it alone, and nothing new measures nothing."""
    measured = []
    mask = EllipseRegion.mask
    monkeypatch.setattr(EllipseRegion, "mask", lambda self, grid: (measured.append(self.name), mask(self, grid))[1])
    probe, shown = Probe(), list(seen(bench.layers))
    pins = [EllipseRegion(name, (1e-3, 0.0), (5e-4, 5e-4)) for name in "12"]
    for x in (0.0, 1e-4, 1e-4):
        measured.clear()
        probe.rows(shown, [*pins, EllipseRegion(LIVE, (1e-3, x), (5e-4, 5e-4))])
    assert measured == []
    probe.rows(shown, [*pins, EllipseRegion(LIVE, (1e-3, 3e-4), (5e-4, 5e-4))])
    assert set(measured) == {LIVE}
    measured.clear()
    probe.rows([replace(one, image=absorption(7)) for one in shown], pins)
    assert set(measured) == {"1", "2"}


def test_hidden_images_are_not_probed(bench):
    """What is switched off, and the outline of the body, has no spectrum."""
    bench.layers.find("absorption").visible = False
    assert [one.key for one in seen(bench.layers)] == ["initial_pressure", "so2"]


@pytest.mark.parametrize("names", [["oxyhaemoglobin", "deoxyhaemoglobin"], ["lipid", "melanin", "water", "icg"]])
def test_a_mixture_is_found_exactly(names):
    """From the spectrum of a mixture the fit finds its concentrations and saturation, and leaves nothing over."""
    at = np.array([700.0, 730, 760, 790, 820, 850, 880])
    amounts = np.arange(1, len(names) + 1) / [np.linalg.norm(CHROMOPHORES[name].spectrum(at)) for name in names]
    mixture = sum(a * CHROMOPHORES[name].spectrum(at) for a, name in zip(amounts, names, strict=True))
    fit = fit_spectrum(at, mixture, names, "1/m")
    assert np.allclose(fit.concentrations, amounts, rtol=1e-9)
    assert fit.misfit < 1e-12
    if "oxyhaemoglobin" in names:
        assert fit.saturation == pytest.approx(amounts[0] / amounts.sum())
        assert "mol/m³" in fit.text


def test_the_fit_is_that_of_the_unmixer():
    """On noise, where bounds are active, the concentrations are those that the unmixer "nnls" gives a pixel."""
    names, at = ("oxyhaemoglobin", "deoxyhaemoglobin", "lipid"), (690.0, 730.0, 780.0, 830.0, 880.0)
    grid = Grid((1, 1), 1e-4)
    for seed in range(6):
        values = np.random.default_rng(seed).uniform(0, 30, (5, 1, 1))
        image = Image(values, "absorption", "1/m", grid, at)
        unmixed = plugin("unmixer", "nnls")(chromophores=names).unmix(UnmixProblem(image, absorption=image))
        fit = fit_spectrum(at, values.ravel(), names, "1/m")
        found = [unmixed[name].values.item() for name in names]
        assert np.allclose(fit.concentrations, found, rtol=1e-4, atol=1e-6 * max(found))
        assert fit.concentrations.min() == 0 or seed


def test_a_fit_that_cannot_be_is_refused_in_words():
    """Fewer wavelengths with a value than chromophores, or one beyond a table, is a sentence."""
    with pytest.raises(ValidationError, match="3 chromophores need as many wavelengths with a value; there are 2"):
        fit_spectrum([700, 800, 800, 900], np.array([1, 2, 2, np.nan]), ["water", "lipid", "melanin"], "1/m")
    with pytest.raises(ValidationError, match="covers"):
        fit_spectrum([700, 5000], np.ones(2), ["lipid"], "1/m")


def test_fits_are_drawn_over_what_they_fit(bench):
    """Absorption and pressure get dashed curves in their colours, with a warning; a fit that fails says why."""
    shown = list(seen(bench.layers))
    rows = Probe().rows(shown, PLACES[:2])
    found = spectra_of(rows, shown, ["oxyhaemoglobin", "deoxyhaemoglobin"])
    for plot in plots_of(found, 715.0, {"1": 1, "2": 2}):
        solid, dashed = plot.curves[::2], plot.curves[1::2]
        assert [curve.style for curve in dashed] == ["--", "--"]
        assert [curve.colour for curve in solid] == [curve.colour for curve in dashed] == [1, 2]
        assert plot.verticals == ((715.0, ""),)
    assert fit_lines(found, ["x"])[-1] == COLOURED
    many = list(CHROMOPHORES)[:4]
    assert "4 chromophores need" in fit_lines(spectra_of(rows, shown, many), many)[0]
    only_so2 = [one for one in shown if one.key == "so2"]
    assert fit_lines(spectra_of(Probe().rows(only_so2, PLACES), only_so2, many), many) == [NOTHING_TO_FIT]


def test_units_are_not_mixed(bench):
    """Pressure and absorption have plots of their own, two pressures share one; saturation is a value in the table."""
    bench.layers.show_result(Result({"initial_pressure": pressure(3)}), "other")
    shown = list(seen(bench.layers))
    rows = Probe().rows(shown, PLACES[:1])
    plots = plots_of(spectra_of(rows, shown), None, {"1": 1})
    labels = {plot.y_label: [curve.label for curve in plot.curves] for plot in plots}
    assert labels == {
        "initial pressure (a.u.)": ["initial pressure", "other: initial pressure"],
        "absorption (1/m)": [""],
    }
    (value,) = values_of(rows, shown)
    assert (value.image, value.place, value.text) == ("so2", "1", "0.7 ± 0")


def test_places_are_the_shapes_of_the_layer(bench):
    """A point, pins with the lowest free number, and shapes drawn or removed in the layer are what is probed."""
    layer = ProbeLayer(bench.layers)
    assert layer.places() == []
    layer.point((1e-3, -5e-4), 5e-4)
    (live,) = layer.places()
    assert (live.name, *np.round([*live.centre_m, *live.half_axes_m], 9)) == (LIVE, 1e-3, -5e-4, 5e-4, 5e-4)
    assert [layer.pin(), layer.pin()] == ["1", None]
    layer.point((0.0, 0.0), 3e-4)
    assert layer.pin() == "2"
    layer.unpin(["1"])
    layer.point((0.0, 1e-3), 3e-4)
    assert layer.pin() == "1"
    assert sorted(place.name for place in layer.places()) == ["1", "2"]
    shapes = layer.layer()
    assert list(shapes.features["place"]) == ["2", "1"]
    assert not np.array_equal(*shapes.edge_color)
    bench.viewer.layers.remove(shapes)
    assert layer.places() == []


def test_what_is_drawn_takes_the_place_of_the_one_before(bench):
    """Of shapes that the user draws the newest is live and the newest line counts, even after a pin was selected."""
    layer = ProbeLayer(bench.layers)
    layer.point((1e-3, 0.0), 5e-4)
    layer.pin()
    layer.use("add_rectangle")
    shapes = layer.layer()
    for size in (1.0, 2.0):
        shapes.selected_data = {0}  # what is drawn takes over the number of the pin
        shapes.add([[0, 0], [0, size], [size, size], [size, 0]], shape_type="rectangle")
        layer.tidy()
        pinned, live = layer.places()
        assert isinstance(live, RectangleRegion)
        assert (pinned.name, live.name) == ("1", LIVE)
        assert np.allclose(live.half_axes_m, 0.5e-3 * size, rtol=1e-5)
    assert shapes.nshapes == 2
    layer.use("add_line")
    for end in (1.0, 3.0):
        shapes.add([[0, 0], [end, -end]], shape_type="line")
        layer.tidy()
        assert np.allclose(layer.line(), [(0, 0), (-1e-3 * end, -1e-3 * end)], atol=1e-7)
    assert (shapes.nshapes, len(layer.places())) == (3, 2)
    layer.use("pan_zoom")
    assert bench.viewer.layers.selection.active is bench.layers.find("so2")


def drag(viewer, points_mm, button=1, modifiers=()):
    """Press, move and release the mouse at points of the world, and say which of the events were taken."""
    handled = []
    kinds = ["mouse_press"] + ["mouse_move"] * (len(points_mm) - 2) + ["mouse_release"]
    calls = {"mouse_press": mouse_press_callbacks, "mouse_move": mouse_move_callbacks}
    for kind, point in zip(kinds, points_mm, strict=True):
        position = (0.0,) * (viewer.dims.ndim - 2) + tuple(map(float, point))
        about = {"type": kind, "is_dragging": kind == "mouse_move", "position": position, "handled": False}
        about |= {"button": button, "modifiers": list(modifiers)}
        event = ReadOnlyWrapper(SimpleNamespace(**about), exceptions=("handled",))
        calls.get(kind, mouse_release_callbacks)(viewer, event)
        handled.append(event.handled)
    return handled


@pytest.fixture
def widget(bench, qtbot):
    """The widget on a viewer that has no window."""
    made = ProbeWidget(bench.viewer)
    qtbot.addWidget(made)
    made.resize(360, 900)
    made.show()
    made.wait = partial(wait_for, qtbot=qtbot)
    return made


def test_a_click_shows_the_spectra_there(widget, bench):
    """With Point on, a drag over any image moves the disc, and plots and table hold what the regions say of it."""
    assert drag(bench.viewer, [(-1, 0), (-1, 0)]) == [False, False]
    widget.tools.modes["Point"].click()
    widget.tools.radius.setValue(0.4)
    assert drag(bench.viewer, [(-1, 0), (-1, -0.3), (-1, -0.5), (-1, -0.5)]) == [True] * 4
    widget.wait(lambda: len(widget.rows) == 7)
    (place,) = widget.shapes.places()
    assert np.allclose([*place.centre_m, *place.half_axes_m], [1e-3, -5e-4, 4e-4, 4e-4], atol=1e-9)
    expected = region_table(images(), [place])
    assert widget.rows == sorted(expected, key=lambda row: [r.image for r in widget.rows].index(row.image))
    curve = widget.plots.plots[0].curves[0]
    assert list(curve.y) == [row.mean for row in expected if row.image == "initial_pressure"]
    assert list(curve.spread) == [row.std for row in expected if row.image == "initial_pressure"]
    table = widget.findings.table
    assert [table.item(0, i).text() for i in range(3)] == ["so2", LIVE, "0.7 ± 0"]


def test_clicks_that_are_not_for_the_probe_are_left_alone(widget, bench):
    """Other buttons, held keys, a drawing tool of another layer, and a widget that is hidden leave the mouse alone."""
    widget.tools.modes["Point"].click()
    assert drag(bench.viewer, [(-1, 0)] * 2, button=2) == [False] * 2
    assert drag(bench.viewer, [(-1, 0)] * 2, modifiers=["Shift"]) == [False] * 2
    boundary = bench.layers.find("boundary")
    bench.viewer.layers.selection.active = boundary
    boundary.mode = "direct"
    assert drag(bench.viewer, [(-1, 0)] * 2) == [False] * 2
    boundary.mode = "pan_zoom"
    assert drag(bench.viewer, [(-1, 0)] * 2) == [True] * 2
    widget.hide()
    assert drag(bench.viewer, [(-1, 0)] * 2) == [False] * 2
    widget.show()
    widget.tools.modes["Point"].click()
    assert drag(bench.viewer, [(-1, 0)] * 2) == [False] * 2


def test_a_point_of_a_plot_goes_to_its_wavelength(widget, bench):
    """A click on a point moves the slider there; the line in the plots follows the slider."""
    widget.tools.modes["Point"].click()
    drag(bench.viewer, [(-1, 0)] * 2)
    widget.wait(lambda: bool(widget.plots.plots))
    widget.plots.picked.emit(0, 0, 2)
    assert bench.viewing.wavelength_nm == 900
    widget.wait(lambda: widget.plots.plots[0].verticals == ((900.0, ""),))
    bench.viewing.go_to(700)
    widget.wait(lambda: widget.plots.plots[0].verticals == ((700.0, ""),))


def test_pins_go_into_the_table_that_is_saved(widget, bench, tmp_path):
    """The CSV has a row for each image, place and wavelength, equal to the regions' own; a pin let go of is gone."""
    widget.tools.modes["Point"].click()
    for x in (0.0, 1.0):
        drag(bench.viewer, [(-1, x)] * 2)
        widget.wait(lambda: any(row.region == LIVE for row in widget.rows))
        widget.tools.pin.click()
        widget.wait(lambda: not any(row.region == LIVE for row in widget.rows))
    widget.save_csv(tmp_path / "probe.csv")
    with (tmp_path / "probe.csv").open() as file:
        saved = {(row["region"], row["image"], row["wavelength_nm"]): row for row in csv.DictReader(file)}
    expected = region_table(images(), widget.shapes.places())
    assert len(saved) == len(expected) == 14
    for row in expected:
        line = saved[row.region, row.image, "" if row.wavelength_nm is None else str(row.wavelength_nm)]
        assert (float(line["mean"]), float(line["std"]), int(line["pixels"])) == (row.mean, row.std, row.pixels)
        assert line["unit"] == row.unit
    widget.tools.unpin.menu().actions()[0].trigger()
    widget.wait(lambda: {row.region for row in widget.rows} == {"2"})
    widget.save_png(tmp_path / "probe.png")
    assert (tmp_path / "probe.png").read_bytes().startswith(b"\x89PNG")


def test_a_line_gives_the_profiles_of_all_images(widget, bench, tmp_path):
    """Ramps along the line come back exactly, in mm, at the wavelength looked at, in plot and CSV alike."""
    x = np.broadcast_to(GRID.x_m, GRID.shape)
    planes = np.stack([1e3 * x + k for k in range(3)])
    show(bench, images() | {"absorption": Image(planes, "absorption", "1/m", GRID, WAVELENGTHS_NM)})
    bench.viewing.go_to(900)
    widget.tools.modes["Line"].click()
    widget.shapes.layer().add([[-1, -3], [-1, 2]], shape_type="line")
    widget.wait(lambda: bool(widget.traces))
    widget.save_csv(tmp_path / "line.csv")
    heading, *lines = csv.reader((tmp_path / "line.csv").read_text().splitlines())
    assert heading == ["distance_mm", "initial_pressure 900 nm (a.u.)", "absorption 900 nm (1/m)", "so2"]
    numbers = np.array([[float(text or "nan") for text in line] for line in lines])
    assert numbers[-1, 0] == pytest.approx(5)
    assert np.allclose(numbers[:, 2], -3 + numbers[:, 0] + 2, atol=1e-6)
    within = numbers[:, 0] >= 3 + 1e3 * saturation().grid.x_m[0]
    assert np.allclose(numbers[:, 3], np.where(within, 0.7, np.nan), equal_nan=True)
    curve = next(p for p in widget.plots.plots if p.y_label == "absorption (1/m)").curves[0]
    assert np.array_equal(curve.x, numbers[:, 0])
    assert np.array_equal(curve.y, numbers[:, 2])


def test_a_profile_says_how_wide_its_peak_is(bench):
    """A Gaussian of 1 mm has its width in words; where there is no value, the cell of the table is empty."""
    x = np.broadcast_to(GRID.x_m, GRID.shape)
    peak = np.exp(-((x + 5e-4) ** 2) / (2 * (1e-3 / 2.3548200450309493) ** 2))
    bench.layers.show(Image(peak, "absorption", "1/m", GRID), "absorption", visible=True)
    shown = [one for one in seen(bench.layers) if one.key == "absorption"]
    found = traces(shown, ((1e-3, -9e-3), (1e-3, 9e-3)), 2)
    (line,) = peak_lines(found)
    assert line.startswith("absorption: FWHM 1.0")
    assert [plot.y_label for plot in profile_plots(found)] == ["absorption (1/m)"]
    assert profile_csv(found).splitlines()[1] == "0.0,"


def test_the_probe_follows_the_frame(bench, qtbot, tmp_path):
    """Of a result of many frames the rows are those of the frame looked at, and say which it is."""
    frames = [Result({"initial_pressure": pressure(seed)}, frame_index=seed + 4) for seed in range(3)]
    long = bench_without_window()
    long.layers.show_result(load(write_frames(tmp_path / "long.zarr", *frames)))
    widget = ProbeWidget(long.viewer)
    qtbot.addWidget(widget)
    widget.show()
    widget.shapes.show(PLACES[0])
    for frame in (2, 0, 1):
        long.viewer.dims.set_current_step(0, frame)
        wait_for(lambda frame=frame: [row.frame for row in widget.rows] == [frame] * 3, qtbot)
        (place,) = widget.shapes.places()
        expected = region_table({"initial_pressure": pressure(frame)}, [place])
        assert [row.mean for row in widget.rows] == [row.mean for row in expected]
        assert widget.rows[0].scan_frame == frame + 4


def test_without_an_image_it_says_so(qtbot):
    """With nothing to probe, the widget asks for a scan, and no layer is made."""
    widget = ProbeWidget(ViewerModel())
    qtbot.addWidget(widget)
    widget.show()
    widget.tools.modes["Region"].click()
    wait_for(lambda: widget.message.text() == NOTHING_SHOWN, qtbot)
    assert len(widget.bench.viewer.layers) == 0


def test_lines_that_move_are_drawn_as_if_anew(qtbot):
    """Curves drawn over axes that stay give the pixels within them that drawing all of the plot gives."""

    def plot(shift):
        y = np.array([1.0, 3.0, 2.0]) + shift
        curves = (Curve("", (0, 1, 2), y, "o-", (0.1, 0.2, 0.1)), Curve("", (0, 1, 2), 2 * y, "--", colour=3))
        return Plot("t", curves, "x", "y", verticals=((1 + shift, ""),))

    view = PlotView(ViewerModel())
    view._rest.setInterval(1_000_000)  # however slow the machine, it is the motion that is looked at
    qtbot.addWidget(view)
    view.resize(360, 300)
    view.show()
    view.show_plots([plot(0.0)])
    pixels(view)
    start = pixels(view)
    for shift in (0.1, -0.1, 0.5, 0.0):
        view.show_plots([plot(shift)])
        quick = pixels(view)
        view._canvas.draw()
        assert np.array_equal(quick, pixels(view))
        assert not np.array_equal(quick, start) or shift == 0


def pixels(view):
    """What a view of plots has drawn within its axes, after these have had the time to be laid out."""
    QApplication.processEvents()
    box, whole = view._axes[0].bbox, np.array(view._canvas.buffer_rgba())
    (left, bottom), (right, top) = (np.round(corner).astype(int) for corner in (box.min + 2, box.max - 2))
    return whole[len(whole) - top : len(whole) - bottom, left:right]


def test_the_real_mouse_probes_and_pans(make_napari_viewer_proxy, qtbot):
    """In a real window a drag moves the point, draws a region or a line; with the probe off it moves the picture."""
    viewer = make_napari_viewer_proxy(show=True).__wrapped__
    widget = ProbeWidget(viewer)
    show(widget.bench, images())
    viewer.window.add_dock_widget(widget, name="Probe")
    qtbot.waitExposed(viewer.window._qt_window)
    qtbot.wait(500)  # until the dock has its width
    viewer.reset_view()
    widget.tools.modes["Point"].click()
    camera = viewer.scene.camera.center
    pull(viewer, (-1, -1.0), (-1, 0.5))
    wait_for(lambda: bool(widget.rows), qtbot)
    (place,) = widget.shapes.places()
    assert np.allclose(place.centre_m, (1e-3, 5e-4), atol=1e-4)
    widget.tools.modes["Region"].click()
    pull(viewer, (-2, -1.0), (-1, 0.5))
    wait_for(lambda: widget.shapes.layer().nshapes == 1, qtbot)
    (drawn,) = widget.shapes.places()
    assert isinstance(drawn, RectangleRegion)
    assert np.allclose([*drawn.centre_m, *drawn.half_axes_m], [1.5e-3, -2.5e-4, 5e-4, 7.5e-4], atol=1e-4)
    widget.tools.modes["Line"].click()
    pull(viewer, (-2, 1.0), (-1, -1.5))
    wait_for(lambda: bool(widget.traces), qtbot)
    assert np.allclose(widget.shapes.line(), [(2e-3, 1e-3), (1e-3, -1.5e-3)], atol=1e-4)
    assert viewer.scene.camera.center == camera
    widget.tools.modes["Line"].click()
    pull(viewer, (-1, 0.5), (-1, -1.0))
    assert widget.shapes.places() == [drawn]
    assert viewer.scene.camera.center != camera


def pull(viewer, start_mm, end_mm):
    """Drag the mouse over the canvas from one point of the world to another."""
    canvas = viewer.window._qt_viewer.canvas
    where = canvas.view.transform * canvas.view.scene.transform
    left, none = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
    ends = [where.map([point[1], point[0], 0, 1]) for point in (start_mm, end_mm)]
    start, end = (QPointF(x / w, y / w) for x, y, _, w in ends)
    for kind, at, button, held in (
        (QEvent.Type.MouseButtonPress, start, left, left),
        *[(QEvent.Type.MouseMove, start + (end - start) * part, none, left) for part in (0.3, 0.7, 1.0)],
        (QEvent.Type.MouseButtonRelease, end, left, none),
    ):
        event = QMouseEvent(kind, at, QPointF(canvas.native.mapToGlobal(at)), button, held, Qt.KeyboardModifier(0))
        QApplication.sendEvent(canvas.native, event)
        QApplication.processEvents()
