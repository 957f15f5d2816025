"""Keeps results, shows them side by side, and subtracts them."""

from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
)

from oatkit.gui.parts.buttons import button
from oatkit.gui.parts.forms import Message
from oatkit.gui.view.comparison import CURRENT, Comparison, called

LIST_HEIGHT = 96
"""Of the list of results, dots: four of them."""
GROUP = Qt.ItemDataRole.UserRole


class ComparisonPanel(QGroupBox):
    """The part of the view that compares results."""

    def __init__(self, comparison: Comparison, parent: Any = None) -> None:
        super().__init__("Compare results", parent)
        self.comparison = comparison
        self.name = QLineEdit()
        self.name.setToolTip("name under which the newest result is kept")
        self.keep = button("Keep", "keep the newest result, to compare others with it", self._keep)
        self.list = QListWidget()
        self.list.setMaximumHeight(LIST_HEIGHT)
        self.list.setToolTip("ticked results are seen; a double click renames a kept one")
        self.list.itemChanged.connect(self._change)
        self.list.currentItemChanged.connect(lambda *_: self._enable())
        self.remove = button("Remove", "remove the kept result that is selected", self._remove)
        self.image, self.first, self.second = QComboBox(), QComboBox(), QComboBox()
        self.image.setToolTip("image that is compared")
        self.image.activated.connect(self._take_image)
        self.beside = QPushButton("Side by side")
        self.beside.setCheckable(True)
        self.beside.setToolTip("this image of all results, each in a tile; press again to go back")
        self.beside.clicked.connect(self._toggle)
        self.linked = QCheckBox("One contrast for all tiles")
        self.linked.setToolTip("Off: each tile is as bright as it can be, and cannot be compared with the others.")
        self.linked.toggled.connect(self._link)
        self.subtract = button("Show difference", "the first less the second, in one more layer", self._subtract)
        self.numbers = QLabel()
        self.numbers.setWordWrap(True)
        self.numbers.setToolTip("of the difference, against the second, over the pixels where both have a value")
        self.message = Message()
        self._lay_out()
        self.show_state()

    def _lay_out(self) -> None:
        column = QVBoxLayout(self)
        column.setSpacing(4)
        column.addLayout(_row(QLabel("Newest as"), self.name, self.keep, stretch=1))
        column.addWidget(self.list)
        column.addLayout(_row(QLabel("Image"), self.image, self.remove, stretch=1))
        column.addLayout(_row(self.beside, self.linked, stretch=1))
        column.addLayout(_row(self.first, QLabel("−"), self.second, stretch=0))
        column.addWidget(self.subtract)
        column.addWidget(self.numbers)
        column.addWidget(self.message)

    def show_state(self) -> None:
        """Show the results that are at hand, and what is made of them."""
        comparison = self.comparison
        groups = comparison.groups
        self._list(groups)
        _fill(self.image, {name: name.replace("_", " ") for name in comparison.images})
        for box in (self.first, self.second):
            _fill(box, {group: called(group) for group in groups})
        if self.first.currentIndex() == self.second.currentIndex():
            self.second.setCurrentIndex(next((i for i in range(len(groups)) if i != self.first.currentIndex()), -1))
        if not self.name.isModified():
            self.name.setText(comparison.suggested_name())
        for box, on in ((self.beside, comparison.is_beside), (self.linked, comparison.side_by_side.linked)):
            box.blockSignals(True)
            box.setChecked(on)
            box.blockSignals(False)
        numbers = comparison.numbers()
        self.numbers.setText(numbers)
        self.numbers.setVisible(bool(numbers))
        self._enable()

    def _list(self, groups: list[str]) -> None:
        """List the results, each with whether it is seen; a name that is being typed is left alone."""
        if self.list.state() == QListWidget.State.EditingState:
            return
        self.list.blockSignals(True)
        if [self.list.item(i).data(GROUP) for i in range(self.list.count())] != groups:
            selected = self._selected()
            self.list.clear()
            for group in groups:
                item = QListWidgetItem(called(group))
                item.setData(GROUP, group)
                if group != CURRENT:
                    item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
                self.list.addItem(item)
                if group == selected:
                    self.list.setCurrentItem(item)
        for row, group in enumerate(groups):
            shown = Qt.CheckState.Checked if self.comparison.is_shown(group) else Qt.CheckState.Unchecked
            self.list.item(row).setText(called(group))
            self.list.item(row).setCheckState(shown)
        self.list.blockSignals(False)

    def _selected(self) -> str | None:
        item = self.list.currentItem()
        return item.data(GROUP) if item is not None else None

    def _enable(self) -> None:
        groups = self.comparison.groups
        self.keep.setEnabled(CURRENT in groups)
        self.remove.setEnabled(bool(self._selected()))
        for part in (self.image, self.beside):
            part.setEnabled(bool(groups))
        for part in (self.first, self.second, self.subtract):
            part.setEnabled(len(groups) > 1)

    def _keep(self) -> None:
        if self.message.attempt(lambda: self.comparison.keep(self.name.text().strip())):
            self.name.setModified(False)
            if self.comparison.is_beside:
                self._compare()
            self.show_state()

    def _remove(self) -> None:
        group = self._selected()
        if group:
            self.comparison.remove(group)
            self.show_state()

    def _change(self, item: QListWidgetItem) -> None:
        """Take a tick, or a name that was typed."""
        group = item.data(GROUP)
        if item.text() != called(group):
            self.message.attempt(lambda: self.comparison.rename(group, item.text().strip()))
        else:
            self.comparison.show(group, item.checkState() == Qt.CheckState.Checked)
        self.show_state()

    def _toggle(self, on: bool) -> None:
        if on:
            self._compare()
        else:
            self.comparison.side_by_side.leave()
        self.show_state()

    def _take_image(self) -> None:
        if self.comparison.is_beside:
            self._compare()

    def _compare(self) -> None:
        self.message.attempt(lambda: self.comparison.compare(self.image.currentData()))

    def _link(self, linked: bool) -> None:
        self.comparison.side_by_side.linked = linked

    def _subtract(self) -> None:
        first, second, name = (box.currentData() for box in (self.first, self.second, self.image))
        self.message.attempt(lambda: self.comparison.subtract(first, second, name))
        self.show_state()


def _fill(box: QComboBox, entries: dict[str, str]) -> None:
    """Offer entries, keeping the choice where it is still there."""
    if [box.itemData(i) for i in range(box.count())] == list(entries):
        return
    chosen = box.currentData()
    box.clear()
    for data, text in entries.items():
        box.addItem(text, data)
    box.setCurrentIndex(max(box.findData(chosen), 0) if entries else -1)


def _row(*parts: Any, stretch: int) -> QHBoxLayout:
    """Return widgets in a row; combo boxes and the one at `stretch` take the room that is left."""
    row = QHBoxLayout()
    row.setSpacing(4)
    for index, part in enumerate(parts):
        row.addWidget(part, 1 if index == stretch or isinstance(part, QComboBox) else 0)
    return row
