"""The sweep over the weight: its images are those of runs, its picks those of the rules, and nothing stale is taken."""

# First, since it skips this module where napari is missing.
from gui_viewers import bench_without_window, wait_for  # isort: split

import csv
import io
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest

import oatkit
from gui_sessions import SMALL, small_session
from oatkit.errors import ValidationError
from oatkit.events import StepStarted
from oatkit.gui.pipeline.run_log import RunLog
from oatkit.gui.weights.curve import csv_of, now_of, plot_of, title_of, words_of
from oatkit.gui.weights.sweep import Request, Tried, WeightSweep, begin
from oatkit.gui.weights.widget import LAYER, WeightWidget
from oatkit.weights import CANDIDATES

FEW = Request(1e-3, 1e-1, 5)


@pytest.fixture(scope="module")
def two_colours(small_scan):
    """A scan of two frames at two wavelengths, of which the second has the larger signals."""
    signals = np.concatenate([0.5 * small_scan.signals[:, :, :, ::-1], np.asarray(small_scan.signals)], axis=1)
    valid = np.repeat(small_scan.valid, 2, axis=1)
    return replace(small_scan, signals=signals, wavelengths_nm=(700.0, 800.0), valid=valid, timestamps_s=None)


def silent(scan):
    """The scan with signals that are zero."""
    return replace(scan, signals=np.zeros_like(np.asarray(scan.signals)))


def quick_session(scan, preset="lsqr"):
    """A session whose solver takes a few steps for each weight."""
    session = small_session(scan, preset)
    session.document.set("grid", "pixels", 16)
    session.document.set("reconstruct", "n_iterations", 12)
    return session


def swept(session, request=FEW):
    """A sweep that has come to its end."""
    sweep, job = begin(session, request)
    assert job.wait(60)
    assert job.failure is None, job.failure
    for item in job.drain():
        sweep.take(item)
    return sweep


def ran(session):
    """What a run of the session has told, and its result."""
    job = session.run()
    assert job.wait(60)
    assert job.failure is None, job.failure
    items = job.drain()
    return items, items[-1].result


@pytest.mark.parametrize("preset", ["maxent", "lsqr", "nnls"])
def test_the_image_of_a_weight_is_that_of_a_run_with_it(two_colours, preset):
    """After a weight is taken, a run that knows nothing of the sweep gives the image that was shown: to the bit, and
    for maximum entropy, which begins near the weight or the wavelength before, within the certificates of both.
    """
    session = quick_session(two_colours, preset)
    session.go_to_frame(1)
    for wavelength_nm, plane in ((None, 1), (700.0, 0)):
        sweep = swept(session, replace(FEW, wavelength_nm=wavelength_nm))
        for index in (0, 3):
            sweep.take_weight(index)
            assert session.pipeline.reconstruct.weight == sweep.tried[index].point.weight
            image = sweep.tried[index].image
            alone = oatkit.run(session.pipeline, two_colours, 1)["initial_pressure"]
            if preset == "maxent":
                shown, found = (one.diagnostics["objective"][i] for one, i in ((image, 0), (alone, plane)))
                gaps = image.diagnostics["relative_gap"][0], alone.diagnostics["relative_gap"][plane]
                assert abs(shown - found) <= max(gaps) * max(shown, found)
            else:
                assert (image.values[0] == alone.values[plane]).all()
            assert image.wavelengths_nm == (alone.wavelengths_nm[plane],)
            assert image.history == alone.history
            assert (ran(session)[1]["initial_pressure"].values == alone.values).all()


def test_a_speed_of_sound_by_focus_is_chosen_before_the_sweep(small_scan):
    """Where the speed of sound is a rule too, the image of a weight is still that of a run."""
    session = quick_session(small_scan)
    session.document.set("scan", "speed_of_sound_m_s", "focus")
    sweep = swept(session)
    sweep.take_weight(2)
    alone = oatkit.run(session.pipeline, small_scan)["initial_pressure"]
    assert (sweep.tried[2].image.values == alone.values).all()


def test_a_sweep_picks_what_the_rules_pick_and_leaves_them_nothing_to_do(two_colours):
    """The picks are the choices that the engine makes by itself; after the sweep a run by rule tries no weight."""
    session = quick_session(two_colours)
    sweep = swept(session, Request(hold_out=True))
    assert tuple(tried.point.weight for tried in sweep.tried) == CANDIDATES
    for rule, name in (("l-curve", "corner"), ("hold-out", "hold-out")):
        sweep.take_rule(rule)
        alone = oatkit.run(session.pipeline, two_colours)
        items, result = ran(session)
        assert result.weight_choice == alone.weight_choice
        assert sweep.picks[name] == alone.weight_choice["weight"]
        assert not any(isinstance(item, StepStarted) and "choosing" in item.step for item in items)
        assert (result["initial_pressure"].values == alone["initial_pressure"].values).all()


