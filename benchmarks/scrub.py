"""How long a step of a slider takes in a stored result of 100 frames at 28 wavelengths; prints the median of each axis.

    xvfb-run -a -s "-screen 0 1600x1000x24" python benchmarks/scrub.py

Writes 450 MB into a temporary folder. A step is timed from moving the slider to the picture on the canvas.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
from napari.qt import get_qapp

from oatkit import Grid, Image
from oatkit.gui.opening import open_path
from oatkit.gui.window import make_window
from oatkit.gui.workbench import workbench
from oatkit.result import Result
from oatkit.store import StoreWriter

FRAMES, PIXELS = 100, 200
PAUSE_S = 0.05
"""Between steps of a hand; meanwhile the next frame is read."""
WAVELENGTHS_NM = tuple(np.linspace(660.0, 980.0, 28))


def write(path: Path) -> None:
    """Write noise, which no codec makes smaller."""
    rng, grid = np.random.default_rng(0), Grid((PIXELS, PIXELS), 1.25e-4)
    with StoreWriter(path, FRAMES) as writer:
        for frame in range(FRAMES):
            values = rng.standard_normal((len(WAVELENGTHS_NM), *grid.shape), np.float32)
            images = {"initial_pressure": Image(values, "initial_pressure", "a.u.", grid, WAVELENGTHS_NM)}
            writer.write(frame, Result(images, frame_index=frame))


def step_ms(viewer, axis: int, steps: range, pause_s: float = 0.0) -> str:
    """Move a slider, and time each step: on the clock, and of the processor, which other programs do not slow."""
    clock, processor = [], []
    for step in steps:
        time.sleep(pause_s)
        start = time.perf_counter(), time.process_time()
        viewer.dims.set_current_step(axis, step)
        get_qapp().processEvents()  # paints the canvas
        clock.append(1e3 * (time.perf_counter() - start[0]))
        processor.append(1e3 * (time.process_time() - start[1]))
    return f"median {np.median(clock):.0f} ms, slowest {max(clock):.0f} ms; {np.median(processor):.0f} ms of processor"


def main() -> None:
    """Write, open, scrub, print."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.zarr"
        write(path)
        viewer = make_window()
        start = time.perf_counter()
        open_path(workbench(viewer), path)
        print(f"opened in {time.perf_counter() - start:.2f} s")
        print("wavelength:", step_ms(viewer, 1, range(1, 28)))
        print("frame, 20 a second or less:", step_ms(viewer, 0, range(1, 50), PAUSE_S))
        print("frame, without a pause:", step_ms(viewer, 0, range(50, 90)))
        print("frame seen before:", step_ms(viewer, 0, range(88, 75, -1)))
        viewer.close()


if __name__ == "__main__":
    main()
