"""Kills and flipped bits: what they cost. Prints counts; ends with exit code 1 where anything was lost or unseen.

    python benchmarks/faults.py [KILLS [FLIPS]]

Runs a simulated scan of 200 frames once undisturbed, then KILLS times (20) with kill -9 at a random moment, resumed,
and compares all images bit by bit; then flips FLIPS bits (200), one at a time, anywhere in the result.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import oatkit
from oatkit.errors import ResultError
from oatkit.scanfile import write_scan
from oatkit.simulate import arc_detectors, disc, simulate_scan

FRAMES = 200
CHANGES = [part for change in ("grid.pixels=32", "grid.field_of_view_mm=9") for part in ("--set", change)]


def write(path: Path, frames: int = FRAMES) -> Path:
    """Write a scan of frames that all differ, and return its path."""
    geometry = oatkit.Geometry(arc_detectors(48, 0.015, 270), 20e6, 400, start_time_s=2e-6, speed_of_sound_m_s=1500)
    arc = oatkit.plugin("forward_model", "arc")()
    scan = simulate_scan(
        lambda grid: disc(grid, radius_m=3e-3), arc, geometry=geometry, field_of_view_m=10e-3, pixels=91, frames=2
    )
    signals = np.asarray(scan.signals)[:1] * np.linspace(1, 2, frames)[:, None, None, None]
    valid = np.repeat(np.asarray(scan.valid)[:1], frames, axis=0)
    write_scan(oatkit.Scan(signals, scan.geometry, scan.wavelengths_nm, valid, name="many"), path)
    return path


def command(scan: Path, output: Path) -> list[str]:
    """Return the command that runs, or goes on."""
    start = [sys.executable, "-c", "from oatkit.cli import main; main()", "run", "lsqr", str(scan)]
    return [*start, "-o", str(output), *CHANGES, "--resume"]


def frames_done(output: Path) -> int:
    """Return how many frames the diary of a run knows."""
    journal = output.with_name(f".{output.name}.journal")
    return max(0, journal.read_bytes().count(b"\n") - 1) if journal.exists() else 0


def same(first: Path, second: Path) -> bool:
    """Say whether all images are equal, bit by bit, and both results are complete."""
    names = [path.relative_to(first) for path in first.glob("*/c/**/*") if path.is_file()]
    equal = all((first / name).read_bytes() == (second / name).read_bytes() for name in names)
    return bool(names) and equal and not oatkit.verify(second)


def kill(scan: Path, output: Path, frames: int) -> int:
    """Run, kill once so many frames are done, and return how many were kept."""
    with subprocess.Popen(command(scan, output), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None and frames_done(output) < frames:
            time.sleep(0.0005)
        process.kill()
    return frames_done(output)


def unseen_flips(result: Path, flips: int, rng: np.random.Generator) -> int:
    """Return how many of so many flipped bits neither `verify` nor reading found."""
    files = [path for path in result.rglob("*") if path.is_file()]
    sizes = np.array([path.stat().st_size for path in files], dtype=float)
    unseen = 0
    for index in rng.choice(len(files), size=flips, p=sizes / sizes.sum()):
        whole = files[index].read_bytes()
        damaged = bytearray(whole)
        damaged[int(rng.integers(len(whole)))] ^= 1 << int(rng.integers(8))
        files[index].write_bytes(damaged)
        unseen += not oatkit.verify(result) or not _refused(result)
        files[index].write_bytes(whole)
    return unseen


def _refused(result: Path) -> bool:
    try:
        found = oatkit.load(result)
        for frame in range(found.frames):
            dict(found.frame(frame))
    except ResultError:
        return True
    return False


def main(kills: int, flips: int) -> int:
    """Run all, print, and return the exit code."""
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scan, whole = folder / "scan.h5", folder / "whole.zarr"
        write(scan)
        subprocess.run(command(scan, whole), check=True, capture_output=True)
        equal = 0
        for trial in range(kills):
            output = folder / f"{trial}.zarr"
            kept = kill(scan, output, int(rng.integers(1, FRAMES)))
            subprocess.run(command(scan, output), check=True, capture_output=True)
            equal += same(whole, output)
            print(f"killed after {kept} of {FRAMES} frames, resumed: {'equal' if same(whole, output) else 'NOT EQUAL'}")
        unseen = unseen_flips(whole, flips, rng)
    print(f"{equal} of {kills} killed runs are bit-equal to the undisturbed one")
    print(f"{flips - unseen} of {flips} flipped bits were found")
    return int(equal < kills or unseen > 0)


if __name__ == "__main__":
    sys.exit(main(*[int(text) for text in (*sys.argv[1:], *("20", "200")[len(sys.argv) - 1 :])]))
