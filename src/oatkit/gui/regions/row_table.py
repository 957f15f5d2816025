"""The table of regions on the screen."""

from typing import Any

from qtpy.QtCore import QAbstractTableModel, QModelIndex, Qt
from qtpy.QtWidgets import QHeaderView, QTableView

from oatkit.regions import RegionRow
from oatkit.regions.text import COLUMNS

HIGH, ROW = 110, 22
"""Least height of the table, height of a row, dots."""
HEADINGS = (
    "region", "image", "nm", "mean", "std", "median", "min", "max", "negative", "pixels", "mm²", "CNR", "undefined",
)  # fmt: skip
SHOWN_COLUMNS = tuple(next(column for column in COLUMNS if column.heading == heading) for heading in HEADINGS)
"""As `oatkit roi` prints them, in another order."""


class RowTable(QTableView):
    """Shows rows of `oatkit.regions.region_table`, each number as `oatkit roi` prints it."""

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self.rows = _Rows()
        self.setModel(self.rows)
        self.setMinimumHeight(HIGH)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(ROW)
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)

    def show_rows(self, rows: list[RegionRow], wavelengths: bool) -> None:
        """Show other rows, with a column of wavelengths or without."""
        self.rows.show_rows(rows)
        self.setColumnHidden(HEADINGS.index("nm"), not wavelengths)


class _Rows(QAbstractTableModel):
    """The rows as text."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[RegionRow] = []

    def show_rows(self, rows: list[RegionRow]) -> None:
        if rows != self.rows:
            self.beginResetModel()
            self.rows = rows
            self.endResetModel()

    def rowCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008 - as Qt declares it
        return len(self.rows)

    def columnCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008 - as Qt declares it
        return len(SHOWN_COLUMNS)

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        column, row = SHOWN_COLUMNS[index.column()], self.rows[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return column.text(row)
        if role == Qt.ItemDataRole.ToolTipRole:
            return row.note or None
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return right if role == Qt.ItemDataRole.TextAlignmentRole and column.side == ">" else None

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        shown = role == Qt.ItemDataRole.DisplayRole and orientation == Qt.Orientation.Horizontal
        return SHOWN_COLUMNS[section].heading if shown else None
