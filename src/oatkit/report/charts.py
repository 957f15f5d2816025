"""Curves as the numbers of a small SVG: where its lines, ticks and labels lie."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.drawing.plot import COLOURS, Curve, Plot
from oatkit.report.ticks import Axis, linear, logarithmic

WIDTH, HEIGHT = 380, 220
"""Of the box between the axes, in the units of the drawing."""


@dataclass(frozen=True)
class Line:
    """One curve."""

    label: str
    points: str
    """As SVG writes them."""
    colour: int
    dots: tuple[tuple[float, float], ...]
    band: str = ""
    """The outline of the spread, likewise."""


@dataclass(frozen=True)
class Note:
    """A point or a vertical line with a word."""

    label: str
    x: float
    y: float | None = None


@dataclass(frozen=True)
class Chart:
    """A plot in the units of its drawing, the origin in the upper left corner of the box."""

    title: str
    x_label: str
    y_label: str
    x_axis: Axis
    y_axis: Axis
    lines: tuple[Line, ...]
    notes: tuple[Note, ...]
    width: int = WIDTH
    height: int = HEIGHT


@dataclass(frozen=True)
class _Range:
    """From values to shares of an axis."""

    low: float
    high: float
    logarithmic: bool

    @classmethod
    def of(cls, values: Sequence[float], logarithmic: bool) -> "_Range":
        finite = [v for v in values if math.isfinite(v) and (v > 0 or not logarithmic)]
        low, high = (min(finite), max(finite)) if finite else (1.0, 10.0)
        if logarithmic:
            widen = max((high / low) ** 0.05, 1.05)
            return cls(low / widen, high * widen, True)
        margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        return cls(low - margin, high + margin, False)

    def share(self, value: float) -> float:
        if self.logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low) if value > 0 else math.nan
        return (value - self.low) / (self.high - self.low)

    @property
    def axis(self) -> Axis:
        return logarithmic(self.low, self.high) if self.logarithmic else linear(self.low, self.high)


def chart(plot: Plot) -> Chart:
    """Lay out a plot."""
    x = _Range.of([*(v for c in plot.curves for v in c.x), *(v for v, _ in plot.verticals)], "x" in plot.logarithmic)
    y = _Range.of([v for c in plot.curves for v in _extremes(c)], "y" in plot.logarithmic)
    lines = tuple(_line(curve, i % len(COLOURS), x, y) for i, curve in enumerate(plot.curves))
    notes = [Note(mark.label, *_place(mark.x, mark.y, x, y)) for mark in plot.marks]
    notes += [Note(label, WIDTH * x.share(value)) for value, label in plot.verticals]
    shown = tuple(note for note in notes if math.isfinite(note.x) and (note.y is None or math.isfinite(note.y)))
    return Chart(plot.title, plot.x_label, plot.y_label, x.axis, y.axis, lines, shown)


def _extremes(curve: Curve) -> list[float]:
    y, spread = np.asarray(curve.y, float), 0 if curve.spread is None else np.asarray(curve.spread, float)
    return [*(y - spread), *(y + spread)]


def _line(curve: Curve, colour: int, x: _Range, y: _Range) -> Line:
    dots = _places(curve.x, curve.y, x, y)
    band = ""
    if curve.spread is not None:
        above, below = np.add(curve.y, curve.spread), np.subtract(curve.y, curve.spread)
        band = _points(_places(curve.x, above, x, y) + _places(curve.x, below, x, y)[::-1])
    return Line(curve.label, _points(dots), colour, tuple(dots), band)


def _places(xs: Any, ys: Any, x: _Range, y: _Range) -> list[tuple[float, float]]:
    """Return where points lie; those that cannot be drawn are left out."""
    places = (_place(a, b, x, y) for a, b in zip(xs, ys, strict=True))
    return [place for place in places if all(map(math.isfinite, place))]


def _points(places: list[tuple[float, float]]) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in places)


def _place(a: float, b: float, x: _Range, y: _Range) -> tuple[float, float]:
    return WIDTH * x.share(a), HEIGHT * (1 - y.share(b))
