"""The regions by name: rename, recolour, remove."""

from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtGui import QColor, QIcon, QPixmap
from qtpy.QtWidgets import QAbstractItemView, QHeaderView, QMenu, QTableWidget, QTableWidgetItem, QToolButton

from oatkit.drawing.plot import ON_DARK
from oatkit.errors import ValidationError
from oatkit.gui.parts.forms import Message
from oatkit.gui.regions.drawn import DrawnRegions

COLOUR, NAME, REMOVE = range(3)
"""Columns."""
SWATCH, NARROW, ROW, LOW = 12, 28, 24, 74
"""Sizes, dots."""


class RegionList(QTableWidget):
    """One row for each region, in the order in which they were drawn; what is refused is said in `message`."""

    def __init__(self, regions: DrawnRegions, message: Message, parent: Any = None) -> None:
        super().__init__(0, 3, parent)
        self._regions, self._message = regions, message
        self._shown: list[tuple[str, str]] = []
        self.setMinimumHeight(LOW)
        self.setToolTip("double-click a name to change it")
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(ROW)
        self.horizontalHeader().hide()
        header = self.horizontalHeader()
        header.setMinimumSectionSize(NARROW)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        for column in (COLOUR, REMOVE):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            self.setColumnWidth(column, NARROW)
        self.itemChanged.connect(self._rename)

    def show_regions(self) -> None:
        """Show the names and colours as they are; nothing happens where they are the same."""
        shown = list(zip(self._regions.names, self._regions.colours, strict=True))
        if shown == self._shown:
            return
        self._shown = shown
        self.blockSignals(True)
        self.setRowCount(len(shown))
        for row, (name, colour) in enumerate(shown):
            self.setItem(row, NAME, QTableWidgetItem(name))
            self._put(row, COLOUR, self._swatch(row, colour))
            self._put(row, REMOVE, self._remover(row))
        self.blockSignals(False)

    def _put(self, row: int, column: int, button: QToolButton) -> None:
        old = self.cellWidget(row, column)
        if old is not None:
            old.hide()  # it is there until the event loop comes to delete it
        self.setCellWidget(row, column, button)

    def _rename(self, item: QTableWidgetItem) -> None:
        try:
            self._regions.rename(item.row(), item.text())
        except ValidationError as error:
            self._message.say(str(error))
            self._shown = []
            self.show_regions()
        else:
            self._message.say("")

    def _swatch(self, row: int, colour: str) -> QToolButton:
        button = QToolButton()
        button.setIcon(_icon(colour))
        button.setToolTip("choose another colour")
        button.setAutoRaise(True)
        menu = QMenu(button)
        for number, other in enumerate(ON_DARK, 1):
            menu.addAction(_icon(other), f"colour {number}", lambda other=other: self._regions.recolour(row, other))
        button.setMenu(menu)
        button.setStyleSheet("QToolButton::menu-indicator { image: none; }")
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        return button

    def _remover(self, row: int) -> QToolButton:
        button = QToolButton()
        button.setText("✕")
        button.setAutoRaise(True)
        button.setToolTip("remove this region")
        button.clicked.connect(lambda: self._regions.remove(row), Qt.ConnectionType.QueuedConnection)
        return button


def _icon(colour: str) -> QIcon:
    picture = QPixmap(SWATCH, SWATCH)
    picture.fill(QColor(colour))
    return QIcon(picture)
