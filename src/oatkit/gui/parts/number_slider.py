"""A slider for a number, with its value beside it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import log10
from typing import Any

from qtpy.QtCore import QObject, QSignalBlocker, Qt, QTimer, Signal
from qtpy.QtWidgets import QGridLayout, QLabel, QSlider

REST_MS = 500
"""From the last turn of the wheel or press of a key until the move counts as over."""


@dataclass(frozen=True)
class Scale:
    """Which number each step of a slider stands for."""

    low: float
    high: float
    steps: int
    logarithmic: bool = False

    def number(self, step: int) -> float:
        """Return the number of a step; on a logarithmic scale with three digits, as one would write it."""
        part = step / self.steps
        if self.logarithmic:
            return float(f"{self.low * (self.high / self.low) ** part:.2e}")
        return self.low + part * (self.high - self.low)

    def step(self, number: float) -> int:
        """Return the step nearest to a number."""
        inside = min(max(number, self.low), self.high)
        if self.logarithmic:
            return round(self.steps * log10(inside / self.low) / log10(self.high / self.low))
        return round(self.steps * (inside - self.low) / (self.high - self.low))


class NumberSlider(QObject):
    """A row of a grid: a label, a slider, the number."""

    moved = Signal()
    """The hand moves it: `number` is another."""
    released = Signal()
    """The move is over."""

    def __init__(
        self, grid: QGridLayout, title: str, tip: str, scale: Scale, text: Callable[[float], str], parent: Any = None
    ) -> None:
        super().__init__(parent)
        self._scale, self._text = scale, text
        self.number = scale.low
        self.moving = False
        """Whether the hand has moved it, and the move is not over."""
        self.label, self.slider, self.value = QLabel(title), _Slider(Qt.Orientation.Horizontal), QLabel()
        self.value.setMinimumWidth(72)
        self._parts = (self.label, self.slider, self.value)
        row = grid.rowCount()
        for column, part in enumerate(self._parts):
            part.setToolTip(tip)
            grid.addWidget(part, row, column)
        self.slider.setRange(0, scale.steps)
        self._rest = QTimer(self, singleShot=True, interval=REST_MS)
        self._rest.timeout.connect(self.finish)
        self.slider.valueChanged.connect(self._move)
        self.slider.sliderReleased.connect(self.finish)

    def show_number(self, number: float, scale: Scale | None = None) -> None:
        """Show a number that comes from elsewhere, perhaps on another scale; a move of the hand goes on."""
        if self.moving:
            return
        self._scale, self.number = scale or self._scale, number
        with QSignalBlocker(self.slider):
            self.slider.setRange(0, self._scale.steps)
            self.slider.setValue(self._scale.step(number))
        self.value.setText(self._text(number))

    def set_visible(self, visible: bool) -> None:
        """Show or hide the row."""
        for part in self._parts:
            part.setVisible(visible)

    def finish(self) -> None:
        """End a move of the hand, if there is one."""
        self._rest.stop()
        if self.moving:
            self.moving = False
            self.released.emit()

    def _move(self, step: int) -> None:
        self.moving, self.number = True, self._scale.number(step)
        self.value.setText(self._text(self.number))
        self.moved.emit()
        if not self.slider.isSliderDown():
            self._rest.start()


class _Slider(QSlider):
    """A slider that leaves the wheel alone until it is clicked."""

    def wheelEvent(self, event: Any) -> None:
        """Move by the wheel, or let the window scroll."""
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()
