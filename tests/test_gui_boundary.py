"""The outline of the body changed by hand: it is kept, it is what the engine runs with, and it can be taken back."""

# First, since it skips this module where napari is missing.
from gui_viewers import GRID, bench_without_window, disc_boundary, pressure, wait_for  # isort: split

import tomllib

import numpy as np
import pytest

import oatkit
from gui_sessions import small_session
from oatkit import Grid, Image
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import KEY
from oatkit.gui.images.world import from_world, outlines, to_world
from oatkit.gui.pipeline.widget import PipelineWidget
from oatkit.gui.regions.boundary import GONE, MANY, SEVERAL, STORED, Outline, outline_of, simplified
from oatkit.gui.regions.boundary_panel import NOBODY_RUNS
from oatkit.gui.regions.widget import RegionsWidget
from oatkit.gui.session import Converging, Finished
from oatkit.gui.workbench import workbench
from oatkit.outlines import hausdorff_m
from oatkit.polygons import area, signed_distance
from oatkit.result import Result
from oatkit.store import load
from results import write_frames

EIGHT = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 3.0]]
"""An outline of which the first side crosses the third."""
ANGLES = 2 * np.pi * np.arange(48) / 48


def circle_mm(radius_mm, centre_yx_mm=(0.0, 0.0)):
    """Corners on a circle, each (y, x), y upwards."""
    return np.column_stack([np.sin(ANGLES), np.cos(ANGLES)]) * radius_mm + centre_yx_mm


@pytest.fixture
def bench():
    """A workbench without a window, in which an outline is shown."""
    made = bench_without_window()
    made.layers.show(disc_boundary(1.5e-3), "boundary")
    return made


@pytest.fixture
def outline(bench):
    """The outline of that viewer."""
    return Outline(bench)


def change(layer, index, line, kind=None):
    """Give a shape other corners, as the tools of the viewer do, and tell."""
    from napari.layers.shapes._shapes_constants import shape_classes

    layer._data_view.edit(index, np.asarray(line), new_type=None if kind is None else shape_classes[kind])
    layer.events.data(value=layer.data, action="changed", data_indices=(index,), vertex_indices=((0,),))
    layer.refresh()


def grow(layer, by=1.2):
    """Move all corners of the first outline away from the middle."""
    middle = layer.data[0].mean(axis=0)
    change(layer, 0, middle + by * (layer.data[0] - middle))


def radius_mm(layer):
    """Of the circle that has the area of the first outline."""
    return 1e3 * np.sqrt(abs(area(from_world(layer.data[0]))) / np.pi)


def star(seed, most_waves=7):
    """The signed distance to a wavy outline."""
    grid = Grid((120, 140), 2e-4, (1e-3, -5e-4))
    rng, angle = np.random.default_rng(seed), np.linspace(0, 2 * np.pi, 400, endpoint=False)
    waves = sum(rng.uniform(-0.05, 0.05) * np.cos(n * angle + rng.uniform(0, 6)) for n in range(2, most_waves + 1))
    radius = 9e-3 * (1 + waves)
    line = np.column_stack([radius * np.sin(angle), radius * np.cos(angle)]) + grid.centre_m
    return Image(signed_distance(line, grid), "boundary", "m", grid)


@pytest.mark.parametrize("seed", range(4))
def test_a_simplified_outline_is_within_half_a_pixel(seed):
    """Few corners, all from the outline drawn, and neither it nor the contour is further than that from the other."""
    boundary = star(seed)
    (line,) = outlines(boundary)
    few = simplified(line, 1e3 * boundary.grid.pixel_size_m)
    assert len(few) <= MANY < len(line)
    assert {tuple(corner) for corner in few} <= {tuple(corner) for corner in line}
    assert hausdorff_m(boundary, from_world(few)) <= 0.5 * boundary.grid.pixel_size_m
    assert np.array_equal(simplified(few, 0.2), few)


