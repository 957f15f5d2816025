"""Curves for a page: line profiles, L-curves, figures of merit against a parameter."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.drawing.page import INK, PALE, Page

COLOURS = ("#0b6fa4", "#d1495b", "#2e8b57", "#b8860b", "#6a4c93", "#5c5c5c", "#e377c2", "#17becf")
"""Distinct on white, in print and to most colour-blind eyes."""
ON_DARK = ("#58a6ff", "#ff7b72", "#56d364", "#e3b341", "#bc8cff", "#a8b1bb", "#f778ba", "#39c5cf")
"""The same order of colours, distinct on a dark window."""
AXIS_LEFT, AXIS_BELOW = 150, 120
"""Dots for numbers and labels of the axes."""
MOST_INSIDE = 4
"""A legend of more lines stands beside the axes: within them it would cover curves."""
LEGEND_HANDLE, LEGEND_LETTER = 90, 12
"""Dots for what stands before a label of the legend, and for each of its letters."""


@dataclass(frozen=True)
class Style:
    """The colours of a plot."""

    ink: str
    """Of text."""
    pale: str
    """Of axes and of lines that only guide the eye."""
    colours: tuple[str, ...]
    """Of the curves, in turn."""

    def of(self, index: int) -> str:
        """Return the colour of a curve, by its number."""
        return self.colours[index % len(self.colours)]


PRINT = Style(INK, PALE, COLOURS)


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a plot."""

    label: str
    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    style: str = "-"
    """As matplotlib writes it: ``"-"``, ``"--"``, ``"o-"``."""
    spread: Sequence[float] | np.ndarray | None = None
    """Half the height of a band around the line, at each point."""
    colour: int | None = None
    """Number of its colour; None for its own number among the curves."""


@dataclass(frozen=True)
class Mark:
    """A point worth a word."""

    x: float
    y: float
    label: str


@dataclass(frozen=True)
class Plot:
    """Curves over one pair of axes."""

    title: str
    curves: tuple[Curve, ...]
    x_label: str = ""
    y_label: str = ""
    logarithmic: str = ""
    """Which axes are: ``""``, ``"x"``, ``"y"`` or ``"xy"``."""
    marks: tuple[Mark, ...] = ()
    verticals: tuple[tuple[float, str], ...] = ()
    """Values of x worth a line, each with its label."""
    names: tuple[str, ...] = ()
    """What to write at x = 0, 1, 2, ... in place of numbers."""

    @property
    def labels(self) -> list[str]:
        """The lines of the legend."""
        drawn = (*(c.label for c in self.curves), *(m.label for m in self.marks), *(text for _, text in self.verticals))
        return [label for label in drawn if label]

    @property
    def legend_width(self) -> int:
        """Dots for a legend beside the axes; 0 where it stands within them."""
        if len(self.labels) <= MOST_INSIDE:
            return 0
        return LEGEND_HANDLE + LEGEND_LETTER * max(map(len, self.labels))


def draw_plot(page: Page, plot: Plot, left: int, bottom: int, width: int, height: int) -> None:
    """Draw a plot into a box of the page, its title above the box, a long legend to the right of it."""
    axes = page.axes(left + AXIS_LEFT, bottom + AXIS_BELOW, width - AXIS_LEFT, height - AXIS_BELOW)
    draw_curves(axes, plot, PRINT, beside=bool(plot.legend_width))
    page.text(left + AXIS_LEFT, bottom + height + 14, plot.title, size=9.5, va="bottom")


def draw_curves(axes: Any, plot: Plot, style: Style, beside: bool = False) -> None:
    """Draw all of a plot but its title on matplotlib's axes; `beside` them or within them stands the legend."""
    draw_lines(axes, plot, style)
    _draw_axes(axes, plot, style)
    if plot.labels:
        where = {"loc": "upper left", "bbox_to_anchor": (1, 1)} if beside else {}
        axes.legend(fontsize=6.5, frameon=False, labelcolor=style.ink, **where)


def draw_lines(axes: Any, plot: Plot, style: Style) -> None:
    """Draw what lies between the axes: curves, marks and verticals."""
    for i, curve in enumerate(plot.curves):
        colour = style.of(i if curve.colour is None else curve.colour)
        axes.plot(curve.x, curve.y, curve.style, color=colour, linewidth=1, markersize=2.5, label=_literal(curve.label))
        if curve.spread is not None:
            low, high = np.subtract(curve.y, curve.spread), np.add(curve.y, curve.spread)
            axes.fill_between(curve.x, low, high, color=colour, alpha=0.15, linewidth=0)
    for i, mark in enumerate(plot.marks):
        look = {"color": style.of(i), "markersize": 4.5, "fillstyle": "none"}
        axes.plot([mark.x], [mark.y], "D", label=_literal(mark.label), **look)
    for x, label in plot.verticals:
        axes.axvline(x, color=style.pale, linewidth=0.8, linestyle=":", label=_literal(label))


def _draw_axes(axes: Any, plot: Plot, style: Style) -> None:
    if "x" in plot.logarithmic:
        axes.set_xscale("log")
    if "y" in plot.logarithmic:
        axes.set_yscale("log")
    if plot.names:
        axes.set_xticks(range(len(plot.names)), plot.names)
    axes.set_xlabel(plot.x_label, size=8, color=style.ink)
    axes.set_ylabel(plot.y_label, size=8, color=style.ink)
    axes.tick_params(labelsize=7.5, length=2, width=0.5, colors=style.ink, which="both")
    for spine in axes.spines.values():
        spine.set(linewidth=0.5, color=style.pale)


def _literal(label: str) -> str:
    """Return a label, which may hold a name from a file, as matplotlib shows it: no formula, and never kept back."""
    return label.replace("$", r"\$").lstrip("_")
