"""A run that is interrupted, by whatever, goes on where it was and ends in the same result, bit by bit."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import oatkit
from many_frames import same, write_frames_of
from oatkit import Pipeline, ResultError, ValidationError
from oatkit.batch import run_frames
from oatkit.events import StepStarted
from oatkit.store import load, verify
from packages import run_oatkit

FRAMES = 6
CHANGES = ("grid.pixels=32", "grid.field_of_view_mm=9", "reconstruct.n_iterations=5")


@pytest.fixture(scope="module")
def scan(small_scan, tmp_path_factory):
    """Six different frames in a file."""
    return write_frames_of(small_scan, FRAMES, tmp_path_factory.mktemp("resume") / "six.h5")


@pytest.fixture(scope="module")
def pipeline():
    """A small and quick one."""
    return Pipeline.load("lsqr", CHANGES)


@pytest.fixture(scope="module")
def whole(scan, pipeline, tmp_path_factory):
    """The result of an uninterrupted run."""
    return run_frames(pipeline, scan, tmp_path_factory.mktemp("whole") / "out.zarr").stored.path


def interrupted(pipeline, scan, path, frames_done, **options):
    """Run until so many frames are done, then press Ctrl-C."""
    done = []

    def stop(event):
        if len(done) == frames_done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_frames(pipeline, scan, path, on_event=stop, on_frame=done.append, **options)
    assert not path.exists()


def hidden(folder: Path) -> list[str]:
    """The names of what lies in a folder but must not be seen."""
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


@pytest.mark.parametrize("frames_done", [1, 4])
def test_an_interrupted_run_goes_on(scan, pipeline, whole, tmp_path, frames_done):
    """Only the frames that are missing run again, and the result is that of an uninterrupted run."""
    output = tmp_path / "out.zarr"
    interrupted(pipeline, scan, output, frames_done)
    ran, told = [], []
    run_frames(
        pipeline, scan, output, resume=True, on_frame=told.append,
        on_event=lambda event: ran.append(event) if getattr(event, "step", "") == "reconstruct" else None,
    )  # fmt: skip
    assert sum(isinstance(event, StepStarted) for event in ran) == FRAMES - frames_done
    assert sorted(told) == list(range(FRAMES))
    assert same(whole, output)
    assert verify(output) == []
    assert hidden(tmp_path) == []


def test_a_run_without_a_frame_leaves_nothing(scan, pipeline, tmp_path):
    """Interrupted before the first frame was done there is nothing to go on with, and nothing is left."""
    interrupted(pipeline, scan, tmp_path / "out.zarr", 0)
    assert list(tmp_path.iterdir()) == []


def test_nights_are_not_thrown_away(scan, pipeline, whole, tmp_path):
    """Without `resume` the next run refuses, and says what is there; with `overwrite` it starts anew."""
    output = tmp_path / "out.zarr"
    interrupted(pipeline, scan, output, 2)
    with pytest.raises(ResultError, match=r"left 2 of 6 frames; go on with it \(--resume"):
        run_frames(pipeline, scan, output)
    run_frames(pipeline, scan, output, overwrite=True)
    assert same(whole, output)
    assert hidden(tmp_path) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"changes": (*CHANGES, "grid.field_of_view_mm=8")}, r"pipeline.grid.field_of_view_mm \(9.0, now 8.0\)"),
        ({"frames": range(5)}, r"frames \(0, 1, 2, 3, 4, 5, now 0, 1, 2, 3, 4\)"),
    ],
)
def test_another_run_does_not_go_on_with_it(scan, pipeline, tmp_path, change, words):
    """With another pipeline or other frames the run is refused, with what differs, and the work stays."""
    output = tmp_path / "out.zarr"
    interrupted(pipeline, scan, output, 2)
    other = Pipeline.load("lsqr", change["changes"]) if "changes" in change else pipeline
    with pytest.raises(ValidationError, match=words):
        run_frames(other, scan, output, frames=change.get("frames"), resume=True)
    assert len(run_frames(pipeline, scan, output, resume=True)) == 1


def test_a_complete_result_is_not_run_again(scan, pipeline, whole):
    """`resume` on a result that is complete returns it; on that of another run it is refused."""
    before = (whole / "manifest.json").stat().st_mtime_ns
    assert run_frames(pipeline, scan, whole, resume=True).frames == FRAMES
    assert (whole / "manifest.json").stat().st_mtime_ns == before
    with pytest.raises(ResultError, match="of another run"):
        run_frames(Pipeline.load("lsqr", CHANGES[:2]), scan, whole, resume=True)


def test_rules_are_not_asked_twice(scan, tmp_path):
    """A weight that a rule chose in the interrupted run is the one that the rest runs with; how it was chosen stays."""
    pipeline = Pipeline.load("maxent", (*CHANGES, "reconstruct.weight=l-curve"))
    output = tmp_path / "out.zarr"
    interrupted(pipeline, scan, output, 1)
    steps = []
    run_frames(pipeline, scan, output, resume=True, on_event=lambda event: steps.append(getattr(event, "step", "")))
    assert not any("weight" in step for step in steps)
    run_frames(pipeline, scan, tmp_path / "whole.zarr")
    assert same(tmp_path / "whole.zarr", output)
    assert load(output).weight_choice == load(tmp_path / "whole.zarr").weight_choice


def test_a_torn_diary_costs_frames_and_nothing_else(scan, pipeline, whole, tmp_path):
    """Cut at any place, or with a bit flipped, the diary or a frame leads to the same result."""
    rng = np.random.default_rng(0)
    for trial in range(8):
        output = tmp_path / f"{trial}.zarr"
        interrupted(pipeline, scan, output, 3)
        torn = tmp_path / f".{trial}.zarr.journal"
        if trial % 2:
            torn = tmp_path / f".{trial}.zarr.unfinished/initial_pressure/c/1/0/0/0"
        content = bytearray(torn.read_bytes())
        where = int(rng.integers(len(content)))
        if trial % 4 < 2:
            torn.write_bytes(content[:where])
        else:
            content[where] ^= 1 << int(rng.integers(8))
            torn.write_bytes(content)
        run_frames(pipeline, scan, output, resume=True)
        assert same(whole, output)
        assert verify(output) == []


def test_a_frame_that_failed_has_failed_for_good(scan, pipeline, tmp_path, monkeypatch):
    """The reason of a frame that failed before the interruption is in the result."""
    from oatkit.batch import pieces

    def run_resolved(resolved, scan, frame, *more):
        if frame == 1:
            raise oatkit.SolverError("the light was off")
        return original(resolved, scan, frame, *more)

    original = pieces.run_resolved
    monkeypatch.setattr(pieces, "run_resolved", run_resolved)
    interrupted(pipeline, scan, tmp_path / "out.zarr", 3)
    monkeypatch.undo()
    result = run_frames(pipeline, scan, tmp_path / "out.zarr", resume=True)
    assert dict(result.failed) == {1: "frame 1: the light was off"}


WAITING = """
import sys, time
import oatkit
from oatkit.batch import run_frames
scan = oatkit.read(sys.argv[1])
pipeline = oatkit.Pipeline.load("lsqr", sys.argv[4:])
def slow(frame):
    print(frame, flush=True)
    time.sleep(float(sys.argv[3]))
