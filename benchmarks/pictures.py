"""Takes the pictures of the window for README and docs, by driving the real program on simulated scans.

    xvfb-run -a -s "-screen 0 1600x1000x24" python benchmarks/pictures.py [FOLDER [all]]

With ``all`` each is also taken at 1024 x 700, and in the light theme, to be looked at.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import napari
import numpy as np
from napari.qt import get_qapp
from napari.utils.io import imsave

from oatkit.demo.oxygen import CHANGES
from oatkit.gui.probe.panels import LINE, POINT
from oatkit.gui.window import make_window
from oatkit.gui.workbench import Workbench, workbench
from oatkit.pipeline import preset, set_value
from oatkit.regions import EllipseRegion, RectangleRegion

LARGE, SMALL = (1400, 900), (1024, 700)


def live(seconds: float) -> None:
    """Let the window live for a while."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        get_qapp().processEvents()
        time.sleep(0.01)


def live_until(condition: Callable[[], bool], seconds: float = 240) -> None:
    """Let the window live until a condition holds; raises TimeoutError where it does not."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("the window did not come to it")
        live(0.05)


class Studio:
    """One window, and the pictures of it."""

    def __init__(self, folder: Path, everything: bool) -> None:
        self.folder, self.everything = folder, everything
        self.viewer: napari.Viewer = make_window()
        self.bench: Workbench = workbench(self.viewer)

    def widget(self, name: str) -> Any:
        """Bring a dock to the top and return its widget."""
        title = next(title for title in self.viewer.window.dock_widgets if title.startswith(name))
        widget = self.viewer.window.dock_widgets[title]
        dock = widget
        while not hasattr(dock, "raise_") or not hasattr(dock, "toggleViewAction"):
            dock = dock.parent()
        dock.raise_()
        live(0.3)
        return widget

    def take(self, name: str) -> None:
        """Write a picture of the whole window."""
        self._take(f"{name}.png", LARGE)
        if self.everything:
            self._take(f"{name}-small.png", SMALL)
            self.viewer.theme = "light"
            self._take(f"{name}-light.png", LARGE)
            self.viewer.theme = "dark"

    def _take(self, name: str, size: tuple[int, int]) -> None:
        self.viewer.window.resize(*size)
        live(0.5)
        self.viewer.reset_view()
        live(0.5)
        imsave(str(self.folder / name), self.viewer.screenshot(canvas_only=False, flash=False))
        print(self.folder / name)

    def open_sample(self, name: str) -> None:
        """Take a sample from napari's menu and wait for its first picture."""
        self.bench.session.scan = None
        self.viewer.open_sample("oatkit", name)
        live_until(lambda: self.bench.session.scan is not None)
        layers = self.bench.layers
        live_until(lambda: (layer := layers.find("scan")) is not None and layer.name.startswith("scan"))
        live(0.5)

    def run(self, name: str, changes: tuple[str, ...] = ()) -> None:
        """Take a preset, change it, press Run and wait for the images."""
        import tomlkit

        pipeline = self.widget("Pipeline")
        table = tomlkit.parse(preset(name))
        for change in changes:
            set_value(table, change)
        pipeline.edit(lambda document: document.replace(tomlkit.dumps(table)))
        pipeline.panel.run.click()
        live_until(lambda: not pipeline.runner.running)
        live(0.5)


def one_wavelength(studio: Studio) -> None:
    """A scan just opened, its images by two methods, and the L-curve."""
    studio.open_sample("breast")
    studio.take("gui")
    view = studio.widget("View")
    studio.run("lsqr")
    view.comparison.comparison.keep("least squares")
    studio.run("maxent")
    studio.widget("View")
    view.comparison.comparison.compare("initial_pressure")
    live(0.5)
    studio.take("gui-compare")
    studio.bench.side_by_side.leave()
    view.comparison.comparison.remove("least squares")
    weight = studio.widget("Weight")
    weight.start()
    live_until(lambda: not weight.running)
    weight.look_at(6)
    live(0.5)
    studio.take("gui-weight")
    weight.close()


def many_wavelengths(studio: Studio) -> None:
    """Blood and its oxygen, probed, and regions."""
    studio.open_sample("oxygen")
    studio.run("multispectral", CHANGES)
    view = studio.widget("View")
    view.unmixing.unmixing.show("so2")
    view.unmixing.blood.setChecked(True)
    live(0.5)
    studio.take("gui-oxygen")
    view.unmixing.blood.setChecked(False)
    for name in ("initial_pressure", "absorption"):
        studio.bench.layers.find(name).visible = True
    vessel, deep = brightest(studio)
    probe = studio.widget("Probe")
    probe.tools.take_mode(POINT)
    probe.shapes.point(vessel, 4e-4)
    probe.shapes.pin()
    probe.shapes.point(deep, 4e-4)
    for name in ("oxyhaemoglobin", "deoxyhaemoglobin"):
        probe.boxes.boxes[name].setChecked(True)
    probe.refresh()
    live(1.0)
    studio.take("gui-probe")
    probe.tools.take_mode(LINE)
    live(0.2)
    probe.tools.take_mode(LINE)
    probe.shapes.unpin(probe.shapes.pinned())
    regions = studio.widget("Regions")
    regions.regions.add(
        [EllipseRegion("vessel", vessel, (6e-4, 6e-4)), RectangleRegion("muscle", (deep[0], deep[1]), (1e-3, 1.5e-3))]
    )
    regions.show_numbers()
    live(1.0)
    studio.take("gui-regions")


def brightest(studio: Studio) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return where the absorption is largest, and the centre of the image, (y, x), m."""
    image = studio.bench.session.result["absorption"]
    row, column = np.unravel_index(np.nanargmax(image.values.mean(axis=0)), image.grid.shape)
    return (float(image.grid.y_m[row]), float(image.grid.x_m[column])), image.grid.centre_m


def main(folder: Path, everything: bool) -> None:
    """Take all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    studio = Studio(folder, everything)
    one_wavelength(studio)
    many_wavelengths(studio)
    studio.viewer.close()


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures"), sys.argv[2:] == ["all"])
