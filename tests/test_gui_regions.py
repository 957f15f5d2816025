"""Regions drawn in a viewer: they are the shapes of oatkit, and their numbers are those of the command line."""

# First, since it skips this module where napari is missing.
from gui_viewers import GRID, WAVELENGTHS_NM, bench_without_window, disc_boundary, pressure, wait_for  # isort: split

import csv
import json
import time
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.path import Path as Lines
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest

import results
from oatkit import Image
from oatkit.drawing.plot import ON_DARK
from oatkit.errors import ValidationError
from oatkit.gui.images.world import to_world
from oatkit.gui.job import Cancelled
from oatkit.gui.regions.corners import region_of, shape_of
from oatkit.gui.regions.drawn import DrawnRegions
from oatkit.gui.regions.numbers import at_plane, live_rows, plots, shown_images, write_table
from oatkit.gui.regions.widget import RegionsWidget
from oatkit.gui.workbench import workbench
from oatkit.plain import encode
from oatkit.regions import EllipseRegion, MaskRegion, PolygonRegion, RectangleRegion, save_regions
from oatkit.regions.table import COLUMNS, region_table
from oatkit.store import load
from packages import run_oatkit
from patato_files import write_patato

TURNED = EllipseRegion("vessel", (1.2e-3, -0.4e-3), (0.5e-3, 0.9e-3), 0.7)
BOX = RectangleRegion("muscle", (0.5e-3, 0.3e-3), (0.6e-3, 0.4e-3), -0.3)
TRIANGLE = PolygonRegion("fat", np.array([[0.0, 0.0], [0.0, 1.5e-3], [1e-3, 1e-3]]))


@pytest.fixture
def bench():
    """A workbench without a window."""
    return bench_without_window()


@pytest.fixture
def drawn(bench):
    """The regions of a viewer in which none is drawn."""
    return DrawnRegions(bench.layers)


def centres_in_viewer():
    """Where the pixels of the grid lie in the viewer, shape (pixel, 2)."""
    y, x = np.meshgrid(GRID.y_m, GRID.x_m, indexing="ij")
    return to_world(np.column_stack([y.ravel(), x.ravel()]))


def with_holes():
    """A mask of two parts, of which one has a hole, that reaches the edge of the grid."""
    pixels = np.zeros(GRID.shape, bool)
    pixels[3:12, 4:15] = True
    pixels[6:8, 7:10] = False
    pixels[14:20, 20:] = True
    return MaskRegion("pixels", pixels, GRID)


@pytest.mark.parametrize("kind", [EllipseRegion, RectangleRegion])
@pytest.mark.parametrize("angle", [-1.5, -0.8, 0.0, 0.3, 1.2])
def test_a_shape_is_its_region_to_the_last_digits(kind, angle):
    """Centre, half axes and angle come back from the corners to rounding of doubles."""
    region = kind("a", (1.3e-3, -2.1e-3), (0.4e-3, 1.7e-3), angle)
    back = region_of(*shape_of(region), "a")
    assert type(back) is kind
    assert np.allclose(back.centre_m, region.centre_m, rtol=1e-14, atol=1e-18)
    assert np.allclose(back.half_axes_m, region.half_axes_m, rtol=1e-14, atol=0)
    assert back.angle_rad == pytest.approx(angle, abs=1e-14)


@pytest.mark.parametrize("region", [BOX, TRIANGLE])
def test_a_region_lies_in_the_viewer_where_it_lies_in_space(region):
    """The pixels whose centres the viewer's lines enclose are those of the region; y points down there."""
    _, corners = shape_of(region)
    assert np.array_equal(Lines(corners).contains_points(centres_in_viewer()), region.mask(GRID).ravel())


def test_an_ellipse_lies_on_the_lines_that_the_viewer_draws(drawn):
    """The polygon that the viewer draws for an ellipse encloses the pixels of the region."""
    drawn.add([TURNED])
    (edge,) = drawn.layer._data_view.shapes[0]._face_vertices[None]
    line = edge[1:]  # the first is the middle
    assert np.array_equal(Lines(line).contains_points(centres_in_viewer()), TURNED.mask(GRID).ravel())


def test_a_rectangle_has_no_angle_whichever_corner_it_was_drawn_from():
    """From each corner, in both orders, a rectangle along the axes is the same region."""
    corners = np.array([[-2.0, 1.0], [-2.0, 4.0], [-1.0, 4.0], [-1.0, 1.0]])
    for start in range(4):
        for way in (1, -1):
            region = region_of("rectangle", np.roll(corners[::way], start, axis=0), "a")
            assert region.angle_rad == 0.0
            assert region.centre_m == pytest.approx((1.5e-3, 2.5e-3), rel=1e-14)
            assert region.half_axes_m == pytest.approx((0.5e-3, 1.5e-3), rel=1e-14)


