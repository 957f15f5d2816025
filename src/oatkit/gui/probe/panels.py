"""The parts of the probe widget: what to probe with, what to fit, and what was found beside the plots."""

from collections.abc import Sequence
from typing import Any

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QDoubleSpinBox,
    QGridLayout,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QMenu,
    QSizePolicy,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from oatkit.gui.parts.buttons import button
from oatkit.gui.probe.chromophore_fit import short
from oatkit.gui.probe.probe import Value
from oatkit.spectra import CHROMOPHORES

POINT, REGION, LINE = "Point", "Region", "Line"
MODES = {
    POINT: "mean over a small disc: click on the image, or drag over it",
    REGION: "mean over a region that you draw",
    LINE: "values along a line that you draw",
}
SHAPES = {
    REGION: {"Rectangle": "add_rectangle", "Ellipse": "add_ellipse", "Polygon": "add_polygon", "Move": "select"},
    LINE: {"Draw": "add_line", "Move": "select"},
}
"""Names of tools in each mode, and what the layer of shapes calls them."""
HINTS = {
    "": "Choose what to probe the images with.",
    POINT: "Click on the image, or drag over it.",
    "add_polygon": "Click the corners on the image; a double click ends.",
    "add_line": "Draw a line on the image.",
    "select": "Drag what you have drawn, or its handles.",
}
DRAW = "Draw on the image."
RADIUS_MM = 0.5
COLUMNS = 3
"""Of the boxes for chromophores."""


class Tools(QWidget):
    """What to probe with, and what to do with what was found."""

    tool_taken = Signal(str)
    """A tool of the layer of shapes, ``"pan_zoom"`` to let go of it."""
    radius_changed = Signal()
    unpin_wanted = Signal(list)
    """Names of pinned places."""

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self.mode = ""
        """`POINT`, `REGION`, `LINE`, or empty where the probe is off."""
        self.modes = {mode: button(mode, tip, checkable=True) for mode, tip in MODES.items()}
        self.radius = QDoubleSpinBox()
        self.radius.setRange(0.05, 20)
        self.radius.setSingleStep(0.1)
        self.radius.setValue(RADIUS_MM)
        self.radius.setSuffix(" mm")
        self.radius.setToolTip("radius of the disc about a point")
        self.tools = {
            mode: {name: button(name, f"{name.lower()} on the image", checkable=True) for name in names}
            for mode, names in SHAPES.items()
        }
        self.hint = QLabel(HINTS[""])
        self.hint.setWordWrap(True)
        self.pin = button("Pin", "keep this place, to compare others with it")
        self.unpin = button("Unpin", "let go of pinned places")
        self.unpin.setMenu(QMenu(self.unpin))
        self.csv = button("CSV", "save the numbers of all that is shown as a table")
        self.png = button("PNG", "save the plots as a picture")
        self._arrange()
        self._connect()
        self.show_pins([], False)
        self.enable_saving(False, False)
        self._show_mode()

    @property
    def radius_mm(self) -> float:
        """Radius of the disc about a point."""
        return float(self.radius.value())

    def take_mode(self, mode: str) -> None:
        """Probe with another thing; the mode that is on is switched off."""
        self.mode = "" if mode == self.mode else mode
        self._show_mode()
        first = next(iter(SHAPES[self.mode])) if self.mode in SHAPES else ""
        self.take_tool(first)

    def take_tool(self, name: str) -> None:
        """Draw with another tool of the mode; none lets go of the layer of shapes."""
        for title, one in self.tools.get(self.mode, {}).items():
            one.setChecked(title == name)
        tool = SHAPES[self.mode][name] if name else "pan_zoom"
        self.hint.setText(HINTS.get(tool if name else self.mode, DRAW))
        self.tool_taken.emit(tool)

    def show_pins(self, names: Sequence[str], live: bool) -> None:
        """Show which places are pinned, and whether one could be."""
        self.pin.setEnabled(live)
        self.unpin.setEnabled(bool(names))
        menu = self.unpin.menu()
        if [action.data() for action in menu.actions()][:-1] == list(names):
            return
        menu.clear()
        for name in names:
            menu.addAction(name, lambda name=name: self.unpin_wanted.emit([name])).setData(name)
        menu.addAction("all", lambda: self.unpin_wanted.emit(list(names)))

    def enable_saving(self, numbers: bool, plots: bool) -> None:
        """Say whether there is anything to save."""
        self.csv.setEnabled(numbers)
        self.png.setEnabled(plots)

    def _show_mode(self) -> None:
        for mode, one in self.modes.items():
            one.setChecked(mode == self.mode)
        self._radius_row.setVisible(self.mode == POINT)
        for mode, row in self._tool_rows.items():
            row.setVisible(mode == self.mode)
        for one in (self.pin, self.unpin):
            one.setVisible(self.mode != LINE)

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        self._radius_row = _row([QLabel("Radius"), self.radius])
        self._tool_rows = {mode: _row(list(buttons.values())) for mode, buttons in self.tools.items()}
        rows = [_row(list(self.modes.values())), self._radius_row, *self._tool_rows.values(), self.hint]
        for row in (*rows, _row([self.pin, self.unpin, self.csv, self.png])):
            column.addWidget(row)

    def _connect(self) -> None:
        for mode, one in self.modes.items():
            one.clicked.connect(lambda _=False, mode=mode: self.take_mode(mode))
        for buttons in self.tools.values():
            for name, one in buttons.items():
                one.clicked.connect(lambda _=False, name=name: self.take_tool(name))
        self.radius.valueChanged.connect(lambda _: self.radius_changed.emit())