def test_a_rough_outline_keeps_the_corners_that_it_needs():
    """Where few corners are not enough there are more, and the outline is still within half a pixel."""
    boundary = star(1, most_waves=25)
    line = max(outlines(boundary), key=lambda one: abs(area(one)))
    few = simplified(line, 1e3 * boundary.grid.pixel_size_m)
    assert MANY < len(few) < len(line)
    outer = Image(signed_distance(from_world(line), boundary.grid), "boundary", "m", boundary.grid)
    assert hausdorff_m(outer, from_world(few)) <= 0.5 * boundary.grid.pixel_size_m


def test_corners_are_few_while_they_are_moved(bench):
    """Beginning to edit draws the simplified outline, leaving it without a change the full one again."""
    boundary = star(0)
    layer, outline = bench.layers.show(boundary, "boundary"), Outline(bench)
    (full,) = outlines(boundary)
    assert len(layer.data[0]) == len(full)
    outline.edit()
    assert layer.mode == "direct"
    assert set(layer.selected_data) == {0}
    assert len(layer.data[0]) <= MANY
    assert not outline.edited
    layer.mode = "pan_zoom"
    assert np.allclose(layer.data[0], full)
    layer.mode = "vertex_insert"
    assert len(layer.data[0]) <= MANY
    grow(layer)
    layer.mode = "pan_zoom"
    assert len(layer.data[0]) <= MANY
    assert outline.edited


def test_an_outline_by_hand_is_one_edit_of_the_pipeline(bench, outline):
    """Taken, it stands as polygon in mm with y upwards; one undo brings the segmenter and its outline back."""
    document, layer = bench.session.document, outline.layer
    document.add("segment", "radial")
    text = document.text
    grow(layer)
    assert outline.edited
    outline.take()
    assert not outline.edited
    table = tomllib.loads(document.text)["segment"]
    assert table["use"] == "polygon"
    assert np.allclose(to_world(1e-3 * np.array(table["vertices"])), layer.data[0], atol=1e-6)
    assert np.mean(table["vertices"], axis=0) == pytest.approx(1e3 * np.array(GRID.centre_m), abs=0.05)
    assert radius_mm(layer) == pytest.approx(1.8, rel=0.02)
    assert document.text.replace(str(table["vertices"]), "").count("[") == text.count("[")
    document.undo()
    bench.pipeline_changed.emit()
    assert document.text == text
    assert radius_mm(layer) == pytest.approx(1.5, rel=0.02)
    document.redo()
    bench.pipeline_changed.emit()
    assert radius_mm(layer) == pytest.approx(1.8, rel=0.02)
    bench.layers.show(disc_boundary(1e-3), "boundary")
    bench.result_changed.emit()
    assert radius_mm(layer) == pytest.approx(1.8, rel=0.02)
    document.set("segment", "use", "radial")
    bench.pipeline_changed.emit()
    assert radius_mm(layer) == pytest.approx(1.0, rel=0.03)


def test_all_else_in_the_pipeline_stays_as_it_was_written(bench, outline):
    """The keys of the old segmenter go, comments and all other tables stay to the letter."""
    head = '# mine\nversion = 1\n[reconstruct]\nuse = "lsqr" # fast\n\n[forward]\nuse = "arc"\n\n[segment] # the body\n'
    tail = '\n[optics] # of a mouse\ntissue = "soft-tissue"\n'
    bench.session.document.replace(head + 'use = "radial"\nblur = 0.2\n' + tail)
    outline.take()
    text = bench.session.document.text
    assert text.startswith(head + 'use = "polygon"\nvertices = [[')
    assert text.endswith("]]\n" + tail)


