"""The pipeline widget, driven as a user drives it: what it shows is what the engine gives, and nothing breaks it."""

# First, since it skips this module where napari is missing.
from gui_viewers import wait_for  # isort: split

import threading
import time
from functools import partial

import pytest
from qtpy.QtCore import QCoreApplication, QEvent, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QToolButton

import oatkit
from gui_sessions import SMALL
from oatkit.errors import SolverError
from oatkit.gui.batch.widget import BatchWidget
from oatkit.gui.pipeline.recipe_dialog import RecipeDialog
from oatkit.gui.pipeline.widget import ITERATE, PipelineWidget
from oatkit.pipeline import presets


@pytest.fixture
def widget(make_napari_viewer_proxy, small_scan, qtbot):
    """The widget in a viewer, with a small scan and a small grid."""
    made = in_viewer(make_napari_viewer_proxy(), small_scan, qtbot)
    yield made
    made.runner.stop()


def in_viewer(viewer, scan, qtbot):
    """The widget docked in a viewer, with a small scan, a small grid, and a way to wait."""
    made = PipelineWidget(viewer)
    made.wait = partial(wait_for, qtbot=qtbot)
    viewer.window.add_dock_widget(made, name="Pipeline")
    made.bench.session.take_scan(scan)
    made.bench.scan_changed.emit()
    for key, value in SMALL.items():
        made.edit(lambda document, key=key, value=value: document.set("grid", key, value))
    return made


def run(widget):
    """Press Run and wait for the end."""
    widget.panel.run.click()
    widget.wait(lambda: not widget.runner.running)


def choose(box, text):
    """Take an entry of a combo box as a user does."""
    index = box.findText(text)
    assert index >= 0, text
    box.setCurrentIndex(index)
    box.activated.emit(index)


def enter(line, text):
    """Type into a line and press Enter."""
    line.setFocus()
    line.selectAll()
    QTest.keyClicks(line, text)
    QTest.keyClick(line, Qt.Key.Key_Return)


def slow(widget):
    """Take a solver that goes on for long."""
    choose(widget.header.preset, "maxent")
    for key, value in SMALL.items():
        widget.edit(lambda document, key=key, value=value: document.set("grid", key, value))
    inputs = widget.stack.card("reconstruct").form.inputs
    choose(inputs["method"].box, "paper")
    enter(inputs["tolerance"].line, "1e-15")
    enter(inputs["n_iterations"].line, "1000000")


def seconds_to_cancel(widget):
    """Run until the solver's image is shown, press Cancel, and time until no thread is left."""
    widget.panel.run.click()
    widget.wait(lambda: widget.bench.layers.find(ITERATE) is not None)
    start = time.monotonic()
    widget.panel.cancel.click()
    assert not widget.runner.running
    widget.wait(lambda: not jobs(), seconds=5)
    return time.monotonic() - start


def jobs():
    """The threads of jobs that are at work."""
    return [thread for thread in threading.enumerate() if thread.name == "oatkit job"]


def test_from_preset_to_layer_it_is_the_engine(widget, small_scan):
    """A preset chosen, a field edited and Run pressed show a layer with the numbers of `oatkit.run`, to the bit."""
    choose(widget.header.preset, "nnls")
    widget.stack.card("grid").expand()
    for key, value in SMALL.items():
        enter(widget.stack.card("grid").form.inputs[key].line, str(value))
    enter(widget.stack.card("reconstruct").form.inputs["tolerance"].line, "1e-2")
    run(widget)
    expected = oatkit.run(
        oatkit.Pipeline.load("nnls", [f"grid.{k}={v}" for k, v in SMALL.items()] + ["reconstruct.tolerance=1e-2"]),
        small_scan,
    )["initial_pressure"]
    layer, key, image = next(iter(widget.bench.layers.shown()))
    assert key == "initial_pressure"
    assert (image.values == expected.values).all()
    assert (layer.data[::-1] == expected.values[0]).all()
    assert widget.bench.layers.find(ITERATE) is None
    assert "●" in widget.stack.card("reconstruct").status.text()