def test_what_is_pulled_askew_stays_what_it_looks_like():
    """A sheared rectangle is a polygon; a sheared ellipse the ellipse through the sheared points."""
    shear = np.array([[1.0, 0.4], [0.0, 1.0]])
    _, corners = shape_of(BOX)
    assert isinstance(region_of("rectangle", corners @ shear, "a"), PolygonRegion)
    kind, corners = shape_of(TURNED)
    region = region_of(kind, corners @ shear, "a")
    points = 1e-3 * to_world(TURNED.outline_m) @ shear * (-1, 1)
    centre, angle = np.array(region.centre_m), region.angle_rad
    y, x = (points - centre).T
    along = np.array([np.cos(angle) * y - np.sin(angle) * x, np.sin(angle) * y + np.cos(angle) * x])
    assert np.allclose(((along.T / region.half_axes_m) ** 2).sum(axis=1), 1, rtol=1e-12)


@pytest.mark.parametrize("kind", ["line", "path"])
def test_a_line_is_no_region(kind):
    """What encloses nothing is refused with a sentence."""
    with pytest.raises(ValidationError, match="encloses nothing"):
        region_of(kind, np.array([[0.0, 0.0], [1.0, 1.0]]), "a")


def test_the_line_around_pixels_encloses_them_and_no_others(drawn):
    """Also where there are two parts and a hole; moved by whole pixels it encloses the pixels there."""
    mask = with_holes()
    kind, corners = shape_of(mask)
    assert np.array_equal(region_of(kind, corners, "a").mask(GRID), mask.pixels)
    drawn.add([mask])
    assert drawn.read()[0] == [mask]
    pixel = 1e3 * GRID.pixel_size_m
    drawn.layer._data_view.shift(0, np.array([-2 * pixel, 0]))
    drawn.layer.refresh()
    (moved,), _ = drawn.read()
    assert isinstance(moved, PolygonRegion)
    assert np.array_equal(moved.mask(GRID)[2:], mask.pixels[:-2])


def test_regions_come_back_to_the_last_bit(drawn):
    """What was put in is read equal, whatever single precision the viewer keeps, and saved so."""
    regions = [TURNED, BOX, TRIANGLE, with_holes()]
    drawn.add(regions)
    drawn.rename(0, "artery")
    drawn.recolour(1, "#ff0000")
    assert drawn.read() == ([replace(TURNED, name="artery"), *regions[1:]], [])
    assert drawn.colours == [ON_DARK[0], "#ff0000", *ON_DARK[2:4]]


def test_turned_by_the_viewer_a_rectangle_keeps_its_sides(drawn):
    """A quarter of a right angle, clockwise on the screen, is minus that angle, about the same centre."""
    drawn.add([replace(BOX, angle_rad=0.2)])
    centre = drawn.layer.data[0].mean(axis=0)
    drawn.layer._data_view.rotate(0, 22.5, center=centre)
    drawn.layer.refresh()
    (turned,), _ = drawn.read()
    assert turned.angle_rad == pytest.approx(0.2 - np.pi / 8, abs=1e-6)
    assert turned.half_axes_m == pytest.approx(BOX.half_axes_m, rel=1e-6)
    assert turned.centre_m == pytest.approx(BOX.centre_m, rel=1e-6)


def test_no_two_regions_have_one_name(drawn):
    """Drawn, pasted and imported ones get numbers; a name that is taken or empty is refused."""
    square = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])
    for _ in range(2):
        drawn.layer.add(square, shape_type="rectangle")
    drawn.add([TURNED, TURNED])
    assert drawn.names == ["region 1", "region 2", "vessel", "vessel 2"]
    drawn.layer.selected_data = {2}
    drawn.layer._copy_data()
    drawn.layer._paste_data()
    assert drawn.names == ["region 1", "region 2", "vessel", "vessel 2", "vessel 3"]
    drawn.remove(0)
    drawn.layer.add(square, shape_type="rectangle")
    assert drawn.names == ["region 2", "vessel", "vessel 2", "vessel 3", "region 1"]
    assert list(drawn.layer.text.values) == drawn.names
    with pytest.raises(ValidationError, match="cannot have the name 'vessel'"):
        drawn.rename(0, "vessel")
    with pytest.raises(ValidationError, match="needs a name"):
        drawn.rename(0, "  ")