def test_what_was_changed_is_not_drawn_over(bench, outline):
    """A new result leaves the outline that is being changed; put back, it is the new result's. Without care it goes."""
    layer = outline.layer
    grow(layer)
    changed = layer.data[0].copy()
    bench.layers.show(disc_boundary(1e-3), "boundary")
    bench.result_changed.emit()
    assert np.array_equal(layer.data[0], changed)
    assert outline.edited
    outline.put_back()
    assert radius_mm(layer) == pytest.approx(1.0, rel=0.03)
    assert not outline.edited
    grow(layer)
    outline.close()
    bench.layers.show(disc_boundary(1.5e-3), "boundary")
    assert radius_mm(layer) == pytest.approx(1.5, rel=0.02)


def test_another_frame_leaves_what_was_changed(bench, tmp_path):
    """While an outline of a stored result is changed the slider moves under it; put back, it is that frame's."""
    frames = [
        Result({"initial_pressure": pressure(), "boundary": disc_boundary(radius)}, frame_index=i)
        for i, radius in enumerate((1e-3, 1.2e-3, 1.4e-3))
    ]
    bench.layers.show_result(load(write_frames(tmp_path / "long.zarr", *frames)), "long")
    layer, outline = bench.layers.find("long/boundary"), Outline(bench)
    bench.viewer.layers.selection.active = layer
    bench.viewer.dims.set_current_step(0, 1)
    assert radius_mm(layer) == pytest.approx(1.2, rel=0.03)
    grow(layer, 1.5)
    bench.viewer.dims.set_current_step(0, 2)
    assert radius_mm(layer) == pytest.approx(1.8, rel=0.03)
    outline.put_back()
    assert radius_mm(layer) == pytest.approx(1.4, rel=0.03)
    grow(layer, 1.5)
    outline.take()
    assert radius_mm(layer) == pytest.approx(1.4, rel=0.03)
    assert radius_mm(bench.layers.find("boundary")) == pytest.approx(2.1, rel=0.03)
    assert len(outline_of(bench.session.pipeline)) == len(bench.layers.find("boundary").data[0])


def test_a_stored_result_shows_its_own_outline(bench, tmp_path):
    """Taken from a frame of one that stands for the last run, the outline is in the pipeline alone, which is said."""
    frames = [Result({"initial_pressure": pressure(), "boundary": disc_boundary(1e-3)}, frame_index=i) for i in (0, 1)]
    bench.layers.remove("boundary")
    bench.layers.show_result(load(write_frames(tmp_path / "long.zarr", *frames)))
    layer, outline = bench.layers.find("boundary"), Outline(bench)
    grow(layer, 1.5)
    outline.take()
    assert radius_mm(layer) == pytest.approx(1.0, rel=0.03)
    assert outline.word == STORED
    assert np.sqrt(abs(area(outline_of(bench.session.pipeline))) / np.pi) == pytest.approx(1.5, rel=0.03)


def test_an_outline_goes_with_its_image_and_a_word(bench, outline):
    """Where the layer is removed the change is gone, which is said."""
    grow(outline.layer)
    bench.layers.remove("boundary")
    assert outline.layer is None
    assert not outline.edited
    assert outline.word == GONE


def test_an_outline_that_crosses_itself_is_refused(bench, outline):
    """A figure of eight is refused with a sentence; the pipeline stays, and the outline to be mended."""
    text, layer = bench.session.document.text, outline.layer
    change(layer, 0, EIGHT)
    with pytest.raises(ValidationError, match="the side from corner 0 crosses the one from corner 2"):
        outline.take()
    assert bench.session.document.text == text
    assert outline.edited


@pytest.mark.parametrize("kind", ["line", "path"])
def test_a_line_is_no_outline(bench, outline, kind):
    """A line drawn in place of an outline is refused with a sentence."""
    outline.layer.add(np.array([[0.0, 0.0], [1.0, 1.0]]), shape_type=kind)
    with pytest.raises(ValidationError, match="a line encloses nothing"):
        outline.take()


