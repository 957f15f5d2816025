"""The live preview: a coarse image of the same problem, in time, never a stale one, and gone when the run is there."""

# First, since it skips this module where napari is missing.
from gui_viewers import bench_without_window, wait_for  # isort: split

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from qtpy.QtCore import QCoreApplication, QEvent

import oatkit
from gui_sessions import SMALL, small_session
from oatkit import Grid, Pipeline
from oatkit.api import Iterate, Scan
from oatkit.checkpoint import checkpoint
from oatkit.gui.pipeline.runner import Runner
from oatkit.gui.pipeline.widget import PipelineWidget
from oatkit.gui.preview import preview as module
from oatkit.gui.preview.coarse import PASS, STOP, Decimation, coarsened, thinned
from oatkit.gui.preview.panel import PREVIEW, PreviewPanel
from oatkit.gui.preview.preview import CoarseImages, Preview, Wanted, settled, speed_of, with_speed
from oatkit.reconstruction import preprocess
from oatkit.weights import with_weight

GRID = Grid((24, 24), 0.375e-3)


@pytest.fixture(autouse=True)
def _time_enough(monkeypatch):
    """Solvers come to their end, however busy this machine is."""
    monkeypatch.setattr(module, "REST_S", 60.0)


def wanted(session):
    """What a session asks for."""
    return Wanted(session.scan, session.frame, 0, settled(session.pipeline, session.scan))


# The coarse problem


def test_decimation_keeps_what_is_in_the_band_and_drops_the_rest():
    """Of two wave packets the one within the band is found at every fourth sample as it was, the other one is gone."""
    rate, factor, n = 40e6, 4, 800
    t = (np.arange(n) - n / 2) / rate
    low, high = (np.exp(-((t / 2e-6) ** 2)) * np.cos(2 * np.pi * f * t + 0.3) for f in (1.0e6, 4.5e6))
    decimate = Decimation(factor, rate, 2e6, 3e6)
    assert np.allclose(decimate.signals(low + high), low[::factor], atol=1e-9)


def test_decimated_signals_are_those_of_the_coarse_model(small_scan):
    """Signals of an image, cut down, are what the model predicts for the image on the slower axis, filtered alike."""
    arc = oatkit.plugin("forward_model", "arc")(precision="double")
    geometry = replace(small_scan.geometry, impulse_response=np.array([0.2, 0.0, 1.0, -0.5, 0.3]))
    image = np.random.default_rng(0).standard_normal(GRID.shape)
    signals = arc.operator(geometry, GRID).matvec(image.ravel()).reshape(1, 1, *geometry.shape)
    coarse = coarsened(Scan(signals, geometry, (800.0,)), GRID)
    assert coarse.geometry.n_samples < geometry.n_samples / 2
    predicted = arc.operator(coarse.geometry, GRID).matvec(image.ravel()).reshape(coarse.signals.shape)
    assert np.linalg.norm(coarse.signals - predicted) < 2e-3 * np.linalg.norm(predicted)


def test_sampling_holds_the_band_of_a_pixel_and_detectors_its_waves(mouse_scan):
    """The slower rate is above twice the band, and neighbours along an arc differ by less than half a wave's angle."""
    clean, grid = oatkit.read(mouse_scan).frame(0), Grid((64, 64), 25e-3 / 64)
    coarse = coarsened(clean, grid).geometry
    assert coarse.sampling_rate_hz >= 2 * STOP * clean.geometry.speed_of_sound_m_s / grid.pixel_size_m
    assert coarse.sampling_rate_hz < clean.geometry.sampling_rate_hz / 4
    angles = np.sort(np.arctan2(*coarse.detectors.positions_m.T))
    assert np.median(np.diff(angles)) * 12.5e-3 <= 0.5 * grid.pixel_size_m / PASS
    assert len(thinned(np.repeat(clean.geometry.detectors.positions_m, 2, axis=0), grid)) >= coarse.detectors.count


