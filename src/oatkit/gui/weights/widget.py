"""The weight widget: sweep it, see the L-curve with what the rules pick, look at points, and take one."""

from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from qtpy.QtCore import QCoreApplication, Qt, QTimer
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QMenu,
    QPushButton,
    QSpinBox,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from oatkit.atomic import write_file
from oatkit.errors import OatkitError, ValidationError
from oatkit.gui.job import Job
from oatkit.gui.leaving import link, when_closed, when_gone
from oatkit.gui.parts.buttons import button
from oatkit.gui.parts.forms import Message, plain
from oatkit.gui.parts.plots import PlotView
from oatkit.gui.pipeline.runner import PERIOD_MS
from oatkit.gui.weights.curve import csv_of, heading_of, now_of, plot_of, short, words_of
from oatkit.gui.weights.sweep import HIGHEST, LOWEST, NUMBER, Request, Tried, WeightSweep, begin
from oatkit.gui.workbench import workbench

LAYER = "weight"
"""Key of the layer that shows the image of a point."""
FEWEST, MOST = 5, 99
"""Weights of a sweep."""
RULES = {
    "l-curve": "the corner of the L-curve",
    "hold-out": "what predicts every seventh detector best",
}
STEPS = {Qt.Key.Key_Left: -1, Qt.Key.Key_Right: 1}
BEFORE = "Sweep makes an image with each weight and draws how residual and penalty trade off"
HINT = "click a point to see its image; ← and → go to its neighbours"