def test_a_new_outline_stands_for_the_old_one(bench, outline):
    """Drawn beside the old one it is taken, also where it is smaller; an ellipse becomes a polygon within 0.2 %."""
    layer = outline.layer
    middle = layer.data[0].mean(axis=0)
    layer.add(middle + np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]]), shape_type="ellipse")
    outline.take()
    assert layer.nshapes == 1
    assert outline.word == SEVERAL
    corners = outline_of(bench.session.pipeline)
    assert len(corners) == 64
    assert abs(area(corners)) == pytest.approx(np.pi, rel=2e-3)
    assert np.allclose(np.hypot(*(corners - 1e3 * from_world(middle)).T), 1.0, atol=1e-4)


def test_of_a_body_with_a_hole_the_outer_line_is_taken(bench):
    """Whichever of the two lines was moved."""
    y, x = GRID.y_m[:, None] - GRID.centre_m[0], GRID.x_m[None, :] - GRID.centre_m[1]
    ring = Image(abs(np.hypot(y, x) - 1.2e-3) - 4e-4, "boundary", "m", GRID)
    layer, outline = bench.layers.show(ring, "boundary"), Outline(bench)
    assert layer.nshapes == 2
    inner = int(np.argmin([abs(area(line)) for line in layer.data]))
    change(layer, inner, layer.data[inner] + 0.05)
    outline.take()
    assert outline.word == SEVERAL
    assert np.sqrt(abs(area(outline_of(bench.session.pipeline))) / np.pi) == pytest.approx(1.6, rel=0.02)


def test_a_body_can_be_drawn_where_none_was_found():
    """Without any outline a layer for it comes, and what is drawn there is taken; removed, it can be put back."""
    bench = bench_without_window()
    outline = Outline(bench)
    with pytest.raises(ValidationError, match="no outline to edit"):
        outline.edit()
    outline.draw_anew()
    layer = outline.layer
    assert (layer.nshapes, layer.mode) == (0, "add_polygon")
    layer.add(to_world(1e-3 * circle_mm(3.0)), shape_type="polygon")
    outline.take()
    assert layer.mode == "pan_zoom"
    assert np.allclose(outline_of(bench.session.pipeline), circle_mm(3.0), atol=1e-4)
    layer.selected_data = {0}
    layer.remove_selected()
    assert not outline.edited
    outline.put_back()
    assert radius_mm(layer) == pytest.approx(3.0, rel=0.01)


# The light follows


def lit(scan, radius):
    """A session whose pipeline has a body of a circle and the light in it."""
    session = small_session(scan)
    session.document.put("segment", {"use": "polygon", "vertices": circle_mm(radius).tolist()})
    session.document.put("optics", {"absorption_per_cm": 0.3, "reduced_scattering_per_cm": 10.0})
    session.document.put("fluence", {"use": "diffusion-fvm"})
    session.document.put("absorption", {})
    return session


def ran(session):
    """The result of running a session, and whether a solver had to work."""
    job = session.run()
    assert job.wait(60)
    assert job.failure is None, job.failure.details
    items = job.drain()
    result = next(item.result for item in items if isinstance(item, Finished))
    return result, any(isinstance(item, Converging) for item in items)