@pytest.mark.parametrize(
    ("frame", "request_"),
    [(0, FEW), (0, Request(wavelength_nm=700.0)), (1, Request())],
    ids=["other weights", "other wavelength", "other frame"],
)
def test_a_sweep_of_something_else_is_not_taken_for_a_rules(two_colours, frame, request_):
    """Where weights, wavelength or frame are not those of the rule, a run by rule tries its weights itself."""
    session = quick_session(two_colours)
    session.go_to_frame(frame)
    swept(session, request_).take_rule("l-curve")
    items, result = ran(session)
    assert any(isinstance(item, StepStarted) and "choosing" in item.step for item in items)
    assert result.weight_choice == oatkit.run(session.pipeline, two_colours, frame).weight_choice


def test_a_run_by_rule_says_how_many_weights_are_done(small_scan):
    """The line of a run in the window counts the weights that are tried."""
    session = quick_session(small_scan)
    session.document.set("reconstruct", "weight", "l-curve")
    log, said = RunLog(), []
    for item in ran(session)[0]:
        log.take([item])
        said.append(log.text())
    assert [f"choosing the weight, {k} of 13 done" in said for k in range(13)] == [True] * 13


def test_points_and_progress_come_one_by_one(two_colours):
    """Each point is counted as it comes, by rising weight, and the title says which wavelength and frame is swept."""
    sweep, job = begin(quick_session(two_colours), FEW)
    assert sweep.progress == "preprocessing"
    assert job.wait(60)
    told = []
    for item in job.drain():
        sweep.take(item)
        if isinstance(item, Tried):
            told.append(sweep.progress)
            assert len(plot_of(sweep).curves[0].x) == len(told)
            assert (sweep.picks == {}) == (not sweep.choices)
    assert told == [f"{k} of 5" for k in range(1, 6)]
    assert title_of(sweep) == "L-curve at 800 nm, the strongest, frame 0"


def test_marks_lie_on_the_curve(small_scan):
    """Picks and the shown weight are marks at their points; a weight between two points lies between them."""
    session = small_session(small_scan)
    session.document.set("reconstruct", "weight", 10**-2.25)
    sweep = swept(session)
    plot = plot_of(sweep, sweep.tried[4].point.weight)
    x, y = plot.curves[0].x, plot.curves[0].y
    assert np.allclose(x, [tried.point.residual_norm for tried in sweep.tried], rtol=1e-15)
    assert np.allclose(y**2, [tried.point.penalty for tried in sweep.tried], rtol=1e-12)
    marks = {name: mark for mark in plot.marks for name in mark.label.partition(" ")[2].split(", ")}
    assert set(marks) == {"corner", "chord", "pipeline", "shown"}
    weights = [tried.point.weight for tried in sweep.tried]
    for name in ("corner", "chord"):
        index = weights.index(sweep.picks[name])
        assert (marks[name].x, marks[name].y) == (pytest.approx(x[index]), pytest.approx(y[index]))
    assert marks["pipeline"].label == "0.00562 pipeline"
    assert marks["pipeline"].x == pytest.approx(np.sqrt(x[1] * x[2]))
    assert marks["pipeline"].y == pytest.approx(np.sqrt(y[1] * y[2]))
    session.document.set("reconstruct", "weight", 5.0)
    assert "pipeline" not in str(plot_of(sweep).marks)


def test_what_is_said_of_a_point_is_measured_on_its_image(small_scan):
    """Residual, share of the data, negative pixels and certificate in the words are those of the image of the point."""
    session = small_session(small_scan)
    sweep = swept(session)
    tried = sweep.tried[1]
    negative = 100 * (tried.image.values < 0).mean()
    assert negative > 1
    session.document.set("reconstruct", "weight", tried.point.weight)
    found = ran(session)[1]["initial_pressure"].diagnostics
    share = 100 * found["residual_norm"][0] / found["data_norm"][0]
    assert words_of(sweep, tried) == (
        f"weight 0.00316 · residual {found['residual_norm'][0]:.4g} ({share:.1f} % of the data) · "
        f"{negative:.1f} % negative · no certificate"
    )
    certified = swept(small_session(small_scan, "maxent")).tried[1]
    assert f"within {certified.image.diagnostics['relative_gap'][0]:.1e} of the optimum" in words_of(sweep, certified)


