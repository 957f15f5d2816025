"""Overhead of the engines: 1,000 frames through one process, two processes and a dask cluster with two workers.

    python benchmarks/engines.py [FRAMES]

Overhead is what a run takes beyond the frames' own time divided by the workers; starting the workers is told apart. One
worker of the last run is killed midway, and all results are compared bit by bit.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import oatkit
from faults import same, write
from oatkit.batch import engine_named, run_frames
from operators import cpu_model

CHANGES = (
    "grid.pixels=100", "grid.field_of_view_mm=9", "reconstruct.n_iterations=20", "reconstruct.preconditioner=none",
)  # fmt: skip
WORKERS = 2


def timed(scan: oatkit.Scan, output: Path, engine: str, kill: bool = False) -> tuple[float, float, float]:
    """Return seconds until the first frame, of the rest, and of the frames themselves."""
    marks: list[float] = []

    def on_frame(frame: int) -> None:
        marks.append(time.perf_counter())
        if kill and len(marks) == scan.frames // 2:
            os.kill(worker(), signal.SIGKILL)

    start = time.perf_counter()
    by = engine_named(engine, None if engine == "serial" else WORKERS)
    result = run_frames(oatkit.Pipeline.load("lsqr", CHANGES), scan, output, on_frame=on_frame, engine=by)
    own = sum(sum(result.frame(i).seconds.values()) for i in range(result.frames))
    return marks[0] - start, marks[-1] - marks[0], own


def worker() -> int:
    """Return the process of one worker of the cluster."""
    found = subprocess.run(["pgrep", "-f", "multiprocessing.spawn.*spawn_main"], capture_output=True, text=True)
    children = [int(line) for line in found.stdout.split()]
    return max(children)


def main(frames: int) -> None:
    """Run all, print."""
    print(f"{cpu_model()}, {os.cpu_count()} cores; {frames} frames, {WORKERS} workers with one thread each")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scan = oatkit.read(write(folder / "scan.h5", frames))
        for engine, kill in (("serial", False), ("processes", False), ("dask", False), ("dask", True)):
            output = folder / f"{engine}-{kill}.zarr"
            first, rest, own = timed(scan, output, engine, kill)
            workers = 1 if engine == "serial" else WORKERS
            overhead = rest * workers / own - 1
            equal = "equal" if same(folder / "serial-False.zarr", output) else "NOT EQUAL"
            killed = ", a worker killed midway" if kill else ""
            print(f"{engine + killed:<32} first frame after {first:5.1f} s, the rest {rest:6.1f} s,"
                  f" overhead {100 * overhead:5.1f} %, {equal}")  # fmt: skip


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