def centre(result):
    """The fluence in the middle of the body."""
    values = result["fluence"].values[0]
    return values[values.shape[0] // 2, values.shape[1] // 2]


def test_moved_out_by_a_millimetre_the_light_falls_to_what_the_engine_gives(small_scan):
    """The fluence at the centre falls; all images equal, to the bit, those of a run of the saved text without a window.

    What comes before the outline is not computed again.
    """
    bench = bench_without_window()
    bench.session = lit(small_scan, 3.0)
    before, solved = ran(bench.session)
    assert solved
    bench.layers.show_result(before)
    outline = Outline(bench)
    layer = outline.layer
    change(layer, 0, layer.data[0] * (4.0 / 3.0))
    outline.take()
    after, solved = ran(bench.session)
    assert not solved
    assert after["initial_pressure"] is before["initial_pressure"]
    assert centre(after) < 0.9 * centre(before)
    given = outline_of(bench.session.pipeline)
    assert np.hypot(*given.T) == pytest.approx(4.0, abs=0.05)
    headless = oatkit.run(oatkit.Pipeline.loads(bench.session.document.text, "saved"), small_scan)
    for name in ("initial_pressure", "boundary", "fluence", "absorption"):
        assert np.array_equal(headless[name].values, after[name].values, equal_nan=True), name
    bench.layers.show_result(after)
    bench.result_changed.emit()
    assert np.allclose(from_world(layer.data[0]), 1e-3 * given, atol=1e-9)


def test_run_at_once_the_fluence_follows_each_change(make_napari_viewer_proxy, small_scan, qtbot):
    """With the switch on, a moved corner runs the pipeline by itself, and the layer shows the new light."""
    viewer = make_napari_viewer_proxy()
    bench = workbench(viewer)
    pipeline, widget = PipelineWidget(viewer), RegionsWidget(viewer)
    for part, name in ((pipeline, "Pipeline"), (widget, "Regions")):
        viewer.window.add_dock_widget(part, name=name)
    bench.session.document.replace(lit(small_scan, 3.0).document.text)
    bench.session.take_scan(small_scan)
    bench.scan_changed.emit()
    bench.pipeline_changed.emit()
    pipeline.panel.run.click()
    wait_for(lambda: bench.layers.find("fluence") is not None, qtbot)
    panel = widget.boundary
    assert panel.status.text() == "By hand, 48 corners, in the pipeline."
    before = bench.layers.find("fluence").metadata[KEY]["image"]
    panel.edit.click()
    grow(panel.outline.layer, 4.0 / 3.0)
    assert "changed by hand" in panel.status.text()
    assert panel.take.isEnabled()
    panel.at_once.click()
    wait_for(lambda: bench.layers.find("fluence").metadata[KEY]["image"] is not before, qtbot)
    after = bench.layers.find("fluence").metadata[KEY]["image"].values[0]
    assert after[16, 16] < 0.9 * before.values[0][16, 16]
    assert not panel.take.isEnabled()
    change(panel.outline.layer, 0, EIGHT)
    wait_for(lambda: "crosses" in panel.message.text(), qtbot)
    panel.back.click()
    assert panel.message.text() == ""
    assert radius_mm(panel.outline.layer) == pytest.approx(4.0, rel=0.02)
    pipeline.runner.stop()


def test_without_a_widget_that_runs_it_says_so(qtbot):
    """Docked alone, the outline is taken, and the panel says what is missing."""
    bench = bench_without_window()
    bench.layers.show(disc_boundary(1.5e-3), "boundary")
    widget = RegionsWidget(bench.viewer)
    qtbot.addWidget(widget)
    widget.boundary.at_once.click()
    grow(widget.boundary.outline.layer)
    wait_for(lambda: widget.boundary.message.text() == NOBODY_RUNS, qtbot)
    assert outline_of(bench.session.pipeline) is not None


def test_a_widget_that_is_gone_is_told_nothing_more(qtbot):
    """After it is destroyed the viewer goes on without it, and outlines are drawn by whoever has new ones."""
    bench = bench_without_window()
    layer = bench.layers.show(disc_boundary(1.5e-3), "boundary")
    before = len(bench.viewing.changed), len(bench.result_changed), len(bench.pipeline_changed)
    widget = RegionsWidget(bench.viewer)
    widget.regions.draw("select")
    with qtbot.waitSignal(widget.destroyed):
        widget.deleteLater()
    assert (len(bench.viewing.changed), len(bench.result_changed), len(bench.pipeline_changed)) == before
    grow(layer)
    bench.layers.show(disc_boundary(1e-3), "boundary")
    assert radius_mm(layer) == pytest.approx(1.0, rel=0.03)
    bench.viewer.layers.clear()