def test_each_change_is_told_and_nothing_else(drawn):
    """One word for a move, a name, a colour, an end; none where the viewer only paints again."""
    heard = []
    drawn.add([TURNED, BOX])
    drawn.changed.connect(lambda: heard.append(drawn.names))
    drawn.layer.refresh()
    assert heard == []
    drawn.layer._data_view.shift(0, np.array([0.1, 0.0]))
    drawn.layer.refresh()
    drawn.rename(0, "artery")
    drawn.remove(1)
    drawn.layers.viewer.layers.remove(drawn.layer)
    assert heard == [["vessel", "muscle"], ["artery", "muscle"], ["artery"], []]


def test_too_small_a_shape_is_said_and_the_others_are_measured(drawn):
    """A click without a drag makes no region, and no error."""
    drawn.add([TURNED])
    drawn.layer.add(np.zeros((4, 2)), shape_type="ellipse")
    regions, wrong = drawn.read()
    assert regions == [TURNED]
    assert "region 1" in wrong[0]


# Numbers


@pytest.fixture
def long_result(tmp_path):
    """A stored result of four frames, of which the second one failed."""
    frames = [results.make_result(0), "no signal", results.make_result(2), results.make_result(3)]
    return load(results.write_frames(tmp_path / "long.zarr", *frames))


ON_RESULT = [
    EllipseRegion("in", results.GRID.centre_m, (5e-4, 7e-4), 0.4),
    RectangleRegion("out", results.GRID.centre_m, (1.2e-3, 1e-3)),
]


def show_all(bench):
    """Switch all layers on."""
    for layer in bench.viewer.layers:
        layer.visible = True


def test_the_table_is_that_of_the_command(bench, drawn, long_result, tmp_path):
    """Each row equals that of `oatkit roi` on the saved regions and the stored result, at each frame."""
    bench.layers.show_result(long_result)
    show_all(bench)
    drawn.add(ON_RESULT)
    save_regions(drawn.read()[0], tmp_path / "regions.toml")
    command = ("roi", str(long_result.stored.path), "-r", str(tmp_path / "regions.toml"), "--background", "out")
    for frame in (2, 0):
        bench.viewer.dims.set_current_step(0, frame)
        rows, notes = live_rows(shown_images(bench.layers), drawn.read()[0], "out")
        done = run_oatkit(*command, "--frame", str(frame), "--json")
        assert done.returncode == 0, done.stderr
        ours = sorted(({name: encode(getattr(row, name)) for name in COLUMNS} for row in rows), key=json.dumps)
        assert ours == sorted(json.loads(done.stdout), key=json.dumps)
        assert notes == []
    bench.viewer.dims.set_current_step(0, 1)
    assert live_rows(shown_images(bench.layers), drawn.read()[0])[0] == []


def finished(job):
    """What a job yielded, after its end."""
    assert job.wait(30)
    assert job.failure is None, job.failure.details
    return job.drain()


def test_all_frames_are_written_as_the_command_writes_them(bench, long_result, tmp_path):
    """The file has the lines of `oatkit roi`'s for every frame that did not fail, and progress counts the frames."""
    bench.layers.show_result(long_result)
    show_all(bench)
    save_regions(ON_RESULT, tmp_path / "regions.toml")
    command = ("roi", str(long_result.stored.path), "-r", str(tmp_path / "regions.toml"), "-o", str(tmp_path / "a.csv"))
    assert run_oatkit(*command).returncode == 0
    shown = shown_images(bench.layers)
    told = finished(write_table(shown, ON_RESULT, None, tmp_path / "b.csv", all_frames=True))
    assert told == [(0, 1), (1, 3), (2, 3), (3, 3), tmp_path / "b.csv"]
    lines = [sorted(csv.reader((tmp_path / name).read_text().splitlines())) for name in ("a.csv", "b.csv")]
    assert lines[0] == lines[1]
    assert len(lines[0]) == 1 + 3 * 2 * 2 * 2
    finished(write_table(shown, ON_RESULT, None, tmp_path / "b.csv", all_frames=False))
    assert len((tmp_path / "b.csv").read_text().splitlines()) == 1 + 2 * 2 * 2


def test_a_table_that_is_cancelled_leaves_the_file_that_was_there(bench, long_result, tmp_path, monkeypatch):
    """Cancelled between two frames, the writing ends; the old file stays and no other."""
    bench.layers.show_result(long_result)
    (tmp_path / "table.csv").write_text("old")

    def stopped(job):
        raise Cancelled

    monkeypatch.setattr("oatkit.gui.job.Job.check", stopped)
    job = write_table(shown_images(bench.layers), ON_RESULT, None, tmp_path / "table.csv", all_frames=True)
    assert job.wait(10)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["long.zarr", "table.csv"]
    assert (tmp_path / "table.csv").read_text() == "old"