def test_what_is_invalid_is_marked_and_changes_nothing(widget):
    """A wrong value gets a red border and its sentence, stays to be mended while others change, and nothing else."""
    card = widget.stack.card("reconstruct")
    line, message = card.form.inputs["tolerance"].line, card.form.messages["tolerance"]
    text = widget.bench.session.document.text
    enter(line, "-1")
    assert widget.bench.session.document.text == text
    assert "tolerance: must be a number above 0 and below 1, got -1" in message.text()
    assert "border" in line.styleSheet()
    enter(card.form.inputs["n_iterations"].line, "77")
    assert line.text() == "-1"
    enter(line, "1e-3")
    assert (message.text(), line.styleSheet()) == ("", "")
    band = next(c for c in widget.stack.cards.values() if c.chooser and c.chooser.currentText() == "band-pass")
    band.expand()
    low, high = (band.form.inputs[name].line for name in ("low", "high"))
    enter(low, "6")
    assert "low must be below high" in band.form.messages["low"].text()
    enter(high, "8")
    enter(low, "6")
    assert band.form.messages["low"].text() == ""
    assert widget.bench.session.pipeline.preprocess[-1].low == 6
    assert widget.bench.session.pipeline.reconstruct.tolerance == 1e-3
    assert widget.bench.session.pipeline.reconstruct.n_iterations == 77


def test_cards_come_and_go_with_the_pipeline(widget):
    """Steps are added, moved, removed, exchanged and switched on by their cards; a refused choice says why."""
    session, stack = widget.bench.session, widget.stack
    choose(stack.adder, "offset")
    count = len(session.pipeline.preprocess)
    assert session.pipeline.preprocess[-1].name == "offset"
    stack.card("preprocess", count - 1)._move(-1)
    assert session.pipeline.preprocess[count - 2].name == "offset"
    choose(stack.card("preprocess", 0).chooser, "energy")
    assert session.pipeline.preprocess[0].name == "energy"
    choose(stack.card("fluence").chooser, "beer-lambert")
    assert session.pipeline.fluence is None
    assert "[segment], which is missing" in stack.card("fluence").message.text()
    assert stack.card("fluence").chooser.currentText() == "none"
    choose(stack.card("segment").chooser, "radial")
    choose(stack.card("fluence").chooser, "beer-lambert")
    assert session.pipeline.fluence.name == "beer-lambert"
    choose(stack.card("fluence").chooser, "none")
    assert session.pipeline.fluence is None
    choose(stack.card("reconstruct").chooser, "lsqr")
    regularizer = stack.card("reconstruct").form.parts["regularizer"]
    choose(regularizer.chooser, "identity")
    assert session.pipeline.reconstruct.regularizer.name == "identity"


def test_a_run_to_here_ends_here_and_the_recipe_is_what_ran(widget):
    """Run to here makes no image of a later step; the recipe of its layer stays as run while the pipeline changes."""
    choose(widget.stack.card("segment").chooser, "radial")
    choose(widget.stack.card("reconstruct").chooser, "lsqr")
    card = widget.stack.card("reconstruct")
    next(button for button in card.findChildren(QToolButton) if button.toolTip() == "run to here").click()
    widget.wait(lambda: not widget.runner.running)
    assert [key for _, key, _ in widget.bench.layers.shown()] == ["initial_pressure"]
    assert "stale" not in card.status.text()
    widget.edit(lambda document: document.set("grid", "pixels", 11))
    assert "stale" in card.status.text()
    widget.bench.layers.select("initial_pressure")
    widget.panel.recipe.click()
    text = widget.findChild(RecipeDialog).text.toPlainText()
    assert "pixels = 32" in text
    assert widget.bench.session.scan.fingerprint in text
    assert f"oatkit {oatkit.__version__}" in text


def test_edits_are_taken_back_one_by_one(widget):
    """Undo and redo walk through the edits of the fields, and the fields follow."""
    line = widget.stack.card("reconstruct").form.inputs["n_iterations"].line
    enter(line, "50")
    QTest.keyClick(line, Qt.Key.Key_Up)
    assert widget.bench.session.pipeline.reconstruct.n_iterations == 51
    widget.header.undo.click()
    assert (line.text(), widget.bench.session.pipeline.reconstruct.n_iterations) == ("50", 50)
    widget.header.undo.click()
    assert line.text() == "500"
    widget.header.redo.click()
    assert line.text() == "50"


