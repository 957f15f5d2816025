"""The wavelength in nm, chosen and shown, and whether contrast follows it."""

from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QCheckBox, QComboBox, QHBoxLayout, QLabel, QToolButton, QVBoxLayout, QWidget

from oatkit.gui.leaving import link
from oatkit.gui.workbench import workbench


class WavelengthWidget(QWidget):
    """Linked both ways with the slider of the viewer, which counts wavelengths by their number."""

    def __init__(self, napari_viewer: Any) -> None:
        super().__init__()
        self.viewing = workbench(napari_viewer).viewing
        self.choice = QComboBox()
        self.choice.setToolTip("Wavelength that is shown, nm")
        self.held = QCheckBox("Same contrast at all wavelengths")
        self.held.setToolTip("Off: each wavelength is as bright as it can be, and cannot be compared with the others.")
        self.held.setChecked(self.viewing.contrast_held)
        self.previous, self.next = self._step("◀", -1), self._step("▶", 1)
        self._lay_out()
        self.choice.activated.connect(self._choose)
        self.held.toggled.connect(self._hold)
        link(self, self.viewing.changed, self._follow)
        self._follow()

    def _lay_out(self) -> None:
        row = QHBoxLayout()
        row.addWidget(QLabel("Wavelength"))
        row.addWidget(self.previous)
        row.addWidget(self.choice, stretch=1)
        row.addWidget(self.next)
        layout = QVBoxLayout(self)
        layout.addLayout(row)
        layout.addWidget(self.held)
        layout.setAlignment(Qt.AlignmentFlag.AlignTop)

    def _step(self, text: str, by: int) -> QToolButton:
        button = QToolButton()
        button.setText(text)
        button.setToolTip("Next wavelength" if by > 0 else "Previous wavelength")
        button.clicked.connect(lambda: self._choose(self.choice.currentIndex() + by))
        return button

    def _choose(self, index: int) -> None:
        wavelengths = self.viewing.wavelengths_nm
        if 0 <= index < len(wavelengths):
            self.viewing.go_to(wavelengths[index])

    def _hold(self, held: bool) -> None:
        self.viewing.contrast_held = held

    def _follow(self) -> None:
        """Show what is looked at."""
        texts = [f"{wavelength:g} nm" for wavelength in self.viewing.wavelengths_nm]
        if texts != [self.choice.itemText(i) for i in range(self.choice.count())]:
            self.choice.clear()
            self.choice.addItems(texts)
        index = self.viewing.layers.plane if texts else -1
        self.choice.setCurrentIndex(index if index < len(texts) else -1)
        for part in (self.choice, self.previous, self.next):
            part.setEnabled(bool(texts))
        self.previous.setEnabled(index > 0)
        self.next.setEnabled(0 <= index < len(texts) - 1)