def test_frames_of_a_scanner_are_measured_too(bench, tmp_path):
    """Images that came with a scan have no result: each of their frames has its rows, under its number."""
    frames = [pressure(seed) for seed in range(3)]
    bench.layers.show_images({"initial_pressure": frames}, "scanner", visible=True)
    bench.viewer.dims.set_current_step(0, 2)
    shown = shown_images(bench.layers)
    rows, _ = live_rows(shown, [TURNED])
    assert [row.frame for row in rows] == [2, 2, 2]
    assert rows[0].mean == region_table({"p": frames[2]}, [TURNED])[0].mean
    finished(write_table(shown, [TURNED], None, tmp_path / "table.csv", all_frames=True))
    lines = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert [line["frame"] for line in lines] == [str(frame) for frame in range(3) for _ in WAVELENGTHS_NM]
    expected = [row.mean for frame in frames for row in region_table({"p": frame}, [TURNED])]
    assert [float(line["mean"]) for line in lines] == expected


def test_nothing_to_write_is_said(bench, tmp_path):
    """Without a visible image or without a region there is no file."""
    with pytest.raises(ValidationError, match="no regions in a visible image"):
        write_table(shown_images(bench.layers), [TURNED], None, tmp_path / "a.csv", all_frames=True)


def test_rows_are_of_the_wavelength_that_is_looked_at(bench):
    """An image of one plane is there at every wavelength, one of fewer wavelengths not at the later ones."""
    flat = Image(np.full(GRID.shape, 0.5, np.float32), "so2", "", GRID)
    images = {"initial_pressure": pressure(), "so2": flat, "few": pressure(1, (700.0, 715.0))}
    for name, image in images.items():
        bench.layers.show(image, name, visible=True)
    bench.layers.show(disc_boundary(), "boundary", visible=True)
    rows, _ = live_rows(shown_images(bench.layers), [TURNED, BOX], "muscle")
    assert sorted(rows, key=str) == sorted(region_table(images, [TURNED, BOX], "muscle"), key=str)
    for plane, wavelength in enumerate(WAVELENGTHS_NM):
        found = {(row.image, row.wavelength_nm) for row in at_plane(rows, plane)}
        few = {("few", wavelength)} if plane < 2 else set()
        assert found == {("initial_pressure", wavelength), ("so2", None)} | few


def test_what_cannot_be_measured_is_said_and_the_rest_is_measured(bench):
    """Pixels of another grid have no rows here; their background is none; hidden images are not measured."""
    strange = MaskRegion("strange", np.ones((5, 5), bool), results.GRID.__class__((5, 5), 1e-4))
    bench.layers.show(pressure(), "initial_pressure")
    bench.layers.show(pressure(1), "absorption", visible=False)
    rows, notes = live_rows(shown_images(bench.layers), [strange, TURNED], "strange")
    assert {(row.image, row.region, row.cnr) for row in rows} == {("initial_pressure", "vessel", None)}
    assert "'strange' belongs to the pixels of another image" in notes[0]


def test_spectra_have_the_colours_of_their_regions(bench):
    """A curve for each region with the table's means, in its colour, and a line at the wavelength looked at."""
    bench.layers.show(pressure(), "initial_pressure")
    rows, _ = live_rows(shown_images(bench.layers), [TURNED, BOX])
    (plot,) = plots(rows, {"vessel": 4, "muscle": None}, 715.0)
    assert [(curve.label, curve.colour) for curve in plot.curves] == [("vessel", 4), ("muscle", None)]
    assert list(plot.curves[1].y) == [row.mean for row in rows if row.region == "muscle"]
    assert plot.verticals[0][0] == 715.0
    assert plot.y_label == "a.u."


# The widget


def test_regions_of_a_file_are_offered_and_saved(bench, qtbot, tmp_path, small_scan):
    """A scan by PATATO brings its regions at a click; saved and imported they are equal; what fails is a sentence."""
    widget = RegionsWidget(bench.viewer)
    qtbot.addWidget(widget)
    widget.scans.click()
    assert widget.message.text() == "no scan is open"
    bench.session.open_scan(write_patato(tmp_path / "scan.hdf5"))
    widget.scans.click()
    regions, wrong = widget.regions.read()
    assert len(regions) > 0
    assert wrong == []
    widget.save_file(tmp_path / "regions.toml")
    while widget.regions.names:
        widget.regions.remove(0)
    widget.import_file(tmp_path / "regions.toml")
    assert widget.regions.read()[0] == regions
    (tmp_path / "bad.toml").write_text("version = 7")
    widget.import_file(tmp_path / "bad.toml")
    assert "version: must be 1" in widget.message.text()
    assert widget.regions.read()[0] == regions


