"""Time the live preview in the real window: from moving a slider to the picture on the canvas; and compare its images.

    xvfb-run -a -s "-screen 0 1600x1000x24" python benchmarks/preview.py SCAN [--preset maxent]

The slider is moved once at a time, and the next move waits for the picture. The images of the preview are compared with
those of full runs, averaged over the pixels of the preview.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np
from napari.qt import get_qapp

from oatkit import Pipeline, run
from oatkit.gui.document import PipelineDocument
from oatkit.gui.opening import SCAN
from oatkit.gui.parts.number_slider import NumberSlider
from oatkit.gui.pipeline.widget import PipelineWidget
from oatkit.gui.preview.panel import PREVIEW
from oatkit.gui.preview.preview import CoarseImages, Wanted, has_weight, settled, with_speed
from oatkit.gui.window import make_window
from oatkit.gui.workbench import workbench
from oatkit.threads import thread_count
from oatkit.weights import with_weight
from operators import cpu_model

PAUSE_S = 0.3
"""Between moves, in which the picture is made better."""
SPEEDS_M_S, WEIGHTS = (-30.0, 0.0, 30.0), (1e-3, 1e-2, 1e-1)
"""Where images are compared: relative to the scan's speed of sound, and relative to |A|^2 x_ref."""


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scan", type=Path)
    parser.add_argument("--preset", default="maxent")
    parser.add_argument("--moves", type=int, default=25, help="of each slider")
    parser.add_argument("--no-images", action="store_true", help="time only")
    arguments = parser.parse_args()
    print(f"{cpu_model()}, {os.cpu_count()} cores, {thread_count()} threads, load {os.getloadavg()[0]:.1f}")
    time_sliders(arguments.scan, arguments.preset, arguments.moves)
    if not arguments.no_images:
        compare(arguments.scan, arguments.preset)


def time_sliders(path: Path, preset: str, moves: int) -> None:
    """Open the scan in a window, move its sliders, and print how long pictures take."""
    viewer = make_window(path)
    bench = workbench(viewer)
    live_until(lambda: bench.layers.find(SCAN) is not None)
    panel = viewer.window._qt_window.findChild(PipelineWidget).preview
    bench.session.document = PipelineDocument.of_preset(preset)
    bench.pipeline_changed.emit()
    geometry = bench.session.scan.geometry
    print(f"{preset}, {geometry.detectors.count} detectors x {geometry.n_samples} samples")
    for name, slider in (("speed of sound", panel.speed), ("weight", panel.weight)):
        if slider is panel.weight and not has_weight(bench.session.pipeline.reconstruct):
            continue
        taken = [1e3 * seconds_to_picture(viewer, bench, slider, move) for move in range(moves)]
        # The first picture is of data and an operator that were not at hand yet.
        print(f"{name}: median {np.median(taken):.0f} ms, slowest {max(taken[1:]):.0f} ms, first {taken[0]:.0f} ms")
    viewer.close()


def seconds_to_picture(viewer, bench, slider: NumberSlider, move: int) -> float:
    """Move a slider to where it has not been, and return how long it takes until that is drawn."""
    layer = bench.layers.find(PREVIEW)
    before = layer.data if layer is not None else None
    drawn: list[float] = []

    def note(event) -> None:
        now = bench.layers.find(PREVIEW)
        if now is not None and now.data is not before:
            drawn.append(time.perf_counter())

    canvas = viewer.window._qt_viewer.canvas._scene_canvas
    canvas.events.draw.connect(note, position="last")
    steps = slider.slider.maximum()
    start = time.perf_counter()
    slider.slider.setValue(round(steps * (0.2 + 0.6 * ((0.618 * move) % 1))))
    live_until(lambda: bool(drawn))
    canvas.events.draw.disconnect(note)
    live_for(PAUSE_S)
    return drawn[0] - start


def compare(path: Path, preset: str) -> None:
    """Print how like the first picture, and the one at rest, are to a full run."""
    from oatkit import read

    scan, makes = read(path), CoarseImages()
    pipeline = settled(Pipeline.load(preset), scan)
    own = scan.geometry.speed_of_sound_m_s
    cases = [(f"{own + by:.0f} m/s", with_speed(pipeline, own + by)) for by in SPEEDS_M_S]
    if has_weight(pipeline.reconstruct):
        cases += [(f"weight {w:g}", pipeline.with_solver(with_weight(pipeline.reconstruct, w))) for w in WEIGHTS]
    for name, case in cases:
        looks = [image.values[0] for image in makes.looks(Wanted(scan, 0, 0, case))]
        looks = [image.values[0] for image in makes.looks(Wanted(scan, 0, 0, case))]  # with all at hand
        full = averaged(run(case, scan)["initial_pressure"].values[0], len(looks[0]))
        first, rest = (np.corrcoef(look.ravel(), full.ravel())[0, 1] for look in (looks[0], looks[-1]))
        print(f"{name}: correlation with the full run {first:.3f} at first, {rest:.3f} at rest")


def averaged(values: np.ndarray, pixels: int) -> np.ndarray:
    """Return the mean over each of `pixels` x `pixels` larger pixels."""
    n = len(values)
    edges = np.linspace(0, n, pixels + 1)
    fine = np.arange(n)
    share = np.clip(np.minimum(fine + 1, edges[1:, None]) - np.maximum(fine, edges[:-1, None]), 0, None)
    share /= share.sum(axis=1, keepdims=True)
    return share @ values @ share.T


def live_for(seconds: float) -> None:
    """Let the window live for a while."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        get_qapp().processEvents()
        time.sleep(0.001)


def live_until(condition, seconds: float = 60) -> None:
    """Let the window live until a condition holds; raises TimeoutError where it does not."""
    end = time.perf_counter() + seconds
    while not condition():
        if time.perf_counter() > end:
            raise TimeoutError("the window did not come to it")
        get_qapp().processEvents()
        time.sleep(0.0005)


if __name__ == "__main__":
    main()
