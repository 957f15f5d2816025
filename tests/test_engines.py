"""Who runs the frames does not matter: the results of all engines are equal, bit by bit, and none loses a frame."""

import os
import signal

import numpy as np
import pytest

from many_frames import same, write_frames_of
from oatkit import Pipeline, ResultError, ValidationError
from oatkit.batch import engine_named, join, run_frames, shard_of
from oatkit.store import load, verify
from packages import install, run_oatkit

FRAMES = 7
CHANGES = ("grid.pixels=32", "grid.field_of_view_mm=9", "reconstruct.n_iterations=5")


@pytest.fixture(scope="module")
def scan(small_scan, tmp_path_factory):
    """Seven different frames in a file."""
    return write_frames_of(small_scan, FRAMES, tmp_path_factory.mktemp("engines") / "seven.h5")


@pytest.fixture(scope="module")
def pipeline():
    """A small and quick one."""
    return Pipeline.load("maxent", (*CHANGES, "reconstruct.weight=l-curve"))


@pytest.fixture(scope="module")
def whole(scan, pipeline, tmp_path_factory):
    """The result of one process."""
    return run_frames(pipeline, scan, tmp_path_factory.mktemp("whole") / "out.zarr").stored.path


@pytest.mark.parametrize("name", ["processes", "dask"])
def test_all_engines_give_the_same(scan, pipeline, whole, tmp_path, name):
    """Two workers give the images of one process, bit by bit."""
    told = []
    run_frames(pipeline, scan, tmp_path / "out.zarr", on_frame=told.append, engine=engine_named(name, 2))
    assert sorted(told) == list(range(FRAMES))
    assert same(whole, tmp_path / "out.zarr")


def test_the_command_line_has_engines(scan, whole, tmp_path):
    """`oatkit run --engine processes` gives the same."""
    sets = [part for change in (*CHANGES, "reconstruct.weight=l-curve") for part in ("--set", change)]
    run = ["run", "maxent", scan.source, "-o", str(tmp_path / "out.zarr"), *sets]
    done = run_oatkit(*run, "--engine", "processes", "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert same(whole, tmp_path / "out.zarr")
    done = run_oatkit(*run[:-2], "--engine", "process", "--overwrite")
    assert (done.returncode, done.stderr) == (2, "oatkit: no engine named 'process'; did you mean 'processes'?\n")


def test_shards_join_to_the_whole(scan, pipeline, whole, tmp_path):
    """Jobs that know nothing of each other, each with a shard of the frames, give parts of which the whole is made."""
    parts = []
    for i in (1, 2, 3):
        parts.append(tmp_path / f"{i}.zarr")
        run_frames(pipeline, scan, parts[-1], frames=shard_of(range(FRAMES), f"{i}/3"))
    join(parts[::-1], tmp_path / "out.zarr")
    assert same(whole, tmp_path / "out.zarr")
    with pytest.raises(ResultError, match="is the input"):
        join(parts, parts[0], overwrite=True)
    with pytest.raises(ValidationError, match=r"frames \[1, 4\] are in two"):
        join([*parts, parts[1]], tmp_path / "twice.zarr")


def test_shards_have_each_frame_once():
    """The shards of a run are disjoint, and together all of it; what is no shard is refused."""
    shards = [shard_of(range(10), f"{i}/4") for i in range(1, 5)]
    assert sorted(frame for shard in shards for frame in shard) == list(range(10))
    for wrong in ("0/4", "5/4", "1", "1/0", "a/b", "-1/4"):
        with pytest.raises(ValidationError, match="expected i/n"):
            shard_of(range(10), wrong)
    with pytest.raises(ValidationError, match="none is left"):
        shard_of(range(2), "3/3")


def test_a_run_goes_on_with_another_engine(scan, pipeline, whole, tmp_path):
    """What one process began, two processes end, in the same result."""
    output, done = tmp_path / "out.zarr", []

    def stop(event):
        if len(done) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_frames(pipeline, scan, output, on_event=stop, on_frame=done.append)
    run_frames(pipeline, scan, output, resume=True, engine=engine_named("processes", 2))
    assert same(whole, output)


DEADLY = '''
import os, signal
from pathlib import Path
from oatkit.api import Iterate, Solver, hookimpl

class Deadly(Solver):
    """Kills its process at one frame, as often as it is told."""

    name = "deadly"

    def iterate(self, problem):
        folder, times = Path(os.environ["DEATHS"]), int(os.environ["TIMES"])
        marks = list(folder.glob("death-*"))
        if 1.6 < abs(problem.data).max() / float(os.environ["LARGEST"]) < 1.7 and len(marks) < times:
            (folder / f"death-{len(marks)}").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        yield Iterate(problem.adjoint(problem.data), 1, converged=True)

@hookimpl
def oatkit_solvers():
    return [Deadly]
'''


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
@pytest.mark.parametrize(("engine", "times", "code"), [("processes", 1, 0), ("processes", 9, 3), ("dask", 9, 3)])
def test_a_killed_worker_costs_time_not_data(scan, tmp_path, engine, times, code):
    """A frame whose worker is killed is run again; one that kills every worker has failed, and the rest is there."""
    packages = install(tmp_path / "packages", "oatkit-deadly", DEADLY)
    pipeline = ("grid.pixels=32", "grid.field_of_view_mm=9", "reconstruct.use=deadly")
    sets = [part for change in pipeline for part in ("--set", change)]
    largest = float(abs(np.asarray(scan.frame(0).signals)).max())
    environment = {"DEATHS": str(tmp_path), "TIMES": str(times), "LARGEST": str(largest), "PYTHONPATH": str(packages)}
    run = ["run", "lsqr", scan.source, "-o", str(tmp_path / "out.zarr"), *sets]
    done = run_oatkit(*run, "--engine", engine, "--workers", "2", env={**os.environ, **environment})
    assert done.returncode == code, done.stderr
    result = load(tmp_path / "out.zarr")
    assert len(result.failed) == (1 if code else 0)
    assert all("died" in reason for reason in result.failed.values())
    assert verify(tmp_path / "out.zarr") == []
