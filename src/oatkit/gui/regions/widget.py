"""The regions widget: draw regions of interest, read their numbers, and correct the outline of the body."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from oatkit.drawing.plot import ON_DARK
from oatkit.errors import OatkitError
from oatkit.gui.job import Job
from oatkit.gui.leaving import when_gone
from oatkit.gui.parts.buttons import button
from oatkit.gui.parts.forms import Message, plain
from oatkit.gui.parts.plots import PlotView
from oatkit.gui.parts.scrolling import scrolled
from oatkit.gui.regions.boundary_panel import BoundaryPanel
from oatkit.gui.regions.drawn import DrawnRegions
from oatkit.gui.regions.listing import RegionList
from oatkit.gui.regions.numbers import Shown, at_plane, live_rows, plots, shown_images, write_table
from oatkit.gui.regions.row_table import RowTable
from oatkit.gui.watching import watch
from oatkit.gui.workbench import workbench
from oatkit.reading import read_regions
from oatkit.regions import Region, RegionRow, load_regions, save_regions

REST_MS = 80
"""After a change, before the numbers are computed."""
NO_BACKGROUND = "no background"
WIDE = 340
CSV, PNG, TOML = "Table (*.csv)", "Picture (*.png)", "Regions (*.toml)"
ALL = "All files (*)"


class RegionsWidget(QWidget):
    """Regions, their table and spectra, and above them the bar for the boundary."""

    def __init__(self, napari_viewer: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self.bench = bench = workbench(napari_viewer)
        self.regions = DrawnRegions(bench.layers)
        self.rows: list[RegionRow] = []
        """At all wavelengths."""
        self._measured: Any = None
        self._kept: list[Shown] = []
        self._job: Job | None = None
        self.boundary = BoundaryPanel(bench)
        self.message, self.note = Message(), QLabel()
        self.note.setWordWrap(True)
        self.note.hide()
        self.list = RegionList(self.regions, self.message)
        self.background = QComboBox()
        self.background.setToolTip("the region against which the contrast-to-noise ratio (CNR) of the others is taken")
        self.background.addItem(NO_BACKGROUND)
        self.all_wavelengths = QCheckBox("All wavelengths")
        self.all_frames = QCheckBox("All frames")
        self.all_frames.setToolTip("the file gets all frames of the results that are shown")
        self.table = RowTable()
        self.plot = PlotView(bench.viewer)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(REST_MS)
        self._timer.timeout.connect(self._rested)
        self._arrange()
        self._connect()
        self.show_numbers()

    @property
    def chosen_background(self) -> str | None:
        """The name of the background, or None."""
        return self.background.currentText() if self.background.currentIndex() > 0 else None

    def show_numbers(self) -> None:
        """Measure what is shown, unless nothing has changed, and show the numbers of the wavelength looked at."""
        regions, wrong = self.regions.read()
        shown = shown_images(self.bench.layers)
        measured = (regions, [(one.key, id(one.image), one.frame) for one in shown], self.chosen_background)
        if measured != self._measured:
            self._measured, self._kept = measured, shown  # kept, so that no other image gets the same id
            self.rows, notes = live_rows(shown, regions, self.chosen_background)
            self._say_notes([*wrong, *notes], shown)
        wanted = self.rows if self.all_wavelengths.isChecked() else at_plane(self.rows, self.bench.layers.plane)
        self.table.show_rows(wanted, self.all_wavelengths.isChecked())
        numbers = {colour: number for number, colour in enumerate(ON_DARK)}
        colours = {n: numbers.get(c) for n, c in zip(self.regions.names, self.regions.colours, strict=True)}
        self.plot.show_plots(plots(self.rows, colours, self.bench.viewing.wavelength_nm))
        self.plot.setVisible(bool(self.plot.plots))
        for part in (self.csv, self.save):
            part.setEnabled(bool(regions))
        self.png.setEnabled(bool(self.plot.plots))

    def import_file(self, path: Path) -> None:
        """Draw the regions of a file, or say why that cannot be."""
        images = shown_images(self.bench.layers)
        self._add(lambda: load_regions(path, images[-1].image.grid if images else None))

    def import_of_scan(self) -> None:
        """Draw the regions that came with the scan, or say that there are none."""
        scan = self.bench.session.scan
        if scan is None:
            self.message.say("no scan is open")
            return
        self._add(lambda: read_regions(Path(scan.source)), f"no regions came with the scan {scan.name}".rstrip())

    def save_file(self, path: Path) -> None:
        """Write the regions as TOML, or say why that cannot be."""
        self._try(lambda: save_regions(self.regions.read()[0], path, overwrite=True), f"wrote {path.name}")

    def save_table(self, path: Path) -> None:
        """Write the numbers of all wavelengths as CSV, of all frames where that is chosen; beside the window."""
        shown, (regions, _) = shown_images(self.bench.layers), self.regions.read()

        def begin() -> None:
            self._job = write_table(shown, regions, self.chosen_background, path, self.all_frames.isChecked())
            watch(self._job, self._take, self._fail, self)

        self._try(begin)
        self._show_job()

    def save_plot(self, path: Path) -> None:
        """Write the spectra as PNG, or say why that cannot be."""
        self._try(lambda: self.plot.save(path, "Spectra of the regions"), f"wrote {path.name}")

    def cancel(self) -> None:
        """End the writing of the table; no file is left of it."""
        if self._job is not None:
            self._job.cancel()
            self._end("cancelled")

    def _take(self, item: Any) -> None:
        if isinstance(item, Path):
            self._end(f"wrote {item.name}")
        elif self._job is not None:
            self._say("frame {} of {}".format(*item))

    def _fail(self, sentence: str) -> None:
        self._end("")
        self.message.say(sentence)

    def _end(self, word: str) -> None:
        self._job = None
        self._say(word)
        self._show_job()

    def _show_job(self) -> None:
        self.stop.setVisible(self._job is not None)
        self.csv.setVisible(self._job is None)

    def _say(self, note: str) -> None:
        self.note.setText(note)
        self.note.setVisible(bool(note))

    def _say_notes(self, notes: Sequence[str], shown: Sequence[Shown]) -> None:
        if self.regions.names and not shown:
            notes = ["No image is visible: switch one on to see its numbers.", *notes]
        self._say("\n".join(notes))

    def _add(self, load: Callable[[], Sequence[Region]], none: str = "") -> None:
        def add() -> None:
            found = load()
            self.regions.add(found)
            self.message.say("" if found else none)

        self._try(add)

    def _try(self, action: Callable[[], None], done: str = "") -> None:
        self.message.say("")
        try:
            action()
        except OatkitError as error:
            self.message.say(plain(error))
        else:
            if done:
                self._say(done)

    def _rested(self) -> None:
        if self.isVisible():
            self.show_numbers()

    def showEvent(self, event: Any) -> None:
        """Measure what has changed while nobody could see it."""
        super().showEvent(event)
        self.show_numbers()

    def _follow_regions(self) -> None:
        self.list.show_regions()
        names = [self.background.itemText(i) for i in range(1, self.background.count())]
        if names != self.regions.names:
            chosen = self.background.currentIndex() if len(names) == len(self.regions.names) else 0  # one was renamed
            if self.chosen_background in self.regions.names:
                chosen = 1 + self.regions.names.index(self.chosen_background)
            self.background.clear()
            self.background.addItems([NO_BACKGROUND, *self.regions.names])
            self.background.setCurrentIndex(chosen)
        self._timer.start()

    def _follow_layers(self, event: Any = None) -> None:
        if event is None or event.type in ("visible", "removed"):
            self._timer.start()

    def _arrange(self) -> None:
        outer = QVBoxLayout(self)
        outer.setContentsMargins(0, 0, 0, 0)
        inner = QWidget()
        outer.addWidget(scrolled(inner))
        column = QVBoxLayout(inner)
        column.setContentsMargins(6, 6, 6, 6)
        column.setSpacing(4)
        column.addWidget(self.boundary)
        column.addLayout(self._tools())
        column.addWidget(self.list, 1)
        for part in (self.list, self.table, self.plot):  # else they would ask for what they want, not what they need
            part.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        for part in (self.message, self.note):
            column.addWidget(part)
        column.addLayout(self._choices())
        column.addWidget(self.table, 2)
        column.addWidget(self.plot, 3)
        self.setMinimumWidth(WIDE)

    def _tools(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setSpacing(4)
        self.tools = {mode: button(text, tip, partial(self.regions.draw, mode)) for mode, text, tip in MODES}
        self.opener = button("Import", "regions from a file: TOML, a picture of labels, or a scanner's", self._ask_open)
        self.scans = button("From scan", "the regions that came with the scan", self.import_of_scan)
        self.save = button("Save", "write the regions as TOML", self._ask_save)
        buttons = [*self.tools.values(), self.opener, self.scans, self.save]
        for i, part in enumerate(buttons):
            row, at = (0, 3 * i) if i < len(self.tools) else (1, 4 * (i - len(self.tools)))
            grid.addWidget(part, row, at, 1, 3 if row == 0 else 4)
        return grid

    def _choices(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setSpacing(4)
        self.csv = button("CSV", "write the numbers of all wavelengths", self._ask_csv)
        self.stop = button("Cancel", "end the writing; no file is left of it", self.cancel)
        self.stop.hide()
        self.png = button("PNG", "write the spectra as a picture", self._ask_png)
        grid.addWidget(QLabel("CNR against"), 0, 0)
        grid.addWidget(self.background, 0, 1, 1, 3)
        grid.addWidget(self.all_wavelengths, 1, 0)
        grid.addWidget(self.all_frames, 1, 1)
        row = QHBoxLayout()
        for part in (self.csv, self.stop, self.png):
            row.addWidget(part)
        grid.addLayout(row, 1, 2, 1, 2)
        grid.setColumnStretch(3, 1)
        return grid

    def _connect(self) -> None:
        bench, regions, layers = self.bench, self.regions, self.bench.viewer.layers.events
        regions.changed.connect(self._follow_regions)
        layers.connect(self._follow_layers)
        follow = self._follow_layers
        bench.viewing.changed.connect(follow)
        bench.result_changed.connect(follow)
        self.background.activated.connect(lambda _: self.show_numbers())
        self.all_wavelengths.toggled.connect(lambda _: self.show_numbers())
        self.list.show_regions()

        def leave() -> None:
            layers.disconnect(follow)
            bench.viewing.changed.disconnect(follow, missing_ok=True)
            bench.result_changed.disconnect(follow, missing_ok=True)
            regions.close()

        when_gone(self, leave)

    def _ask_open(self) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Import regions", "", ALL)
        if path:
            self.import_file(Path(path))

    def _ask_save(self) -> None:
        self._ask("Save the regions", "regions.toml", TOML, self.save_file)

    def _ask_csv(self) -> None:
        self._ask("Save the table", "regions.csv", CSV, self.save_table)

    def _ask_png(self) -> None:
        self._ask("Save the spectra", "spectra.png", PNG, self.save_plot)

    def _ask(self, title: str, proposed: str, kinds: str, save: Callable[[Path], None]) -> None:
        path, _ = QFileDialog.getSaveFileName(self, title, proposed, kinds)
        if path:
            save(Path(path))


MODES = (
    ("add_polygon", "Polygon", "click around a region; a double click ends it"),
    ("add_rectangle", "Rectangle", "draw a rectangle by dragging"),
    ("add_ellipse", "Ellipse", "draw an ellipse by dragging"),
    ("select", "Move", "select, move, turn and resize regions"),
)