def test_files_are_opened_and_saved_to_the_byte(widget, tmp_path):
    """A file with comments that is opened and saved is the same file; a bad one leaves the pipeline and a sentence."""
    text = "# mine\r\n" + presets()["tv"] + "\n# the end  \n"
    (tmp_path / "mine.toml").write_bytes(text.encode())
    widget.header.open_pipeline(tmp_path / "mine.toml")
    widget.header.save(tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_bytes() == text.encode()
    (tmp_path / "bad.toml").write_text("version = 1\nreconstruct = 5\n")
    widget.header.open_pipeline(tmp_path / "bad.toml")
    assert "reconstruct" in widget.header.message.text()
    assert widget.bench.session.document.text == text


def test_cancel_ends_a_run_within_a_second_and_the_next_one_works(widget):
    """While a solver works its image is shown; Cancel ends thread and layer in a second; then it runs again."""
    slow(widget)
    took = [seconds_to_cancel(widget) for _ in range(3)]
    assert min(took) < 1  # of three, since others may be at work on this machine
    assert widget.bench.layers.find(ITERATE) is None
    assert widget.panel.progress.text() == "cancelled"
    choose(widget.stack.card("reconstruct").chooser, "nnls")
    run(widget)
    assert widget.bench.layers.find("initial_pressure") is not None


@pytest.mark.parametrize("error", [RuntimeError("out of luck"), SolverError("no luck today"), SystemExit(3)])
def test_an_exploding_plugin_leaves_a_sentence_and_a_usable_window(widget, monkeypatch, error):
    """Whatever a solver raises stands at its card, with details to copy; mended, the same widget runs."""
    cls = type(widget.bench.session.pipeline.reconstruct)

    def explode(self, problem):
        raise error
        yield

    with monkeypatch.context() as patch:
        patch.setattr(cls, "iterate", explode)
        run(widget)
    card = widget.stack.card("reconstruct")
    assert str(error) in card.message.text()
    card.copy.click()
    assert "Traceback" in QApplication.clipboard().text()
    assert widget.panel.progress.text() == "failed at Reconstruct"
    run(widget)
    assert card.message.text() == ""
    assert widget.bench.layers.find("initial_pressure") is not None


def test_another_frame_ends_the_run_of_the_one_before(widget):
    """Going to another frame ends a run, so that no image is taken for one of the new frame."""
    slow(widget)
    widget.panel.run.click()
    widget.wait(lambda: widget.bench.layers.find(ITERATE) is not None)
    widget.header.frame.setValue(1)
    assert not widget.runner.running
    assert widget.bench.session.frame == 1
    assert list(widget.bench.layers.shown()) == []
    widget.wait(lambda: not jobs(), seconds=5)


def test_without_a_scan_it_says_what_to_do(widget):
    """Run without a scan asks for one."""
    widget.bench.session.scan = None
    run(widget)
    assert "no scan is open" in widget.panel.message.text()


def test_a_window_closed_during_a_run_leaves_no_thread(make_napari_viewer_proxy, small_scan, qtbot, capfd):
    """Closing the viewer while a solver works ends the thread, and nothing is printed."""
    viewer = make_napari_viewer_proxy()
    widget = in_viewer(viewer, small_scan, qtbot)
    slow(widget)
    widget.panel.run.click()
    widget.wait(lambda: widget.bench.layers.find(ITERATE) is not None)
    assert jobs()
    viewer.close()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    QApplication.processEvents()
    assert not jobs()
    assert "Traceback" not in capfd.readouterr().err


# Many scans


def test_a_batch_goes_on_after_a_failure(make_napari_viewer_proxy, small_scan, small_scan_file, qtbot, tmp_path):
    """Of three files the broken one has its reason and the others their results, equal to those of the engine."""
    viewer = make_napari_viewer_proxy()
    pipeline = in_viewer(viewer, small_scan, qtbot)
    choose(pipeline.stack.card("reconstruct").chooser, "lsqr")
    batch = BatchWidget(viewer)
    twin = tmp_path / "twin" / small_scan_file.name
    twin.parent.mkdir()
    twin.write_bytes(small_scan_file.read_bytes())
    (tmp_path / "broken.h5").write_bytes(b"oatkit scan 1\nnothing more")
    batch.add([small_scan_file, tmp_path / "broken.h5", twin])
    batch.folder.setText(str(tmp_path / "out"))
    batch.run.click()
    pipeline.wait(lambda: not batch.running)
    assert [batch.states[row].word for row in range(3)] == ["done", "failed", "done"]
    assert "broken.h5" in batch.table.item(1, 1).text()
    expected = oatkit.run(pipeline.bench.session.pipeline, oatkit.read(small_scan_file), frame=1)
    for name in ("small.zarr", "small-2.zarr"):
        made = oatkit.load(tmp_path / "out" / name).frame(1)["initial_pressure"]
        assert (made.values == expected["initial_pressure"].values).all()
    batch.show_result(2)
    assert pipeline.bench.layers.find("initial_pressure") is not None