class WeightWidget(QWidget):
    """A sweep over the weight of the session's solver, beside the window."""

    def __init__(self, napari_viewer: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self.bench = workbench(napari_viewer)
        self.sweep = WeightSweep(self.bench.session)
        self.shown: Tried | None = None
        """The point whose image is looked at."""
        self._job: Job | None = None
        self._begun: list[Job] = []
        """The job and those before it that may not be at their end yet."""
        self._seconds = 0.0
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.view = PlotView(self.bench.viewer)
        self.view.picked.connect(lambda plot, curve, point: self.look_at(point))
        self._arrange()
        self._timer = QTimer(self)
        self._timer.setInterval(PERIOD_MS)
        self._timer.timeout.connect(self._look)
        link(self, self.bench.scan_changed, self._follow_scan)
        link(self, self.bench.pipeline_changed, self._follow_pipeline)
        self._leave = partial(_end_all, self._begun)  # it outlives the widget, and must not keep it or its window
        when_closed(self, self._stop)
        when_gone(self, self._leave)
        QCoreApplication.instance().aboutToQuit.connect(self._leave)
        self._follow_scan()

    @property
    def running(self) -> bool:
        """Whether weights are being tried."""
        return self._job is not None

    def start(self) -> None:
        """Sweep with what is asked for in the fields; a sweep under way ends."""
        self.cancel()
        try:
            self.sweep, job = begin(self.bench.session, self._request())
        except ValidationError as error:
            self._say(plain(error))
            return
        self._job, self._seconds = job, -monotonic()
        self._look_away()
        self._begun[:] = [*(old for old in self._begun if not old.done), job]
        self._timer.start()
        self._show()

    def cancel(self) -> None:
        """End the sweep; the points that it has stay."""
        if self._job is not None:
            self._job.cancel()
            self._end(f"cancelled after {self.sweep.progress}")

    def look_at(self, index: int) -> None:
        """Show the image of a point in the viewer."""
        self.shown = self.sweep.tried[index]
        name = f"weight {short(self.shown.point.weight)}"
        layer = self.bench.layers.show(self.shown.image, LAYER, name, visible=True)
        layer.name, layer.visible = name, True
        self.bench.layers.select(LAYER)
        self._show()

    def step(self, by: int) -> None:
        """Look at the point of the next weight, up or down."""
        at = self._index() + by if self.shown else 0
        if 0 <= at < len(self.sweep.tried):
            self.look_at(at)

    def take_weight(self) -> None:
        """Write the weight of the point that is looked at into the pipeline."""
        if self.shown is not None:
            self._edit(lambda: self.sweep.take_weight(self._index()))

    def take_rule(self, rule: str) -> None:
        """Let the pipeline choose its weight by a rule."""
        self._edit(lambda: self.sweep.take_rule(rule))

    def save_csv(self, path: Path) -> None:
        """Write the curve as a table, or say why it cannot be."""
        self._try(lambda: write_file(path, csv_of(self.sweep).encode(), overwrite=True))

    def save_png(self, path: Path) -> None:
        """Write the curve as a picture, or say why it cannot be."""
        self._try(lambda: self.view.save(path, heading_of(self.sweep), " · ".join(self.sweep.notes)))

    def keyPressEvent(self, event: Any) -> None:
        """Go to a neighbour by the arrow keys."""
        by = STEPS.get(event.key())
        if by is None:
            super().keyPressEvent(event)
        else:
            self.step(by)

    def _stop(self) -> None:
        """End the sweep, for the window closes."""
        self.cancel()
        _end_all(self._begun)

    def _request(self) -> Request:
        looked_at = self.wavelength.currentIndex() == 1 and self.wavelength.isVisibleTo(self)
        return Request(
            _weight(self.low.text()),
            _weight(self.high.text()),
            self.number.value(),
            self.bench.viewing.wavelength_nm if looked_at else None,
            self.hold_out.isChecked(),
        )

    def _look(self) -> None:
        """See what the job has yielded, and whether it has ended."""
        job = self._job
        if job is None:
            self._timer.stop()
            return
        done = job.done  # asked first: what is yielded between the two questions is not lost
        items = job.drain()
        for item in items:
            self.sweep.take(item)
        if done:
            self._end("" if job.failure else f"{len(self.sweep.tried)} weights in {self._seconds + monotonic():.1f} s")
            self._say(job.failure.sentence if job.failure else "")
        elif items:
            self._show()

    def _end(self, words: str) -> None:
        self._job = None
        self._timer.stop()
        self._show()
        self.progress.setText(words)

    def _index(self) -> int:
        return next(i for i, tried in enumerate(self.sweep.tried) if tried is self.shown)

    def _follow_scan(self) -> None:
        """Take away what is of another scan or frame."""
        scan = self.bench.session.scan
        self.wavelength.setVisible(scan is not None and len(scan.wavelengths_nm) > 1)
        if self.sweep.stale():
            self._look_away()
        self._follow_pipeline()

    def _look_away(self) -> None:
        """Take the image of a point away, which would be taken for one of what is open now."""
        self.shown = None
        self.bench.layers.remove(LAYER)

    def _follow_pipeline(self) -> None:
        if self.running and self.sweep.stale():
            self.cancel()
        self._show()

    def _edit(self, change: Any) -> None:
        if self._try(change):
            self.bench.pipeline_changed.emit()

    def _try(self, action: Any) -> bool:
        try:
            action()
        except (OatkitError, OSError) as error:
            self._say(plain(error))
            return False
        self._say("")
        return True

    def _say(self, sentence: str) -> None:
        self.message.say(sentence or self.sweep.stale())

    def _show(self) -> None:
        """Show the sweep as far as it has come."""
        if self.running:
            self.progress.setText(self.sweep.progress)
        shown, stale = self.shown, self.sweep.stale()
        plot = plot_of(self.sweep, shown.point.weight if shown else None)
        drawn = self.view.plots[0] if self.view.plots else None
        if not self.sweep.tried:
            self.view.show_plots([])
        elif drawn is None or (drawn.title, drawn.marks) != (plot.title, plot.marks) or _length(drawn) != _length(plot):
            self.view.show_plots([plot])
        self.caption.setText(words_of(self.sweep, shown) if shown else HINT if self.sweep.tried else BEFORE)
        self.now.setText(now_of(self.bench.session.pipeline))
        self.notes.setText("\n".join(self.sweep.notes))
        self.notes.setVisible(bool(self.sweep.notes))
        self._enable(bool(stale))
        self._say("")

    def _enable(self, stale: bool) -> None:
        self.run.setEnabled(not self.running)
        self.stop.setEnabled(self.running)
        at, last = (self._index() if self.shown else -1), len(self.sweep.tried) - 1
        self.previous.setEnabled(at > 0)
        self.next.setEnabled(at < last)
        self.take.setEnabled(self.shown is not None and not stale)
        for one in (self.csv, self.png):
            one.setEnabled(last >= 0)

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 6)
        column.setSpacing(4)
        self.low, self.high = _line(LOWEST, "the least weight to try"), _line(HIGHEST, "the largest weight to try")
        self.number = QSpinBox()
        self.number.setRange(FEWEST, MOST)
        self.number.setValue(NUMBER)
        self.number.setToolTip("how many weights, evenly on a logarithmic scale")
        self.wavelength = QComboBox()
        self.wavelength.addItems(["strongest", "looked at"])
        self.wavelength.setToolTip("wavelength to sweep: the one of the largest signals, as the rules do, or the one "
                                   "that is looked at")  # fmt: skip
        self.hold_out = QCheckBox("Hold-out too")
        self.hold_out.setToolTip("try all weights once more without every seventh detector: " + RULES["hold-out"])
        self.run = button("Sweep", "make an image with each weight, beside the window", self.start)
        self.stop = button("Cancel", "end the sweep; the points that it has stay", self.cancel)
        self.progress, self.caption, self.now, self.notes = QLabel(), _text(), _text(), _text()
        self.message = Message()
        self.previous = self._arrow("◀", "the next smaller weight", -1)
        self.next = self._arrow("▶", "the next larger weight", 1)
        self.take = button("Take this weight", "write it into the pipeline; undo takes it back", self.take_weight)
        self.rule = QPushButton("Take rule")
        self.rule.setToolTip("let the pipeline choose by itself, on the strongest wavelength of the scan's first frame")
        self.rule.setMenu(self._rules())
        self.csv = button("CSV", "save the curve as a table", self._ask_csv)
        self.png = button("PNG", "save the curve as a picture", self._ask_png)
        _row(column, QLabel("Weights"), self.low, QLabel("to"), self.high, self.number)
        _row(column, self.wavelength, self.hold_out)
        _row(column, self.run, self.stop, self.progress)
        column.addWidget(self.message)
        column.addWidget(self.view, 1)
        _row(column, self.previous, self.caption, self.next)
        column.addWidget(self.notes)
        _row(column, self.take, self.rule)
        _row(column, self.now, self.csv, self.png)

    def _rules(self) -> QMenu:
        menu = QMenu(self)
        for rule, text in RULES.items():
            menu.addAction(f"{rule}: {text}", lambda rule=rule: self.take_rule(rule))
        return menu

    def _arrow(self, text: str, tip: str, by: int) -> QToolButton:
        button = QToolButton()
        button.setText(text)
        button.setToolTip(tip)
        button.clicked.connect(lambda: self.step(by))
        return button

    def _ask_csv(self) -> None:
        path, _ = QFileDialog.getSaveFileName(self, "Save the curve", "weights.csv", "CSV (*.csv)")
        if path:
            self.save_csv(Path(path))

    def _ask_png(self) -> None:
        path, _ = QFileDialog.getSaveFileName(self, "Save the curve", "weights.png", "PNG (*.png)")
        if path:
            self.save_png(Path(path))


def _end_all(jobs: list[Job]) -> None:
    for job in jobs:
        job.cancel()
    for job in jobs:
        job.wait(2)


def _weight(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValidationError(f"weights: expected a number above 0, got '{text}'") from None


def _length(plot: Any) -> int:
    return len(plot.curves[0].x)


def _line(value: float, tip: str) -> QLineEdit:
    line = QLineEdit(f"{value:g}")
    line.setToolTip(f"{tip}, dimensionless")
    line.setMinimumWidth(48)
    return line


def _text() -> QLabel:
    label = QLabel()
    label.setWordWrap(True)
    return label


def _row(column: QVBoxLayout, *widgets: QWidget) -> None:
    row = QHBoxLayout()
    row.setSpacing(4)
    for widget in widgets:
        row.addWidget(widget, 1 if isinstance(widget, QLabel) and widget.wordWrap() else 0)
    column.addLayout(row)