def test_it_is_what_the_engine_makes_of_the_coarse_scan(small_scan):
    """At rest the preview equals `oatkit.run` over the coarse scan, which knows nothing of previews, to the bit."""
    session = small_session(small_scan)
    last = list(CoarseImages().looks(wanted(session)))[-1]
    clean = preprocess(session.pipeline, small_scan, 0)
    bare = session.pipeline.model_copy(update={"preprocess": ()})
    expected = oatkit.run(bare, coarsened(clean, session.pipeline.grid.grid()))["initial_pressure"]
    assert (last.values == expected.values).all()


@pytest.mark.parametrize(("preset", "least"), [("maxent", 0.91), ("tv", 0.98), ("lsqr", 0.98)])
def test_it_is_like_the_full_image(mouse_scan, preset, least):
    """At rest it correlates with the mean of 3 x 3 pixels of the full image of the mouse."""
    scan = oatkit.read(mouse_scan)
    pipeline = settled(Pipeline.load(preset, ["grid.pixels=192"]), scan)
    last = list(CoarseImages().looks(Wanted(scan, 0, 0, pipeline)))[-1].values[0]
    full = oatkit.run(pipeline, scan)["initial_pressure"].values[0].reshape(64, 3, 64, 3).mean(axis=(1, 3))
    assert np.corrcoef(last.ravel(), full.ravel())[0, 1] > least


def test_another_speed_or_weight_is_that_of_the_engine_too(small_scan):
    """With the norm between its nodes and the operator kept, images are those of fresh ones to the norm's accuracy."""
    session, makes = small_session(small_scan), CoarseImages()
    start = wanted(session)
    own = small_scan.geometry.speed_of_sound_m_s
    for pipeline in (with_speed(start.pipeline, own + 37.0), with_weight_of(start.pipeline, 0.3)):
        kept = list(makes.looks(replace(start, pipeline=pipeline)))[-1].values
        coarse = coarsened(preprocess(with_speed(pipeline, None), small_scan, 0), pipeline.grid.grid())
        fresh = oatkit.run(pipeline.model_copy(update={"preprocess": ()}), coarse)["initial_pressure"].values
        assert np.linalg.norm(kept - fresh) < 5e-3 * np.linalg.norm(fresh)


def with_weight_of(pipeline, weight):
    """The pipeline with another weight."""
    return pipeline.with_solver(with_weight(pipeline.reconstruct, weight))


def test_words_stand_for_numbers(small_scan):
    """Focus and rules count as the scan's speed and the middle weight, or as what they chose in the last run."""
    pipeline = Pipeline.load("lsqr", ["scan.speed_of_sound_m_s='focus'", "reconstruct.weight='l-curve'"])
    first = settled(pipeline, small_scan)
    assert (speed_of(first), first.reconstruct.weight) == (1500.0, 1e-2)
    ran = SimpleNamespace(speed_choice={"a": 1}, scan={"speed_of_sound_m_s": 1512.3}, weight_choice={"weight": 0.1})
    after = settled(pipeline, small_scan, ran)
    assert (speed_of(after), after.reconstruct.weight) == (1512.3, 0.1)


# In time, and the newest only


