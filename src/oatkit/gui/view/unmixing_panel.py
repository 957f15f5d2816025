"""Buttons for the maps that unmixing has made, and how they lie over the anatomy."""

from functools import partial
from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QCheckBox,
    QComboBox,
    QGridLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSlider,
    QSpinBox,
    QVBoxLayout,
)

from oatkit.data import Image
from oatkit.gui.images.layers import KEY
from oatkit.gui.view.comparison import called
from oatkit.gui.view.unmixing import Unmixing, short

COLUMNS = 2
PERCENT = 20
"""Of the most haemoglobin, above which a pixel counts as blood at first."""
FULL = 100
"""Of the slider of opacity."""


class UnmixingPanel(QGroupBox):
    """The part of the view that shows what was unmixed."""

    def __init__(self, unmixing: Unmixing, parent: Any = None) -> None:
        super().__init__("Unmixing", parent)
        self.unmixing = unmixing
        self.buttons: dict[str, QPushButton] = {}
        self.result = QComboBox()
        self.result.setToolTip("result whose maps are shown")
        self.result.activated.connect(self._take_result)
        self.opacity = QSlider(Qt.Orientation.Horizontal)
        self.opacity.setRange(0, FULL)
        self.opacity.setValue(FULL)
        self.opacity.setToolTip("how far the map covers the anatomy")
        self.opacity.valueChanged.connect(self._take_opacity)
        self.blood = QCheckBox("so2 in blood only: above")
        self.blood.setToolTip(
            "Show saturation only where total haemoglobin exceeds this share of its maximum. "
            "The data stay as they are: it is a matter of display."
        )
        self.percent = QSpinBox()
        self.percent.setRange(0, 100)
        self.percent.setValue(PERCENT)
        self.percent.setSuffix(" %")
        self.percent.setToolTip("of the maximum of total haemoglobin")
        self.blood.toggled.connect(self._take_blood)
        self.percent.valueChanged.connect(self._take_blood)
        self.beside = QPushButton("All side by side")
        self.beside.setCheckable(True)
        self.beside.setToolTip("each map in a tile; press again to go back")
        self.beside.clicked.connect(self._toggle)
        self.trust = QLabel()
        self.trust.setWordWrap(True)
        self.absent = QLabel("No result holds maps: run a pipeline with [unmix] over two wavelengths or more.")
        self.absent.setWordWrap(True)
        self._grid = QGridLayout()
        self._lay_out()
        self.show_state()

    def _lay_out(self) -> None:
        column = QVBoxLayout(self)
        column.setSpacing(4)
        column.addWidget(self.absent)
        column.addWidget(self.result)
        self._grid.setSpacing(4)
        column.addLayout(self._grid)
        self._labelled = QLabel("Opacity")
        for parts in ((self._labelled, self.opacity), (self.blood, self.percent)):
            row = QHBoxLayout()
            for part in parts:
                row.addWidget(part, 1 if part is self.opacity else 0)
            row.addStretch(0)
            column.addLayout(row)
        column.addWidget(self.beside)
        column.addWidget(self.trust)

    def show_state(self) -> None:
        """Show a button for each map of the result, and what is known of the one that is seen."""
        unmixing = self.unmixing
        groups, maps = unmixing.groups, unmixing.maps
        self.absent.setVisible(not maps)
        for part in (self.opacity, self._labelled, self.blood, self.percent, self.beside):
            part.setVisible(bool(maps))
        self.result.setVisible(len(groups) > 1)
        if [self.result.itemData(i) for i in range(self.result.count())] != groups:
            self.result.clear()
            for group in groups:
                self.result.addItem(called(group), group)
        self.result.setCurrentIndex(self.result.findData(unmixing.group))
        if list(self.buttons) != list(maps):
            self._make_buttons({name: layer.metadata[KEY]["image"] for name, layer in maps.items()})
        self.beside.setChecked(unmixing.is_beside)
        shown = "" if unmixing.bench.side_by_side.active else unmixing.shown
        for name, button in self.buttons.items():
            button.setChecked(name == shown)
        words = unmixing.trust if shown else ""
        self.trust.setText(words)
        self.trust.setVisible(bool(words))

    def _make_buttons(self, images: dict[str, Image]) -> None:
        for button in self.buttons.values():
            self._grid.removeWidget(button)
            button.deleteLater()
        self.buttons = {}
        for number, (name, image) in enumerate(images.items()):
            unit = f", {_printed(image.unit)}" if image.unit else ""
            button = self.buttons[name] = QPushButton(f"{short(name)}{unit}")
            button.setCheckable(True)
            button.setToolTip(f"show {name.replace('_', ' ')} over the anatomy; press again for the anatomy alone")
            button.clicked.connect(partial(self._show, name))
            self._grid.addWidget(button, number // COLUMNS, number % COLUMNS)

    def _show(self, name: str, on: bool) -> None:
        self.unmixing.show(name if on else "")
        self.show_state()

    def _take_result(self) -> None:
        self.unmixing.group = self.result.currentData()
        self.show_state()

    def _take_opacity(self, value: int) -> None:
        self.unmixing.opacity = value / FULL

    def _take_blood(self) -> None:
        self.unmixing.blood_percent = float(self.percent.value()) if self.blood.isChecked() else None
        self.show_state()

    def _toggle(self, on: bool) -> None:
        if on:
            self.unmixing.show_side_by_side()
        else:
            self.unmixing.bench.side_by_side.leave()
        self.show_state()


def _printed(unit: str) -> str:
    """Return a unit with its powers raised."""
    return unit.replace("^3", "³").replace("^2", "²")
