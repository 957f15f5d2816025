"""Plots in a dock: the same that a page has, in the colours of the viewer, to click on and to keep as a picture."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from qtpy.QtCore import QTimer, Signal
from qtpy.QtWidgets import QVBoxLayout, QWidget

from oatkit.drawing.plot import ON_DARK, PRINT, Curve, Plot, Style, draw_curves, draw_lines
from oatkit.gui.leaving import when_gone

NEAR = 14
"""How far from a point a click still means it, dots."""
LOW = 170
"""Least height of a plot with its title and its labels, dots."""
WIDE = 260
DARK = 128
"""Brightness of a background, 0 .. 255, below which lines are light."""
FILLED = 0.6
"""Share of each axis that curves fill at least, once they have come to rest."""
GROWTH = 0.2
"""By how much of its length an axis grows beyond a curve that leaves it."""
REST_MS = 400
"""After the last change curves count as at rest; until then axes do not shrink, so that their motion is seen."""


class PlotView(QWidget):
    """Shows plots (`oatkit.drawing.plot`) above one another, drawn only while seen: a hidden dock costs nothing."""

    picked = Signal(int, int, int)
    """A point was clicked: the number of its plot, of its curve there, and of the point on the curve."""

    def __init__(self, viewer: Any, parent: Any = None, height: int | None = None) -> None:
        """Make an empty view; `height`, dots, is that of each plot, else they take what room there is."""
        super().__init__(parent)
        self._viewer, self._drawn, self._height = viewer, False, height
        self._background: Any = None
        """The plots without their lines, as pixels, once they were needed."""
        self._rest = QTimer(self)
        self._rest.setSingleShot(True)
        self._rest.setInterval(REST_MS)
        self._rest.timeout.connect(self._settle)
        self.plots: tuple[Plot, ...] = ()
        self._canvas: Any = None
        self._axes: list[Any] = []
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self.setMinimumSize(WIDE, LOW)
        theme, follow = viewer.events.theme, self._follow_theme
        theme.connect(follow)
        when_gone(self, partial(theme.disconnect, follow))

    def show_plots(self, plots: Sequence[Plot]) -> None:
        """Show other plots; where only the lines within the axes are others, they alone are drawn, which is quick."""
        before, self.plots = self.plots, tuple(plots)
        height = (self._height or LOW) * max(1, len(self.plots))
        if self.minimumHeight() != height:
            (self.setFixedHeight if self._height else self.setMinimumHeight)(height)
        if not self.isVisible():
            self._drawn = False
        elif self._drawn and list(map(_frame, before)) == list(map(_frame, self.plots)):
            self._draw_lines()
            self._rest.start()
        else:
            self._draw()

    def save(self, path: Path, title: str = "", caption: str = "") -> None:
        """Write the plots as a PNG on white. Raises `ResultError` where it cannot be written."""
        from oatkit.atomic import write_file
        from oatkit.drawing.page import png
        from oatkit.drawing.sheet import sheet

        write_file(path, png(sheet((), self.plots, title, caption)), overwrite=True)

    def showEvent(self, event: Any) -> None:
        """Draw what was shown while nobody could see it."""
        super().showEvent(event)
        if not self._drawn:
            self._draw()

    def _follow_theme(self, event: Any = None) -> None:
        self._drawn = False
        self.show_plots(self.plots)

    def _settle(self) -> None:
        """Give curves that have come to rest the axes that suit them."""
        shares = (_share(*lines, axis) for lines in zip(self._axes, self.plots, strict=True) for axis in "xy")
        if self.isVisible() and any(share < FILLED for share in shares):
            self._draw()

    def _draw_lines(self) -> None:
        """Draw the lines over the pixels of the axes: a tenth of the time that axes and letters take."""
        canvas, (style, _) = self._canvas, self._style()
        for axes, plot in zip(self._axes, self.plots, strict=True):
            if _grow(axes, plot):
                self._background = None
            for artist in (*axes.lines, *axes.collections):
                artist.remove()
        if self._background is None:
            canvas.draw()
            self._background = canvas.copy_from_bbox(canvas.figure.bbox)
        canvas.restore_region(self._background)
        for axes, plot in zip(self._axes, self.plots, strict=True):
            draw_lines(axes, plot, style)
            for artist in (*axes.collections, *axes.lines):
                axes.draw_artist(artist)
        canvas.update()  # blit would paint all of the window at once

    def _style(self) -> tuple[Style, str]:
        """Return the colours of the plots, and that of the paper."""
        ink, paper = _colours(self._viewer)
        return Style(ink, "#808890", ON_DARK if _brightness(paper) < DARK else PRINT.colours), paper

    def _draw(self) -> None:
        self._drawn, self._background = True, None
        figure, (style, paper) = self._figure(), self._style()
        figure.clear()
        figure.set_facecolor(paper)
        self._axes = [figure.add_subplot(len(self.plots), 1, i + 1, facecolor=paper) for i in range(len(self.plots))]
        for axes, plot in zip(self._axes, self.plots, strict=True):
            draw_curves(axes, plot, style)
            axes.set_title(plot.title, size=8.5, color=style.ink, parse_math=False)
        self._canvas.draw_idle()

    def _figure(self) -> Any:
        if self._canvas is None:
            from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg
            from matplotlib.figure import Figure

            self._canvas = FigureCanvasQTAgg(Figure(layout="constrained"))
            self._canvas.mpl_connect("button_press_event", self._click)
            self._canvas.mpl_connect("resize_event", self._forget)
            self._column.addWidget(self._canvas)
        return self._canvas.figure

    def _forget(self, event: Any) -> None:
        self._background = None

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


def _frame(plot: Plot) -> tuple[Any, ...]:
    """Return all of a plot that its axes and letters are made of."""
    curves = [(curve.label, curve.style, curve.spread is None, curve.colour) for curve in plot.curves]
    words = (plot.title, plot.x_label, plot.y_label, plot.logarithmic, plot.names)
    return (*words, curves, [mark.label for mark in plot.marks], [label for _, label in plot.verticals])


def _grow(axes: Any, plot: Plot) -> bool:
    """Let axes reach as far as the lines of a plot, no longer by themselves; say whether they had to grow."""
    grown = False
    for axis in "xy":
        (least, most), (low, high) = _scaled(axes, plot, axis)
        room = GROWTH * (high - low)
        ends = (least - room if least < low else low, most + room if most > high else high)
        if ends != (low, high):
            grown = True
            getattr(axes, f"set_{axis}lim")(np.power(10.0, ends) if axis in plot.logarithmic else ends)
    axes.autoscale(False)
    return grown


def _share(axes: Any, plot: Plot, axis: str) -> float:
    """Return the share of an axis that the lines of a plot fill."""
    lines, whole = np.ptp(_scaled(axes, plot, axis), axis=1)
    return float(lines / whole)


def _scaled(axes: Any, plot: Plot, axis: str) -> np.ndarray:
    """Return the ends of the lines of a plot and those of an axis, as they lie on paper: shape ``(2, 2)``."""
    ends = np.array([_ends(plot, axis), getattr(axes, f"get_{axis}lim")()])
    return np.log10(ends) if axis in plot.logarithmic else ends


def _spread(curve: Curve) -> np.ndarray:
    return np.asarray(0.0 if curve.spread is None else curve.spread)


def _ends(plot: Plot, axis: str) -> tuple[float, float]:
    """Return the least and the largest number on an axis of a plot; NaN where there is none."""
    parts = [getattr(mark, axis) for mark in plot.marks]
    if axis == "x":
        parts += [curve.x for curve in plot.curves] + [at for at, _ in plot.verticals]
    else:
        parts += [np.add(c.y, sign * _spread(c)) for c in plot.curves for sign in (-1, 1)]
    numbers = np.concatenate([np.ravel(part) for part in parts]) if parts else np.zeros(0)
    numbers = numbers[np.isfinite(numbers) & (numbers > 0 if axis in plot.logarithmic else True)]
    return (float(numbers.min()), float(numbers.max())) if numbers.size else (np.nan, np.nan)


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