def test_only_what_an_image_depends_on_makes_a_sweep_stale(two_colours):
    """Another weight or a later step leaves the sweep good; anything before it does not, until it is undone."""
    session = quick_session(two_colours)
    sweep = swept(session)
    session.document.set("reconstruct", "weight", 0.5)
    session.document.add("segment", "radial")
    assert sweep.stale() == ""
    for table, key, value in (
        ("scan", "speed_of_sound_m_s", 1510.0), ("grid", "pixels", 30), ("reconstruct", "tolerance", 1e-2),
    ):  # fmt: skip
        session.document.set(table, key, value)
        assert sweep.stale() == f"[{table}] has changed since this sweep: sweep again"
        with pytest.raises(ValidationError, match="sweep again"):
            sweep.take_weight(0)
        session.document.undo()
        assert sweep.stale() == ""
    session.document.set("reconstruct", "use", "backprojection")
    assert sweep.stale().startswith("[reconstruct] has changed")
    session.document.undo()
    session.go_to_frame(1)
    assert sweep.stale() == "another scan or frame has been opened since this sweep: sweep again"


@pytest.mark.parametrize(
    ("change", "request_", "sentence"),
    [
        (("use", "backprojection"), FEW, "solver 'backprojection' has no weight to choose"),
        (("scaling", "absolute"), FEW, "set scaling to 'relative' in Reconstruct"),
        (("weight", 0.1), Request(1.0, 0.1), "a range from a number above 0 to a larger one, got 1 to 0.1"),
        (("weight", 0.1), Request(float("nan"), 1.0), "got nan to 1"),
        (("weight", 0.1), Request(0.1, float("inf")), "got 0.1 to inf"),
        (("weight", 0.1), Request(0.1, 1.0, 4), "expected five or more different weights"),
    ],
)
def test_what_cannot_be_swept_is_refused_at_once(small_scan, change, request_, sentence):
    """A solver without a weight, weights in units, and ranges that are none get a sentence before any work."""
    session = small_session(small_scan)
    session.document.set("reconstruct", *change)
    with pytest.raises(ValidationError, match=sentence):
        begin(session, request_)


def test_what_shows_only_in_the_work_is_a_failure_with_a_sentence(two_colours):
    """Data that are zero and a wavelength that the pipeline does not use end the sweep with one sentence."""
    for scan, request_, sentence in (
        (silent(two_colours), FEW, "the data are zero"),
        (two_colours, replace(FEW, wavelength_nm=750.0), "750 nm: the pipeline uses no such wavelength"),
    ):
        session = small_session(scan)
        session.document.remove("preprocess")  # which finds all channels of a silent scan dead
        _, job = begin(session, request_)
        assert job.wait(60)
        assert sentence in job.failure.sentence
    session = small_session(two_colours)
    session.scan = None
    with pytest.raises(ValidationError, match="no scan is open"):
        begin(session, FEW)


def test_a_cancelled_sweep_keeps_its_points_and_ends_within_a_second(small_scan):
    """A sweep of solvers that go on for long ends within a second; the points that came can be taken."""
    session = small_session(small_scan, "maxent")
    sweep, job = begin(session, Request(1e-3, 1.0, 99))
    while not sweep.tried:
        for item in job.drain():
            sweep.take(item)
        time.sleep(0.005)
    start = time.perf_counter()
    job.cancel()
    assert job.wait(5)
    assert time.perf_counter() - start < 1
    assert job.failure is None
    assert sweep.choices == {}
    sweep.take_weight(0)
    assert now_of(session.pipeline) == "pipeline: 1"  # the strongest come first


def test_the_table_holds_the_curve(small_scan):
    """The CSV has a row for each weight with its numbers, and says which rule picks it."""
    sweep = swept(quick_session(small_scan), replace(FEW, hold_out=True))
    rows = list(csv.DictReader(io.StringIO(csv_of(sweep))))
    for row, tried, held_out in zip(rows, sweep.tried, sweep.choices["hold-out"].curve, strict=True):
        assert (row["solver"], row["frame"], row["wavelength_nm"], row["relative_gap"]) == ("lsqr", "0", "700", "")
        assert float(row["weight"]) == pytest.approx(tried.point.weight, rel=1e-8)
        assert float(row["residual_norm"]) == pytest.approx(tried.point.residual_norm, rel=1e-8)
        assert float(row["penalty"]) == pytest.approx(tried.point.penalty, rel=1e-8)
        assert float(row["prediction_error"]) == pytest.approx(held_out.prediction_error, rel=1e-8)
        assert float(row["negative_percent"]) == pytest.approx(100 * (tried.image.values < 0).mean(), rel=1e-3)
        picked = [name for name, weight in sweep.picks.items() if weight == tried.point.weight]
        assert row["picked_by"] == ", ".join(picked)
    assert {"corner", "chord", "hold-out"} == {n for row in rows for n in row["picked_by"].split(", ") if n}


