"""How time grows with pixels, detectors, wavelengths and frames, and what 28,000 frames would take.

    python benchmarks/growth.py

Everything is measured in one run, each row in a process of its own; the last lines extrapolate the measured frame, and
say so. A row has one number changed against the first: 200 x 200 pixels, 256 detectors, 1 wavelength, 1 frame.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import oatkit
from oatkit.simulate import simulate_scan
from operators import cpu_model, scanner

WHOLE_BODY_FRAMES = 28_000
FIRST = {"pixels": 200, "detectors": 256, "wavelengths": 1, "frames": 1}
CHANGED = (
    *({"pixels": n} for n in (128, 256, 384, 512)),
    *({"detectors": n} for n in (64, 128, 512)),
    *({"wavelengths": n} for n in (4, 12)),
    *({"frames": n} for n in (2, 4)),
)


def main() -> None:
    """Measure all rows and print them, then the plan."""
    print(f"{cpu_model()}, {os.cpu_count()} cores; maxent to a gap of 1e-4, from raw signals to a stored image\n")
    print(f"{'pixels':>7}{'detectors':>11}{'wavelengths':>13}{'frames':>8}{'seconds':>9}{'ratio':>8}{'MB out':>8}")
    rows = []
    for change in ({}, *CHANGED):
        row = FIRST | change
        found = json.loads(subprocess.check_output([sys.executable, __file__, json.dumps(row)], text=True))
        rows.append(found)
        size = f"{row['pixels']:7}{row['detectors']:11}{row['wavelengths']:13}{row['frames']:8}"
        ratio = found["seconds"] / rows[0]["seconds"]
        print(f"{size}{found['seconds']:9.2f}{ratio:8.2f}{found['output_bytes'] / 1e6:8.2f}", flush=True)
    plan(rows[-2], rows[-1])


def plan(few: dict[str, float], more: dict[str, float]) -> None:
    """Extrapolate from two runs that differ in their frames alone."""
    each = (more["seconds"] - few["seconds"]) / 2
    size = (more["output_bytes"] - few["output_bytes"]) / 2
    print(f"\none frame more: {each:.2f} s, {size / 1e6:.2f} MB")
    print(f"{WHOLE_BODY_FRAMES} such frames, extrapolated and not run:")
    for workers, where in ((1, "this machine"), (16, "16 such machines, --shard I/16"), (100, "100 of them")):
        print(f"  {where:<32}{WHOLE_BODY_FRAMES * each / workers / 3600:8.1f} h")
    print(f"  {'output':<32}{WHOLE_BODY_FRAMES * size / 1e9:8.1f} GB")


def simulated(row: dict[str, int]) -> oatkit.Scan:
    """Return a scan of the phantom "breast"; wavelengths and frames differ in their noise."""
    arc = oatkit.plugin("forward_model", "arc")()
    count = row["wavelengths"] * row["frames"]
    whole = simulate_scan("breast", arc, geometry=scanner(row["detectors"]), frames=count)
    signals = np.asarray(whole.signals).reshape(row["frames"], row["wavelengths"], *whole.geometry.shape)
    return oatkit.Scan(signals, whole.geometry, tuple(700.0 + 10 * np.arange(row["wavelengths"])))


def measured(row: dict[str, int]) -> dict[str, float]:
    """Return the seconds of a run with warm kernels, and the size of what it wrote."""
    scan = simulated(row)
    small, pipeline = (oatkit.Pipeline.load("maxent", [f"grid.pixels={n}"]) for n in (32, row["pixels"]))
    with tempfile.TemporaryDirectory() as folder:
        oatkit.run_frames(small, scan, f"{folder}/warm.zarr", range(1))
        start = time.perf_counter()
        oatkit.run_frames(pipeline, scan, f"{folder}/out.zarr")
        seconds = time.perf_counter() - start
        size = sum(path.stat().st_size for path in Path(folder, "out.zarr").rglob("*") if path.is_file())
    return {"seconds": seconds, "output_bytes": size}


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(measured(json.loads(sys.argv[1]))))
    else:
        main()
