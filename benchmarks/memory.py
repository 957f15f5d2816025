"""How much memory and time a run over many frames takes: 10 and 100 frames of 12 wavelengths.

    python benchmarks/memory.py [PIPELINE [SLOT.KEY=VALUE ...]]

A disc of blood before 32 detectors of 400 samples lies in a scan file, and each run over it is a process of its own.
The pipeline is `multispectral` on 48 x 48 pixels unless another is named. Printed are the peak of the resident memory
(VmHWM, so Linux only), the time of a frame in the steps of its pipeline, and the time around them.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import oatkit
from oatkit import Geometry, Grid, Image, Pipeline, plugin
from oatkit.events import Event, StepDone
from oatkit.scanfile import write_scan
from oatkit.simulate import arc_detectors, disc, simulate_scan
from oatkit.spectra import chromophore

WAVELENGTHS_NM = tuple(float(w) for w in range(680, 901, 20))
SMALL = ("grid.pixels=48", "preprocess.band-pass.high=1.1", "unmix.probe=0")
GEOMETRY = Geometry(arc_detectors(32), 20e6, 400, start_time_s=17e-6, speed_of_sound_m_s=1500)
FRAMES = (10, 100)


def main() -> None:
    """Print a line for each number of frames, then how they compare."""
    pipeline, *changes = sys.argv[1:] or ["multispectral", *SMALL]
    peaks = []
    with tempfile.TemporaryDirectory() as folder:
        for frames in FRAMES:
            scan = Path(folder) / f"{frames}.h5"
            arc = plugin("forward_model", "arc")()
            write_scan(simulate_scan(blood_disc, arc, geometry=GEOMETRY, pixels=101, frames=frames), scan)
            table = measured(scan, Path(folder) / f"{frames}.zarr", pipeline, changes)
            peaks.append(table["peak_bytes"])
            steps, around = table["steps_s"] / frames, table["around_s"] / frames
            peak = f"peak {table['peak_bytes'] / 1e6:.1f} MB"
            print(f"{frames:4} frames: {peak}, {steps:.3f} s a frame in the steps, {1e3 * around:.1f} ms around them")
    print(f"peak of {FRAMES[1]} frames over that of {FRAMES[0]}: {peaks[1] / peaks[0]:.3f}")


def blood_disc(grid: Grid) -> Image:
    """Return a disc of 8 mm in the colour of half saturated blood."""
    colour = sum(chromophore(name).spectrum(WAVELENGTHS_NM) for name in ("oxyhaemoglobin", "deoxyhaemoglobin"))
    values = disc(grid, radius_m=8e-3).values * (colour / colour.max())[:, None, None]
    return Image(values, "initial_pressure", "a.u.", grid, WAVELENGTHS_NM)


def measured(scan: Path, output: Path, pipeline: str, changes: list[str]) -> dict[str, float]:
    """Run a pipeline over all frames in another process and return what it took."""
    command = [sys.executable, __file__, "--run", str(scan), str(output), pipeline, *changes]
    found: dict[str, float] = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
    return found


def run(scan: str, output: str, pipeline: str, *changes: str) -> None:
    """Run a pipeline over all frames and print what it took."""
    seconds: list[float] = []

    def count(event: Event) -> None:
        if isinstance(event, StepDone):
            seconds.append(event.seconds)

    loaded, found = Pipeline.load(pipeline, changes), oatkit.read(scan)
    start = time.perf_counter()
    oatkit.run_frames(loaded, found, output, on_event=count)
    around = time.perf_counter() - start - sum(seconds)
    print(json.dumps({"peak_bytes": peak_bytes(), "steps_s": sum(seconds), "around_s": around}))


def peak_bytes() -> int:
    """Return the largest resident memory of this process so far; getrusage would count its parent's, too."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


if __name__ == "__main__":
    run(*sys.argv[2:]) if sys.argv[1:2] == ["--run"] else main()