@pytest.fixture
def widget(two_colours, qtbot):
    """The widget on a small scan, without a viewer's window."""
    bench = bench_without_window()
    made = WeightWidget(bench.viewer)
    qtbot.addWidget(made)
    made.resize(380, 640)
    made.show()
    prepare(made, two_colours)
    yield made
    made.cancel()


def prepare(widget, scan):
    """Give the widget's session a small scan, a small grid and five weights."""
    session = widget.bench.session
    session.document.replace(oatkit.pipeline.preset("lsqr"))
    for key, value in SMALL.items():
        session.document.set("grid", key, value)
    session.document.set("reconstruct", "n_iterations", 12)
    session.take_scan(scan)
    widget.bench.scan_changed.emit()
    widget.bench.pipeline_changed.emit()
    widget.low.setText("1e-3")
    widget.high.setText("0.1")
    widget.number.setValue(5)


def sweep_all(widget, qtbot):
    """Press Sweep and wait for the end."""
    QTest.mouseClick(widget.run, Qt.MouseButton.LeftButton)
    assert widget.running
    wait_for(lambda: not widget.running, qtbot)


def click_on(widget, index, qtbot):
    """Click on a point of the drawn curve."""
    canvas, axes = widget.view._canvas, widget.view._axes[0]
    canvas.draw()
    curve = widget.view.plots[0].curves[0]
    x, y = axes.transData.transform((curve.x[index], curve.y[index])) / canvas.device_pixel_ratio
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(canvas.height() - y)))


def test_a_click_shows_the_image_and_the_button_takes_the_weight(widget, qtbot):
    """A click shows the image, arrow keys its neighbours, the button makes one edit, and the run gives that image."""
    sweep_all(widget, qtbot)
    assert widget.progress.text().startswith("5 weights in")
    layers, session = widget.bench.layers, widget.bench.session
    click_on(widget, 1, qtbot)
    assert layers.find(LAYER).name == "weight 0.00316"
    QTest.keyClick(widget, Qt.Key.Key_Right)
    QTest.keyClick(widget, Qt.Key.Key_Right)
    layer = layers.find(LAYER)
    assert layer.name == "weight 0.0316"
    assert [key for _, key, _ in layers.shown()] == [LAYER]
    assert (layer.data[::-1] == widget.sweep.tried[3].image.values[0]).all()
    assert widget.caption.text() == words_of(widget.sweep, widget.sweep.tried[3])
    text = session.document.text
    QTest.mouseClick(widget.take, Qt.MouseButton.LeftButton)
    assert widget.now.text() == "pipeline: 0.0316"
    assert (ran(session)[1]["initial_pressure"].values[1] == layer.data[::-1]).all()
    session.document.undo()
    assert session.document.text == text


def test_the_wavelength_looked_at_is_swept_where_it_is_asked_for(widget, qtbot):
    """With "looked at" the sweep is of the wavelength under the slider, and the title says so."""
    bench = widget.bench
    bench.layers.show(ran(bench.session)[1]["initial_pressure"], "initial_pressure")
    bench.viewing.go_to(700)
    widget.wavelength.setCurrentIndex(1)
    sweep_all(widget, qtbot)
    assert widget.view.plots[0].title == "L-curve at 700 nm, frame 0"


def test_a_rule_is_written_as_a_word_and_files_hold_the_curve(widget, qtbot, tmp_path):
    """Take rule writes the word; CSV and PNG are written, and a place that cannot be written is a sentence."""
    sweep_all(widget, qtbot)
    widget.rule.menu().actions()[1].trigger()
    assert widget.bench.session.pipeline.reconstruct.weight == "hold-out"
    assert widget.now.text() == "pipeline: by hold-out"
    widget.save_csv(tmp_path / "weights.csv")
    assert (tmp_path / "weights.csv").read_text() == csv_of(widget.sweep)
    widget.save_png(tmp_path / "weights.png")
    assert (tmp_path / "weights.png").read_bytes().startswith(b"\x89PNG")
    widget.save_csv(tmp_path / "missing" / "weights.csv")
    assert "its folder does not exist" in widget.message.text()