run_frames(pipeline, scan, sys.argv[2], on_frame=slow, resume=True)
"""


def start(scan, output, pause):
    """Run in a process of its own that waits after each frame, and return it once one is done."""
    command = [sys.executable, "-c", WAITING, scan.source, str(output), str(pause), *CHANGES]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    assert process.stdout.readline().strip() == "0"
    return process


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
def test_two_runs_do_not_write_one_output(scan, pipeline, whole, tmp_path):
    """The second run is told who writes; once that one is killed, the next goes on with its frames."""
    output = tmp_path / "out.zarr"
    with start(scan, output, 60) as process:
        with pytest.raises(ResultError, match=f"is being written by process {process.pid} on "):
            run_frames(pipeline, scan, output, resume=True)
        process.kill()
    run_frames(pipeline, scan, output, resume=True)
    assert same(whole, output)
    assert hidden(tmp_path) == []


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
@pytest.mark.slow
def test_kills_at_any_time_cost_nothing(scan, whole, tmp_path):
    """Runs that are killed at random times, later each time, until one comes to its end give the same result."""
    rng, kills = np.random.default_rng(1), 0
    output = tmp_path / "out.zarr"
    patience = 0.1
    while not output.exists():
        patience += rng.uniform(0.1, 0.3)
        with start(scan, output, 0.1) as process:
            try:
                process.wait(patience)
            except subprocess.TimeoutExpired:
                process.kill()
                kills += 1
    assert same(whole, output)
    assert verify(output) == []
    assert kills


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_keeps_the_frames(scan, whole, tmp_path, number, code):
    """Asked to end, the command line says that it was, exits with the code of that, and `--resume` goes on."""
    output = tmp_path / "out.zarr"
    run = ["run", "lsqr", scan.source, "-o", str(output), *(part for c in CHANGES for part in ("--set", c))]
    command = [sys.executable, "-c", "from oatkit.cli import main; main()", *run]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        journal = tmp_path / ".out.zarr.journal"
        while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > 1):
            time.sleep(0.002)
        process.send_signal(number)
        process.send_signal(number)  # and once more, as impatient people do
        _, said = process.communicate(timeout=60)
    if process.returncode == 0:
        pytest.skip("it had ended before it was asked to")
    assert process.returncode == code
    assert "Traceback" not in said
    assert "terminated" in said or "interrupted" in said
    done = run_oatkit(*run, "--resume")
    assert done.returncode == 0, done.stderr
    assert f"wrote {output} in " in done.stdout
    assert same(whole, output)
    assert run_oatkit(*run, "--resume").stdout.endswith(f"{output} was complete already\n")


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 200 kB, for whoever may mount one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=200k,nr_inodes=1000", "tmpfs", str(folder)]
    if os.name != "posix" or os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("only root may mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_full_disk_keeps_what_was_done(scan, pipeline, whole, small_disk):
    """One sentence and exit code 1; nothing under the final name; once there is space, `--resume` goes on."""
    output, filler = small_disk / "out.zarr", small_disk / "filler"
    interrupted(pipeline, scan, output, 2)
    filler.write_bytes(bytes(shutil.disk_usage(small_disk).free))
    run = ["run", "lsqr", scan.source, "-o", str(output), *(part for c in CHANGES for part in ("--set", c)), "--resume"]
    done = run_oatkit(*run)
    assert done.returncode == 1
    assert [line for line in done.stderr.splitlines() if line.startswith("oatkit:")] == done.stderr.splitlines()
    assert "No space left on device" in done.stderr
    assert not output.exists()
    filler.unlink()
    done = run_oatkit(*run)
    assert done.returncode == 0, done.stderr
    assert same(whole, output)
    assert verify(output) == []