def test_a_slow_solver_is_cut_off_at_the_budget_and_at_rest(monkeypatch):
    """Of a solver without end come the iterate at the budget and the one at rest; the setting of the scale is none."""
    clock = iter(np.arange(0, 10, 0.02))
    monkeypatch.setattr(module, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(module, "REST_S", 1.0)

    def states():
        yield from (Iterate(np.zeros((2, 2)), 0) for _ in range(5))
        yield from (Iterate(np.ones((2, 2)), i) for i in range(1, 10_000))

    shown = [state.iteration for state in module._in_time(states(), 0.0)]
    assert shown == [2 + int(module.BUDGET_S / 0.02), 2 + int(module.REST_S / 0.02)]


class Slow:
    """Looks that take a while, and count how many of them are at work at once."""

    def __init__(self):
        self.at_work, self.most, self.begun = 0, 0, []

    def looks(self, asked):
        """Yield the name of what was asked for, after some checkpoints, and once more."""
        self.at_work += 1
        self.most, self.begun = max(self.most, self.at_work), [*self.begun, asked]
        try:
            for _ in range(2):
                for _ in range(10):
                    time.sleep(0.005)
                    checkpoint()
                yield asked
        finally:
            self.at_work -= 1


def outcomes(preview, seconds=5.0):
    """What a preview hands out until it is idle."""
    found, end = [], time.monotonic() + seconds
    while preview.busy and time.monotonic() < end:
        found.append(preview.poll())
        time.sleep(0.002)
    return [item for item in found if item is not None]


def test_stale_pictures_are_never_handed_out():
    """However late older passes end, only pictures of the newest request come out, of one pass at a time."""
    slow = Slow()
    preview = Preview(slow.looks)
    for name in "abcdef":
        preview.ask(name)
        time.sleep(0.012)
    assert set(outcomes(preview)) == {"f"}
    assert slow.most == 1
    preview.ask("g")
    time.sleep(0.15)  # its pictures lie there, not yet looked at
    preview.ask("h")
    assert set(outcomes(preview)) == {"h"}


def test_a_dropped_pass_ends_soon_and_leaves_no_thread():
    """Stopped in the midst of its work, a pass ends at its next checkpoint, and hands out nothing."""
    preview = Preview(Slow().looks)
    preview.ask("a")
    time.sleep(0.02)
    start = time.monotonic()
    preview.stop()
    assert time.monotonic() - start < 1
    assert not jobs()
    assert outcomes(preview) == []


def jobs():
    """The threads of jobs that are at work."""
    return [thread for thread in threading.enumerate() if thread.name == "oatkit job"]


# The panel


class Window:
    """The panel on a bench without a window, with a small scan open."""

    def __init__(self, scan, qtbot, preset="lsqr"):
        self.bench, self.edits = bench_without_window(), 0
        self.runner = Runner(self.bench.session)
        self.panel = PreviewPanel(self.bench, self.runner, self.edit)
        self.qtbot = qtbot
        qtbot.addWidget(self.panel)
        self.bench.session.document = small_session(scan, preset).document
        self.bench.session.take_scan(scan)
        self.bench.scan_changed.emit()

    def edit(self, change):
        """Edit the pipeline as the pipeline widget does."""
        change(self.bench.session.document)
        self.edits += 1
        self.bench.pipeline_changed.emit()

    @property
    def shown(self):
        """The image of the preview, or None."""
        layer = self.bench.layers.find(PREVIEW)
        return None if layer is None else layer.metadata["oatkit"]["image"]

    def rest(self):
        """Wait until nothing is at work."""
        wait_for(lambda: not self.panel.preview.busy, self.qtbot)

    def is_like(self, pipeline, frame=0):
        """Whether the preview is the one of a pipeline."""
        session = self.bench.session
        last = list(CoarseImages().looks(Wanted(session.scan, frame, 0, settled(pipeline, session.scan))))[-1]
        return np.allclose(self.shown.values, last.values, atol=5e-3 * abs(last.values).max())


@pytest.fixture
def window(small_scan, qtbot):
    """The panel with a small scan."""
    made = Window(small_scan, qtbot)
    yield made
    made.panel.stop()


def test_while_it_moves_only_the_preview_follows_and_letting_go_is_one_edit(window):
    """Moves of a pressed slider edit nothing but show an image; its release is one edit, which one undo takes back."""
    session, slider = window.bench.session, window.panel.speed.slider
    before = session.document.text
    window.rest()
    assert window.shown is None
    slider.setSliderDown(True)
    for speed in range(1501, 1531):
        slider.setSliderPosition(speed - 1400)
        window.qtbot.wait(5)
    window.rest()
    assert session.document.text == before
    assert window.is_like(with_speed(session.pipeline, 1530.0))
    slider.setSliderDown(False)
    assert (window.edits, session.pipeline.scan.speed_of_sound_m_s) == (1, 1530.0)
    assert window.panel.speed.value.text() == "1530 m/s"
    session.document.undo()
    window.bench.pipeline_changed.emit()
    assert session.document.text == before
    assert window.shown is None
    assert window.panel.speed.value.text() == "1500 m/s"
    assert len(session.memo) == 0


def test_keys_and_wheel_make_one_edit_of_the_weight(window):
    """Several steps of the keys count as one move, which is over at the latest when a run wants the pipeline."""
    weight = window.panel.weight
    for _ in range(5):
        weight.slider.setValue(weight.slider.value() + 10)
    assert window.edits == 0
    window.panel.finish()
    assert (window.edits, window.bench.session.pipeline.reconstruct.weight) == (1, 0.1)
    window.rest()
    assert window.is_like(window.bench.session.pipeline)


def test_every_edit_and_frame_is_followed_unless_it_is_switched_off(window):
    """Another solver or frame gets its own preview, a solver without a weight no slider; off, nothing is shown."""
    session, bench = window.bench.session, window.bench
    window.edit(lambda document: document.set("reconstruct", "use", "backprojection"))
    window.rest()
    assert window.is_like(session.pipeline)
    assert window.panel.weight.slider.isHidden()
    session.go_to_frame(1)
    bench.scan_changed.emit()
    window.rest()
    assert window.is_like(session.pipeline, frame=1)
    assert not window.is_like(session.pipeline, frame=0)
    window.panel.live.setChecked(False)
    assert window.shown is None
    window.edit(lambda document: document.set("grid", "pixels", 20))
    assert not window.panel.preview.busy


def test_what_fails_is_a_sentence_in_the_panel(window):
    """A pipeline that cannot be previewed is told in one sentence, and its picture is not left; mended, it goes on."""
    window.edit(lambda document: document.set("reconstruct", "weight", 0.5))
    window.rest()
    assert window.shown is not None
    window.edit(lambda document: document.set("grid", "field_of_view_mm", 80.0))
    window.rest()
    assert "detectors lie inside the field of view" in window.panel.message.text()
    assert window.shown is None
    window.bench.session.document.undo()
    window.bench.pipeline_changed.emit()
    window.rest()
    assert window.panel.message.text() == ""
    assert window.shown is not None
    window.edit(lambda document: document.set("reconstruct", "scaling", "absolute"))
    window.rest()
    assert "absolute" in window.panel.message.text()


def test_it_covers_a_result_until_the_run_or_the_way_back(make_napari_viewer_proxy, small_scan, qtbot):
    """It goes when a run has made the result, lies on top while parameters differ from it, and undo takes it away."""
    widget = in_viewer(make_napari_viewer_proxy(), small_scan, qtbot)
    layers = widget.bench.layers
    widget.preview.weight.slider.setValue(200)
    wait_for(lambda: layers.find(PREVIEW) is not None, qtbot)
    widget.panel.run.pressed.emit()
    widget.panel.run.click()
    wait_for(lambda: not widget.runner.running, qtbot)
    assert layers.find(PREVIEW) is None
    result = layers.find("initial_pressure")
    assert result.metadata["oatkit"]["result"].pipeline["reconstruct"]["weight"] == widget.preview.weight.number
    widget.preview.speed.slider.setValue(20)
    wait_for(lambda: layers.find(PREVIEW) is not None, qtbot)
    viewer_layers = layers.viewer.layers
    assert viewer_layers.index(layers.find(PREVIEW)) > viewer_layers.index(result)
    assert viewer_layers.selection.active.name == "preview 32 x 32"
    assert "preview of 32 x 32 pixels" in layers.viewer.canvas.overlays.text.text
    widget.preview.finish()
    widget.header.undo.click()
    assert layers.find(PREVIEW) is None
    assert viewer_layers.selection.active is result


def in_viewer(viewer, scan, qtbot):
    """The pipeline widget docked in a viewer, with a small scan and a small grid."""
    made = PipelineWidget(viewer)
    viewer.window.add_dock_widget(made, name="Pipeline")
    made.bench.session.document = small_session(scan).document
    made.bench.session.take_scan(scan)
    made.bench.scan_changed.emit()
    assert made.bench.session.pipeline.grid.pixels == SMALL["pixels"]
    return made


def test_a_window_closed_meanwhile_leaves_no_thread(make_napari_viewer_proxy, small_scan, qtbot, capfd):
    """Closing the viewer in the midst of a pass ends its thread, and nothing is printed."""
    viewer = make_napari_viewer_proxy()
    widget = in_viewer(viewer, small_scan, qtbot)
    widget.edit(lambda document: document.set("reconstruct", "weight", 1e-5))
    assert widget.preview.preview.busy
    viewer.close()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert not jobs()
    assert "Traceback" not in capfd.readouterr().err
