"""What is looked at, and how: wavelength, comparison of results, maps of unmixing."""

from functools import partial
from typing import Any

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QVBoxLayout, QWidget

from oatkit.gui.leaving import when_gone
from oatkit.gui.parts.scrolling import scrolled
from oatkit.gui.view.comparison import Comparison
from oatkit.gui.view.comparison_panel import ComparisonPanel
from oatkit.gui.view.unmixing import Unmixing
from oatkit.gui.view.unmixing_panel import UnmixingPanel
from oatkit.gui.view.wavelength import WavelengthWidget
from oatkit.gui.workbench import workbench


class ViewWidget(QWidget):
    """One dock for all that changes what is seen, and nothing that is computed."""

    def __init__(self, napari_viewer: Any) -> None:
        super().__init__()
        bench = workbench(napari_viewer)
        comparison, unmixing = Comparison(bench), Unmixing(bench)
        self.wavelength = WavelengthWidget(napari_viewer)
        self.comparison, self.unmixing = ComparisonPanel(comparison), UnmixingPanel(unmixing)
        self._lay_out()
        # Layers come, go and change many at a time: the panels look once, when all is done.
        timer = QTimer(self)
        timer.setSingleShot(True)
        timer.timeout.connect(self.show_state)

        def later() -> None:
            timer.start(0)

        signals = (bench.viewing.changed, bench.side_by_side.changed)
        for signal in signals:
            signal.connect(later)
            when_gone(self, partial(signal.disconnect, later, missing_ok=True))
        for part in (comparison, unmixing):
            when_gone(self, part.close)

    def _lay_out(self) -> None:
        inside = QWidget()
        column = QVBoxLayout(inside)
        column.setContentsMargins(6, 6, 6, 6)
        column.setSpacing(6)
        for part in (self.wavelength, self.comparison, self.unmixing):
            column.addWidget(part)
        column.addStretch(1)
        outside = QVBoxLayout(self)
        outside.setContentsMargins(0, 0, 0, 0)
        outside.addWidget(scrolled(inside))
        self.setMinimumWidth(316)

    def show_state(self) -> None:
        """Show what there is to compare and to look at."""
        self.comparison.show_state()
        self.unmixing.show_state()
