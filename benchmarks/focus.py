"""What each focus metric picks for simulated bodies in water of 1503.7 m/s, and for a real scan; prints a table.

    python benchmarks/focus.py [SCAN]

One seed of the noise. The last columns: how far the maximum of the variance rises above its median, and the seconds.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import oatkit
from oatkit import Pipeline, Scan, plugin
from oatkit.focus import focus
from oatkit.focus.metrics import METRICS
from oatkit.simulate import msot_geometry, simulate_scan

TRUE_M_S = 1503.7


def scans() -> Iterator[tuple[str, Scan]]:
    """Yield phantoms at three levels of noise, noise alone, and the real scan where one is given."""
    arc = plugin("forward_model", "arc")()
    geometry = replace(msot_geometry(), speed_of_sound_m_s=TRUE_M_S)
    for phantom in ("breast", "vessel", "star", "disc"):
        for snr_db in (32.0, 10.0, -5.0):
            scan = simulate_scan(phantom, arc, geometry=geometry, snr_db=snr_db)
            yield f"{phantom}, {snr_db:g} dB", scan
    yield "noise", replace(scan, signals=np.random.default_rng(1).standard_normal(scan.signals.shape, np.float32))
    for path in sys.argv[1:]:
        yield f"{path.rpartition('/')[2]} (says {oatkit.read(path).geometry.speed_of_sound_m_s:.1f})", oatkit.read(path)


def main() -> None:
    """Sweep each scan with the preset `maxent` and print a Markdown table."""
    pipeline = Pipeline.load("maxent")
    print("| scan |", " | ".join(METRICS), "| above median | s |")
    print("|---|" + "---|" * (len(METRICS) + 2))
    for name, scan in scans():
        start = time.perf_counter()
        found = focus(pipeline, scan)
        seconds = time.perf_counter() - start
        curve = np.array(found.scores["variance"])
        picks = " | ".join(f"{pick:.1f}" for pick in found.picks.values())
        print(f"| {name} | {picks} | {curve.max() / np.median(curve) - 1:.3f} | {seconds:.1f} |")


if __name__ == "__main__":
    main()