def test_nothing_stale_is_offered(widget, two_colours, qtbot):
    """After an edit the button is off and a line says why; undo brings it back; another scan takes the image away."""
    sweep_all(widget, qtbot)
    widget.look_at(2)
    session = widget.bench.session
    session.document.set("grid", "pixels", 31)
    widget.bench.pipeline_changed.emit()
    assert not widget.take.isEnabled()
    assert widget.message.text() == "[grid] has changed since this sweep: sweep again"
    session.document.undo()
    widget.bench.pipeline_changed.emit()
    assert widget.take.isEnabled()
    assert widget.message.text() == ""
    session.go_to_frame(1)
    widget.bench.scan_changed.emit()
    assert not widget.take.isEnabled()
    assert "another scan or frame" in widget.message.text()
    assert widget.bench.layers.find(LAYER) is None


def test_what_cannot_be_swept_is_one_sentence_in_the_widget(widget, qtbot):
    """A text that is no number, and a solver without a weight, get a sentence; then a good sweep runs."""
    widget.low.setText("much")
    widget.run.click()
    assert widget.message.text() == "weights: expected a number above 0, got 'much'"
    widget.low.setText("1e-3")
    widget.bench.session.document.set("reconstruct", "use", "backprojection")
    widget.bench.pipeline_changed.emit()
    widget.run.click()
    assert widget.message.text() == "solver 'backprojection' has no weight to choose"
    assert widget.now.text() == "backprojection has no weight"
    widget.bench.session.document.undo()
    widget.bench.pipeline_changed.emit()
    sweep_all(widget, qtbot)
    assert widget.message.text() == ""


def test_a_failure_in_the_work_is_shown(widget, two_colours, qtbot):
    """Zero data end the sweep with a sentence, and the buttons are ready again."""
    prepare(widget, silent(two_colours))
    widget.bench.session.document.remove("preprocess")
    sweep_all(widget, qtbot)
    assert "the data are zero" in widget.message.text()
    assert (widget.run.isEnabled(), widget.stop.isEnabled()) == (True, False)


def jobs():
    """The threads of jobs that are at work."""
    return [thread for thread in threading.enumerate() if thread.name == "oatkit job"]


def slow(widget):
    """Ask for weights that take long, and wait for the first."""
    widget.bench.session.document.replace(oatkit.pipeline.preset("maxent"))
    for key, value in SMALL.items():
        widget.bench.session.document.set("grid", key, value)
    widget.bench.pipeline_changed.emit()
    widget.low.setText("1e-3")
    widget.number.setValue(99)
    widget.run.click()


def test_an_edit_or_cancel_ends_a_sweep_and_a_later_step_does_not(widget, qtbot):
    """A sweep goes on while the weight is edited, and ends within a second of Cancel or of an edit before it."""
    for end in (widget.stop.click, lambda: edit(widget, "grid", "pixels", 31)):
        slow(widget)
        wait_for(lambda: bool(widget.sweep.tried), qtbot)
        edit(widget, "reconstruct", "weight", 0.5)
        assert widget.running
        start = time.monotonic()
        end()
        assert not widget.running
        wait_for(lambda: not jobs(), qtbot, 5)
        assert time.monotonic() - start < 1
        assert widget.run.isEnabled()


def edit(widget, *change):
    """Change the pipeline as another widget does."""
    widget.bench.session.document.set(*change)
    widget.bench.pipeline_changed.emit()


def test_a_viewer_closed_during_a_sweep_leaves_no_thread(make_napari_viewer_proxy, two_colours, qtbot):
    """In a real window the image is painted where it lies; closing the window ends the sweep under way."""
    viewer = make_napari_viewer_proxy(show=True)
    made = WeightWidget(viewer)
    viewer.window.add_dock_widget(made, name="Weight")
    prepare(made, two_colours)
    sweep_all(made, qtbot)
    made.look_at(0)
    assert viewer.screenshot(flash=False)[..., :3].max() > 200
    slow(made)
    wait_for(lambda: bool(made.sweep.tried), qtbot)
    viewer.close()
    wait_for(lambda: not jobs(), qtbot, 3)


def test_a_widget_that_is_gone_is_told_nothing_more(qtbot):
    """After the widget is destroyed the session goes on without it."""
    bench = bench_without_window()
    made = WeightWidget(bench.viewer)
    with qtbot.waitSignal(made.destroyed):
        made.deleteLater()
    bench.pipeline_changed.emit()
    assert (len(bench.pipeline_changed), len(bench.scan_changed)) == (0, 0)
    assert WeightSweep(bench.session).stale() == ""
