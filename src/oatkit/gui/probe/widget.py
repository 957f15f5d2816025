"""The probe: click on an image and see its spectrum, draw a line and see the profile."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QFileDialog, QVBoxLayout, QWidget

from oatkit.atomic import write_file
from oatkit.errors import OatkitError, ValidationError
from oatkit.gui.images.world import from_world
from oatkit.gui.leaving import when_gone
from oatkit.gui.parts.forms import Message
from oatkit.gui.parts.plots import PlotView
from oatkit.gui.parts.scrolling import scrolled
from oatkit.gui.probe.layer import ProbeLayer, colour_of
from oatkit.gui.probe.panels import LINE, POINT, ChromophoreBoxes, Findings, Tools
from oatkit.gui.probe.probe import (
    LIVE,
    Probe,
    Seen,
    Spectrum,
    fit_lines,
    nothing_there,
    plots_of,
    seen,
    spectra_of,
    values_of,
)
from oatkit.gui.probe.profile import Trace, peak_lines, profile_csv, profile_plots, traces
from oatkit.gui.workbench import workbench
from oatkit.regions import EllipseRegion, RegionRow, write_csv
from oatkit.regions.profile import Point

SPREAD = "mean ± standard deviation of the pixels that have a value"
PLOT_HEIGHT = 200
"""Dots."""
NOTHING_SHOWN = "There is no visible image to probe: open a scan or switch a layer on."


class ProbeWidget(QWidget):
    """Spectra and values at places, profiles along a line, of all visible images."""

    def __init__(self, napari_viewer: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self.bench = workbench(napari_viewer)
        self.shapes = ProbeLayer(self.bench.layers)
        self.rows: list[RegionRow] = []
        self.spectra: list[Spectrum] = []
        self.traces: list[Trace] = []
        self._probe, self._stale = Probe(), True
        self._shown: Any = None
        """All that what is shown depends on; images by their identity, which holds while they are kept."""
        self._images: list[Seen] = []
        self._wanted: Point | None = None
        """Where the mouse asks for a point, until it is drawn."""
        self._later = QTimer(self)  # many moves of the mouse between two pictures are one
        self._later.setSingleShot(True)
        self._later.timeout.connect(self.refresh)
        self.tools, self.boxes, self.findings = Tools(), ChromophoreBoxes(), Findings()
        self.plots = PlotView(napari_viewer, height=PLOT_HEIGHT)
        self.message = Message()
        self._arrange()
        self._connect()

    def refresh(self) -> None:
        """Measure what is looked at, and show it; nothing is done while nobody sees it."""
        self._stale = not self.isVisible()
        if self._stale:
            return
        if self._wanted is not None:
            self._show_point(*self._wanted)
        self.shapes.tidy()
        self._later.stop()  # nothing has changed since that is not looked at now
        images, viewing = list(seen(self.bench.layers)), self.bench.viewing
        plane = self.bench.layers.plane
        state = (
            self.tools.mode, self.shapes.places(), self.shapes.line(), plane, viewing.wavelength_nm,
            self.boxes.chosen(), [(one.title, id(one.image), one.frame) for one in images],
        )  # fmt: skip
        self.tools.show_pins(self.shapes.pinned(), any(place.name == LIVE for place in state[1]))
        if state == self._shown:
            return
        self._shown, self._images = state, images
        try:
            (self._show_profile if self.tools.mode == LINE else self._show_places)(images)
        except OatkitError as error:
            self.message.say(str(error))

    def _show_places(self, images: list[Seen]) -> None:
        places = self.shapes.places()
        self.rows = self._probe.rows(images, places)
        self.spectra = spectra_of(self.rows, images, self.boxes.chosen())
        colours = {place.name: colour_of(place.name) for place in places}
        self._show_plots(plots_of(self.spectra, self.bench.viewing.wavelength_nm, colours))
        lines = fit_lines(self.spectra, self.boxes.chosen())
        self.findings.show_found(lines if self.rows else [], values_of(self.rows, images))
        self.message.say(self._no_image(images) or nothing_there(self.rows))

    def _show_profile(self, images: list[Seen]) -> None:
        line = self.shapes.line()
        self.traces = [] if line is None else traces(images, line, self.bench.layers.plane)
        self._show_plots(profile_plots(self.traces))
        self.findings.show_found(peak_lines(self.traces), [])
        self.message.say(self._no_image(images))

    def _show_plots(self, plots: list[Any]) -> None:
        self.plots.setVisible(bool(plots))
        self.plots.show_plots(plots)
        self.tools.enable_saving(bool(self.traces if self.tools.mode == LINE else self.rows), bool(plots))

    def _no_image(self, images: list[Seen]) -> str:
        return "" if images or not self.tools.mode else NOTHING_SHOWN

    def save_csv(self, path: Path) -> None:
        """Write what is shown as a table, in place of what `path` holds. Raises `ResultError`."""
        if self.tools.mode == LINE:
            write_file(path, profile_csv(self.traces).encode(), overwrite=True)
        else:
            write_csv(self.rows, path, overwrite=True)

    def save_png(self, path: Path) -> None:
        """Write the plots as a picture, in place of what `path` holds. Raises `ResultError`."""
        if self.tools.mode == LINE:
            self.plots.save(path, "Profiles along a line", " · ".join(peak_lines(self.traces)))
        else:
            fits = fit_lines(self.spectra, self.boxes.chosen())
            self.plots.save(path, "Spectra", " · ".join([SPREAD, *fits]))

    def _use(self, tool: str) -> None:
        """Let the user work with a tool of the layer of shapes."""
        if tool == "pan_zoom" or any(True for _ in seen(self.bench.layers)):
            self.shapes.use(tool)
        self.boxes.setVisible(self.tools.mode != LINE)
        self._soon()

    def _drag(self, viewer: Any, event: Any) -> Iterator[None]:
        """Probe where the mouse is pressed and wherever it is dragged; pan and zoom are left alone otherwise."""
        if not self._takes(event):
            return
        self._probe_at(event)
        yield
        while event.type == "mouse_move":
            self._probe_at(event)
            yield
        event.handled = True

    def _takes(self, event: Any) -> bool:
        viewer = self.bench.viewer
        active = viewer.layers.selection.active
        # Whoever draws into another layer wants the click for that.
        elsewhere = active is not None and str(active.mode) not in ("pan_zoom", "transform")
        flat = tuple(viewer.dims.displayed) == tuple(range(viewer.dims.ndim))[-2:]
        wanted = self.tools.mode == POINT and self.isVisible() and event.button == 1 and not event.modifiers
        return wanted and flat and not elsewhere

    def _probe_at(self, event: Any) -> None:
        y, x = from_world(event.position).tolist()
        self._wanted = (y, x)
        event.handled = True
        self._soon()

    def _show_point(self, y: float, x: float) -> None:
        self._wanted = None
        try:
            self.shapes.point((y, x), 1e-3 * self.tools.radius_mm)
        except ValidationError as error:  # a metre away, where a small picture leaves room for it
            self.message.say(str(error))

    def _set_radius(self) -> None:
        live = next((place for place in self.shapes.places() if place.name == LIVE), None)
        if isinstance(live, EllipseRegion):
            self.shapes.point(live.centre_m, 1e-3 * self.tools.radius_mm)

    def _pin(self) -> None:
        self.shapes.pin()
        self._soon()

    def _unpin(self, names: list[str]) -> None:
        self.shapes.unpin(names)
        self._soon()

    def _pick(self, plot: int, curve: int, point: int) -> None:
        """Go to the wavelength of a point."""
        if self.tools.mode != LINE:
            self.bench.viewing.go_to(float(self.plots.plots[plot].curves[curve].x[point]))

    def _ask(self, what: str, suffix: str, write: Callable[[Path], None]) -> None:
        path, _ = QFileDialog.getSaveFileName(self, what, f"probe{suffix}", f"*{suffix}")
        if not path:
            return
        try:
            write(Path(path))  # the dialog has asked about this very file
        except OatkitError as error:
            self.message.say(str(error))

    def _soon(self, event: Any = None) -> None:
        if not self._later.isActive():
            self._later.start()

    def showEvent(self, event: Any) -> None:  # noqa: D102
        super().showEvent(event)
        if self._stale:
            self._soon()

    def _arrange(self) -> None:
        inner = QWidget()
        column = QVBoxLayout(inner)
        column.setContentsMargins(0, 0, 0, 0)
        for part in (self.plots, self.findings):
            column.addWidget(part)
        column.addStretch(1)
        outer = QVBoxLayout(self)
        outer.setContentsMargins(6, 6, 6, 6)
        outer.setSpacing(4)
        for part in (self.tools, self.boxes, self.message):
            outer.addWidget(part)
        outer.addWidget(scrolled(inner), 1)
        self.setMinimumWidth(320)

    def _connect(self) -> None:
        viewer, tools = self.bench.viewer, self.tools
        tools.tool_taken.connect(self._use)
        tools.radius_changed.connect(self._set_radius)
        tools.pin.clicked.connect(lambda: self._pin())
        tools.unpin_wanted.connect(self._unpin)
        tools.csv.clicked.connect(lambda: self._ask("Save the table", ".csv", self.save_csv))
        tools.png.clicked.connect(lambda: self._ask("Save the picture", ".png", self.save_png))
        self.boxes.changed.connect(self._soon)
        self.plots.picked.connect(self._pick)
        self.shapes.changed.connect(self._soon)
        changed, events, soon, drag = self.bench.viewing.changed, viewer.layers.events, self._soon, self._drag
        changed.connect(soon)
        events.connect(soon)  # of the layers themselves, too: one is switched on or has another name
        viewer.mouse_drag_callbacks.append(drag)

        def leave() -> None:
            changed.disconnect(soon, missing_ok=True)
            events.disconnect(soon)
            if drag in viewer.mouse_drag_callbacks:
                viewer.mouse_drag_callbacks.remove(drag)

        when_gone(self, leave)
