"""Plots in a dock: the same that a page has, in the colours of the viewer, to click on and to keep as a picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from qtpy.QtCore import Signal
from qtpy.QtWidgets import QVBoxLayout, QWidget

from oatkit.plot import ON_DARK, PRINT, Plot, Style, draw_curves

NEAR = 14
"""How far from a point a click still means it, dots."""
LOW = 170
"""Least height of a plot with its title and its labels, dots."""
WIDE = 260
DARK = 128
"""Brightness of a background, 0 .. 255, below which lines are light."""


class PlotView(QWidget):
    """Shows `oatkit.plot.Plot`s above one another; drawn only while it is seen, so that a hidden dock costs nothing."""

    picked = Signal(int, int, int)
    """A point was clicked: the number of its plot, of its curve there, and of the point on the curve."""

    def __init__(self, viewer: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self._viewer, self._drawn = viewer, False
        self.plots: tuple[Plot, ...] = ()
        self._canvas: Any = None
        self._axes: list[Any] = []
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self.setMinimumSize(WIDE, LOW)
        theme, follow = viewer.events.theme, self._follow_theme
        theme.connect(follow)
        self.destroyed.connect(lambda *_: theme.disconnect(follow))

    def show_plots(self, plots: Sequence[Plot]) -> None:
        """Show other plots."""
        self.plots, self._drawn = tuple(plots), False
        self.setMinimumHeight(LOW * max(1, len(self.plots)))
        if self.isVisible():
            self._draw()

    def save(self, path: Path, title: str = "", caption: str = "") -> None:
        """Write the plots as a PNG on white. Raises `ResultError` where it cannot be written."""
        from oatkit.atomic import write_file
        from oatkit.page import png
        from oatkit.sheet import sheet

        write_file(path, png(sheet((), self.plots, title, caption)), overwrite=True)

    def showEvent(self, event: Any) -> None:
        """Draw what was shown while nobody could see it."""
        super().showEvent(event)
        if not self._drawn:
            self._draw()

    def _follow_theme(self, event: Any = None) -> None:
        self.show_plots(self.plots)

    def _draw(self) -> None:
        self._drawn = True
        figure, (ink, paper) = self._figure(), _colours(self._viewer)
        style = Style(ink, "#808890", ON_DARK if _brightness(paper) < DARK else PRINT.colours)
        figure.clear()
        figure.set_facecolor(paper)
        self._axes = [figure.add_subplot(len(self.plots), 1, i + 1, facecolor=paper) for i in range(len(self.plots))]
        for axes, plot in zip(self._axes, self.plots, strict=True):
            draw_curves(axes, plot, style)
            axes.set_title(plot.title, size=8.5, color=ink, parse_math=False)
        self._canvas.draw_idle()

    def _figure(self) -> Any:
        if self._canvas is None:
            from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg
            from matplotlib.figure import Figure

            self._canvas = FigureCanvasQTAgg(Figure(layout="constrained"))
            self._canvas.mpl_connect("button_press_event", self._click)
            self._column.addWidget(self._canvas)
        return self._canvas.figure

    def _click(self, event: Any) -> None:
        """Find the point that is nearest to a click, as the eye sees it."""
        if event.inaxes is None:
            return
        number = self._axes.index(event.inaxes)
        near = [
            (distance, curve, point)
            for curve, drawn in enumerate(self.plots[number].curves)
            for point, distance in enumerate(_distances(event, drawn.x, drawn.y))
            if distance <= NEAR
        ]
        if near:
            _, curve, point = min(near)
            self.picked.emit(number, curve, point)


def _distances(event: Any, x: Any, y: Any) -> np.ndarray:
    """Return how far points lie from a click, dots; NaN for one that is not drawn."""
    with np.errstate(all="ignore"):  # zero on a logarithmic axis
        dots = event.inaxes.transData.transform(np.column_stack([x, y]))
    return np.hypot(*(dots - (event.x, event.y)).T)


def _colours(viewer: Any) -> tuple[str, str]:
    """Return the colours of text and of the background of a viewer."""
    from napari.utils.theme import get_theme

    theme = get_theme(viewer.theme)
    return theme.text.as_hex(format="long"), theme.background.as_hex(format="long")


def _brightness(colour: str) -> float:
    return sum(int(colour[i : i + 2], 16) for i in (1, 3, 5)) / 3