def test_a_picture_of_labels_is_measured_pixel_for_pixel(bench, qtbot, tmp_path):
    """Labels drawn on the image that is shown keep their pixels; saving them as shapes is refused with a sentence."""
    widget = RegionsWidget(bench.viewer)
    qtbot.addWidget(widget)
    shown = pressure()
    bench.layers.show(shown, "initial_pressure")
    labels = with_holes().pixels.astype(np.uint8)
    np.save(tmp_path / "labels.npy", labels)
    widget.import_file(tmp_path / "labels.npy")
    widget.show_numbers()
    assert widget.rows[0].mean == pytest.approx(shown.values[0][labels > 0].mean(dtype=float))
    widget.save_file(tmp_path / "regions.toml")
    assert "made of pixels" in widget.message.text()


def texts(widget, heading):
    """A column of the table as it is read."""
    model = widget.table.model()
    column = next(i for i in range(model.columnCount()) if model.headerData(i, Qt.Orientation.Horizontal) == heading)
    return [model.data(model.index(row, column)) for row in range(model.rowCount())]


def test_a_region_drawn_with_the_mouse_is_measured(make_napari_viewer_proxy, qtbot, tmp_path):
    """Dragged over the picture it is the ellipse in mm, and its numbers follow wavelength, image, name and end."""
    viewer = make_napari_viewer_proxy(show=True)
    bench = workbench(viewer)
    widget = RegionsWidget(viewer)
    viewer.window.add_dock_widget(widget, name="Regions")
    shown = pressure()
    bench.layers.show(shown, "initial_pressure")
    bench.layers.show(Image(np.ones(GRID.shape, np.float32), "absorption", "1/m", GRID), "absorption", visible=False)
    viewer.reset_view()
    widget.tools["add_ellipse"].click()
    qtbot.wait(300)  # the window finds its size
    corners = np.array([[-2.0, -1.5], [-0.6, 0.7]])
    drag(bench.viewer, *corners, qtbot)
    wait_for(lambda: bool(widget.rows), qtbot)
    (region,), _ = widget.regions.read()
    dot = 1e-3 / viewer.scene.camera.zoom
    assert region.centre_m == pytest.approx((1.3e-3, -0.4e-3), abs=dot)
    assert region.half_axes_m == pytest.approx((0.7e-3, 1.1e-3), abs=dot)
    for plane, wavelength in enumerate(WAVELENGTHS_NM):
        bench.viewing.go_to(wavelength)
        mean = f"{shown.values[plane][region.mask(GRID)].mean(dtype=float):.4g}"
        wait_for(lambda mean=mean: texts(widget, "mean") == [mean], qtbot)
    widget.all_wavelengths.click()
    assert texts(widget, "nm") == [f"{wavelength:g}" for wavelength in WAVELENGTHS_NM]
    widget.all_wavelengths.click()
    bench.layers.find("absorption").visible = True
    wait_for(lambda: texts(widget, "image") == ["initial_pressure (a.u.)", "absorption (1/m)"], qtbot)
    widget.list.item(0, 1).setText("artery")
    wait_for(lambda: texts(widget, "region") == ["artery", "artery"], qtbot)
    widget.save_table(tmp_path / "table.csv")
    wait_for(lambda: widget.note.text() == "wrote table.csv", qtbot)
    assert len((tmp_path / "table.csv").read_text().splitlines()) == 1 + 3 + 1
    widget.save_plot(tmp_path / "spectra.png")
    assert (tmp_path / "spectra.png").read_bytes().startswith(b"\x89PNG")
    widget.list.cellWidget(0, 2).click()
    wait_for(lambda: texts(widget, "mean") == [], qtbot)


def drag(viewer, start_mm, end_mm, qtbot):
    """Drag the mouse over the picture between two points in mm."""
    canvas, camera = viewer.window._qt_viewer.canvas.native, viewer.scene.camera
    middle = np.array([canvas.height(), canvas.width()]) / 2

    def at(point):
        y, x = middle + (np.asarray(point) - camera.center[-2:]) * camera.zoom
        return QPoint(round(x), round(y))

    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=at(start_mm))
    for share in (0.3, 0.7, 1.0):
        QTest.mouseMove(canvas, at(start_mm + share * (end_mm - start_mm)))
        qtbot.wait(20)
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=at(end_mm))
    time.sleep(0.05)
