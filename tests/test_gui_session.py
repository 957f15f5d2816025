"""The state behind the windows: the numbers of the engine, jobs that always end, and nothing computed twice."""

import threading
import time

import pytest

import oatkit
from gui_sessions import small_session
from many_frames import same
from oatkit.batch import pieces, run_frames
from oatkit.errors import SolverError, ValidationError
from oatkit.events import StepDone
from oatkit.gui.batch.batch import run_all
from oatkit.gui.job import Job
from oatkit.gui.session import Converging, Finished, Session
from oatkit.gui.warming import warm_up


def finished(job):
    """What a job has yielded, once it has ended well."""
    assert job.wait(60)
    assert job.failure is None, job.failure
    return job.drain()


def test_the_session_gives_the_numbers_of_the_engine(small_scan):
    """A run in a session equals `oatkit.run` to the last bit, and ends with its result."""
    session = small_session(small_scan)
    items = finished(session.run())
    assert isinstance(items[-1], Finished)
    expected = oatkit.run(session.pipeline, small_scan)
    assert (items[-1].result["initial_pressure"].values == expected["initial_pressure"].values).all()
    assert session.result is items[-1].result


def test_only_what_changed_runs_again(small_scan):
    """After a change of the segmenter no solver takes a step."""
    session = small_session(small_scan)
    session.document.add("segment", "radial")
    assert any(isinstance(item, Converging) for item in finished(session.run()))
    session.document.set("segment", "blur", 0.5)
    again = finished(session.run())
    assert not any(isinstance(item, Converging) for item in again)
    assert "boundary" in [name for item in again if isinstance(item, StepDone) for name in item.images]


def test_a_run_may_end_at_a_step(small_scan):
    """Run to here: the steps after it are not run."""
    session = small_session(small_scan)
    session.document.add("segment", "radial")
    items = finished(session.run(up_to="reconstruct"))
    assert [item.step for item in items if isinstance(item, StepDone)] == ["preprocess", "reconstruct"]


def test_a_cancelled_run_leaves_a_usable_session(small_scan):
    """A run of many steps ends within a second of being cancelled, without failure; the next run works."""
    session = small_session(small_scan, "maxent")
    session.document.set("reconstruct", "tolerance", 1e-12)
    job = session.run()
    while not any(isinstance(item, Converging) for item in job.drain()):
        time.sleep(0.005)
    start = time.perf_counter()
    job.cancel()
    assert job.wait(5)
    assert time.perf_counter() - start < 1
    assert job.failure is None
    session.document.undo()
    assert isinstance(finished(session.run())[-1], Finished)


@pytest.mark.parametrize(
    "error", [RuntimeError("out of luck"), SolverError("no luck today"), SystemExit(3), KeyError("x")]
)
def test_whatever_a_plugin_raises_is_a_sentence_and_a_traceback(error):
    """A job never raises: its failure holds one sentence and the details to copy."""

    def explode(job):
        yield 1
        raise error

    job = Job(explode).start()
    assert job.wait(5)
    assert job.drain() == [1]
    assert str(error) in job.failure.sentence
    assert "Traceback" in job.failure.details


def test_without_a_scan_it_says_what_to_do():
    """Running without a scan is refused with the way to get one, and so is a frame that does not exist."""
    with pytest.raises(ValidationError, match="open the sample"):
        Session().run()
    with pytest.raises(ValidationError, match="frame 3"):
        Session().go_to_frame(3)


def test_opening_a_scan_goes_to_its_first_frame(small_scan_file):
    """A scan that is opened replaces the last one and its result."""
    session = Session(frame=1)
    session.open_scan(small_scan_file)
    assert (session.frame, session.result) == (0, None)
    assert session.scan.frames == 2


def test_the_absorption_is_calibrated_by_an_unmixer_that_is_not_run(small_scan):
    """Run to the absorption: its rule still asks the unmixer, whose own images are not made."""
    session = small_session(small_scan, "multispectral")
    session.document.set("preprocess", "high", 3.0, index=4)
    items = finished(session.run(up_to="absorption"))
    images = items[-1].result
    assert "absorption" in images
    assert "residual" not in images
    assert any("the spectra tell no calibration" in note for note in images.warnings)


def test_warming_up_ends_well():
    """What the window compiles beside itself runs to its end, so that nothing is left to compile for the first scan."""
    job = warm_up()
    assert job.wait(120)
    assert job.failure is None


def test_a_cancelled_batch_goes_on(small_scan_file, tmp_path, monkeypatch):
    """Started again, a batch takes up the frames that were done, and ends in the result of an undisturbed one."""
    pipeline = small_session(None).document.pipeline
    whole = run_frames(pipeline, oatkit.read(small_scan_file), tmp_path / "whole.zarr")
    original, go_on = pieces.run_resolved, threading.Event()

    def waiting(resolved, scan, frame, *more):
        assert frame == 0 or go_on.wait(30)
        return original(resolved, scan, frame, *more)

    monkeypatch.setattr(pieces, "run_resolved", waiting)
    job = run_all(pipeline, [small_scan_file], tmp_path)
    while not any(state.sentence == "1 of 2 frames" for state in job.drain()):
        assert not job.done
        time.sleep(0.001)
    job.cancel()
    go_on.set()
    assert job.wait(30)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == [".small.zarr.journal", ".small.zarr.unfinished", "whole.zarr"]
    job = run_all(pipeline, [small_scan_file], tmp_path)
    assert job.wait(30)
    assert job.drain()[-1].word == "done"
    assert same(whole.stored.path, tmp_path / "small.zarr")