class ChromophoreBoxes(QWidget):
    """Which chromophores are fitted to spectra."""

    changed = Signal()

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setVerticalSpacing(2)
        label = QLabel("Fit")
        label.setToolTip("Mixture of these, none of them negative, that is nearest to the mean spectrum; drawn dashed.")
        grid.addWidget(label, 0, 0)
        self.boxes: dict[str, QCheckBox] = {}
        for i, (name, one) in enumerate(CHROMOPHORES.items()):
            box = self.boxes[name] = QCheckBox(short(name))
            box.setToolTip(f"{name}: {one.source}")
            box.toggled.connect(lambda _: self.changed.emit())
            grid.addWidget(box, i // COLUMNS, 1 + i % COLUMNS)
        grid.setColumnStretch(COLUMNS, 1)

    def chosen(self) -> list[str]:
        """Return the names of those that are ticked."""
        return [name for name, box in self.boxes.items() if box.isChecked()]


class Findings(QWidget):
    """What was fitted, in words, and the values of images that have no spectrum."""

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self.fits = QLabel()
        self.fits.setWordWrap(True)
        self.fits.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.table = QTableWidget(0, 3)
        self.table.setHorizontalHeaderLabels(["image", "place", "mean ± std"])
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.table.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.table)
        column.addWidget(self.fits)
        column.addStretch(1)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self.show_found([], [])

    def show_found(self, lines: Sequence[str], values: Sequence[Value]) -> None:
        """Show lines of text, and values in a table."""
        text = "\n".join(lines)
        if text != self.fits.text():
            self.fits.setText(text)
        self.fits.setVisible(bool(lines))
        self.table.setVisible(bool(values))
        if self.table.rowCount() != len(values):
            self.table.setRowCount(len(values))
            height = self.table.verticalHeader().defaultSectionSize() * len(values)
            self.table.setFixedHeight(height + self.table.horizontalHeader().sizeHint().height() + 4)
        for row, value in enumerate(values):
            for column, words in enumerate((value.image, value.place, value.text)):
                self._set(row, column, words)

    def _set(self, row: int, column: int, text: str) -> None:
        item = self.table.item(row, column)
        if item is None:
            item = QTableWidgetItem()
            self.table.setItem(row, column, item)
        if item.text() != text:
            item.setText(text)
            item.setToolTip(text)


def _row(parts: Sequence[QWidget]) -> QWidget:
    row = QWidget()
    line = QHBoxLayout(row)
    line.setContentsMargins(0, 0, 0, 0)
    line.setSpacing(4)
    for part in parts:
        line.addWidget(part, 1)
    return row
