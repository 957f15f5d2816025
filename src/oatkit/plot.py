"""Curves for a page: line profiles, L-curves, figures of merit against a parameter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.page import INK, PALE, Page

COLOURS = ("#0b6fa4", "#d1495b", "#2e8b57", "#b8860b", "#6a4c93", "#5c5c5c", "#e377c2", "#17becf")
"""Distinct on white, in print and to most colour-blind eyes."""
AXIS_LEFT, AXIS_BELOW = 150, 120
"""Dots for numbers and labels of the axes."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a plot."""

    label: str
    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    style: str = "-"
    """As matplotlib writes it: ``"-"``, ``"--"``, ``"o-"``."""


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


def draw_plot(page: Page, plot: Plot, left: int, bottom: int, width: int, height: int) -> None:
    """Draw a plot into a box of the page, its title above the box."""
    axes = page.axes(left + AXIS_LEFT, bottom + AXIS_BELOW, width - AXIS_LEFT, height - AXIS_BELOW)
    for colour, curve in zip(_cycled(len(plot.curves)), plot.curves, strict=True):
        axes.plot(curve.x, curve.y, curve.style, color=colour, linewidth=1, markersize=2.5, label=curve.label)
    for colour, mark in zip(_cycled(len(plot.marks)), plot.marks, strict=True):
        axes.plot([mark.x], [mark.y], "D", color=colour, markersize=4.5, fillstyle="none", label=mark.label)
    for x, label in plot.verticals:
        axes.axvline(x, color=PALE, linewidth=0.8, linestyle=":", label=label)
    if "x" in plot.logarithmic:
        axes.set_xscale("log")
    if "y" in plot.logarithmic:
        axes.set_yscale("log")
    if plot.names:
        axes.set_xticks(range(len(plot.names)), plot.names)
    axes.set_xlabel(plot.x_label, size=8, color=INK)
    axes.set_ylabel(plot.y_label, size=8, color=INK)
    axes.tick_params(labelsize=7.5, length=2, width=0.5, colors=INK, which="both")
    for spine in axes.spines.values():
        spine.set(linewidth=0.5, color=PALE)
    if any(curve.label for curve in plot.curves) or plot.marks:
        axes.legend(fontsize=6.5, frameon=False)
    page.text(left + AXIS_LEFT, bottom + height + 14, plot.title, size=9.5, va="bottom")


def _cycled(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]
