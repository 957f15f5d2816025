"""Takes the pictures of the window for README and docs, by driving the real program.

    xvfb-run -a -s "-screen 0 1600x1000x24" python benchmarks/pictures.py [FOLDER]

Writes gui.png (a scan just opened), gui-oxygen.png (a multispectral result) and both again as 1024 x 700, and in light.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import napari
from napari.qt import get_qapp
from napari.utils.io import imsave

from oatkit import Pipeline, run
from oatkit.demo_oxygen import CHANGES
from oatkit.gui.samples import oxygen
from oatkit.gui.window import make_window
from oatkit.gui.workbench import workbench

LARGE, SMALL = (1400, 900), (1024, 700)


def live(seconds: float) -> None:
    """Let the window live for a while."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        get_qapp().processEvents()
        time.sleep(0.01)


def live_until(condition: Callable[[], bool], seconds: float = 120) -> None:
    """Let the window live until a condition holds; raises TimeoutError where it does not."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("the window did not come to it")
        live(0.05)


def take(viewer: napari.Viewer, path: Path, size: tuple[int, int]) -> None:
    """Write a picture of the whole window."""
    viewer.window.resize(*size)
    live(0.5)
    viewer.reset_view()
    live(0.5)
    imsave(str(path), viewer.screenshot(canvas_only=False, flash=False))
    print(path)


def main(folder: Path) -> None:
    """Open the sample, then a result, and take pictures of both."""
    folder.mkdir(parents=True, exist_ok=True)
    viewer = make_window()
    bench = workbench(viewer)
    viewer.open_sample("oatkit", "breast")
    live_until(lambda: bench.session.scan is not None and viewer.layers[0].name.startswith("scan"))
    take(viewer, folder / "gui.png", LARGE)
    take(viewer, folder / "gui-small.png", SMALL)
    bench.layers.remove("scan")
    bench.layers.show_result(run(Pipeline.load("multispectral", CHANGES), oxygen()))
    take(viewer, folder / "gui-oxygen.png", LARGE)
    take(viewer, folder / "gui-oxygen-small.png", SMALL)
    viewer.theme = "light"
    take(viewer, folder / "gui-oxygen-light.png", LARGE)
    viewer.close()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))
