"""A page of pictures in rows, with plots below: layout and nothing else.

Every pixel of an image covers a whole square of dots, so a single negative pixel is as red as many, and nothing covers
an image but an outline that was asked for. Importing this module needs matplotlib, the extra ``report``.
"""

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.data import Image
from oatkit.drawing.page import BAR_WIDTH, PALE, PERCENTILE, Figure, Page, Scale
from oatkit.drawing.plot import Plot, draw_plot
from oatkit.words import FRACTIONS, SIGNED

PANEL, MARGIN, GAP, TITLE, LINE = 640, 64, 48, 72, 44
"""Sizes in dots: least width of a panel, page margin, gap between panels, height of a title and of a line of text."""
BAR_SPACE = 220
"""Dots for the colour bar and its numbers."""
PLOT_WIDTH, PLOT_HEIGHT = 980, 680
COLUMNS, WIDEST = 6, 5308
"""At most so many panels, and dots, in a row: six of 800 dots, those of 200 pixels a side, and their colour bar."""


@dataclass(frozen=True)
class Panel:
    """One picture of a figure: a plane of an image, with a title above it and lines of text beneath."""

    title: str
    image: Image
    lines: tuple[str, ...] = ()
    wavelength: int = 0
    """Index of the plane of `image`."""
    outline: Image | None = None
    """A boundary to draw over the picture, which covers pixels: for figures whose subject it is."""
    in_space: bool = True
    """Whether its axes are lengths, so that it gets a scale bar."""

    @property
    def values(self) -> np.ndarray:
        """The plane, shape ``(y, x)``."""
        return self.image.values[self.wavelength]

    @property
    def negative(self) -> np.ndarray:
        """Which pixels are below zero and should not be, shape ``(y, x)``."""
        return (self.values < 0) & (self.image.quantity not in SIGNED)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in dots: a whole number of them for each pixel."""
        rows, columns = self.values.shape
        per_pixel = math.ceil(PANEL / columns)
        return columns * per_pixel, rows * per_pixel

    @property
    def dots_per_mm(self) -> float:
        """Magnification."""
        return self.size[0] / (self.values.shape[1] * self.image.grid.pixel_size_m * 1e3)


@dataclass(frozen=True)
class Block:
    """Panels in one row that share their colours, and the bar that explains them."""

    panels: tuple[Panel, ...]
    scale: Scale

    @property
    def width(self) -> int:
        """Dots, from the first panel to the numbers of the bar."""
        return sum(panel.size[0] + GAP for panel in self.panels) - GAP + BAR_SPACE

    @property
    def height(self) -> int:
        """Dots, title and lines included."""
        lines = max(len(panel.lines) for panel in self.panels)
        return TITLE + max(panel.size[1] for panel in self.panels) + 16 + LINE * lines + GAP


def sheet(groups: Sequence[Sequence[Panel]], plots: Sequence[Plot] = (), title: str = "", caption: str = "") -> Figure:
    """Draw rows of at most `COLUMNS` panels, those of one group in the same colours, and a row of plots below.

    Groups of a single panel stand side by side. A row is no wider than `WIDEST` dots, unless a single panel is.
    """
    rows = _rows(groups)
    widths = [sum(block.width for block in row) for row in rows]
    width = 2 * MARGIN + max([*widths, sum(map(_plot_width, plots)) - GAP])
    notes = textwrap.wrap(" · ".join(filter(None, (caption, _legend(groups)))), width // 16)
    heading = TITLE if title else 0
    below = TITLE + PLOT_HEIGHT + GAP if plots else 0
    page = Page(width, 2 * MARGIN + heading + sum(map(_height, rows)) + below + LINE * len(notes))
    top = page.height - MARGIN
    page.text(MARGIN, top - 8, title, size=12, weight="bold")
    top -= heading
    for row in rows:
        left = MARGIN
        for block in row:
            _draw_block(page, block, left, top)
            left += block.width
        top -= _height(row)
    left = MARGIN
    for plot in plots:
        draw_plot(page, plot, left, top - TITLE - PLOT_HEIGHT, PLOT_WIDTH, PLOT_HEIGHT)
        left += _plot_width(plot)
    top -= below
    for i, line in enumerate(notes):
        page.text(MARGIN, top - i * LINE, line, size=7.5, color=PALE)
    return page.figure


def scale_of(image: Image, planes: np.ndarray) -> Scale:
    """Return the colours of some planes of `image`: of its whole range where that is known, else of their values."""
    if image.quantity in FRACTIONS:
        return Scale.fraction()
    finite = planes[np.isfinite(planes)].astype(float)
    return Scale.signed(finite) if image.quantity in SIGNED else Scale.grey(finite)


def _rows(groups: Sequence[Sequence[Panel]]) -> list[list[Block]]:
    """Return the blocks of each row."""
    rows: list[list[Block]] = []
    for group in groups:
        scale = scale_of(group[0].image, np.concatenate([panel.values.ravel() for panel in group]))
        columns = _columns(group)
        blocks = [Block(tuple(group[i : i + columns]), scale) for i in range(0, len(group), columns)]
        if rows and _beside(rows[-1], blocks):
            rows[-1] += blocks
        else:
            rows += [[block] for block in blocks]
    return rows


def _columns(group: Sequence[Panel]) -> int:
    """Return how many panels of a group go into a row."""
    widest = max(panel.size[0] for panel in group) + GAP
    return min(COLUMNS, max(1, (WIDEST - BAR_SPACE) // widest))


def _beside(row: Sequence[Block], blocks: Sequence[Block]) -> bool:
    """Say whether a group fits into the row before it: both of single panels."""
    together = [*row, *blocks]
    return all(len(block.panels) == 1 for block in together) and sum(block.width for block in together) <= WIDEST


def _height(row: Sequence[Block]) -> int:
    return max(block.height for block in row)


def _plot_width(plot: Plot) -> int:
    return PLOT_WIDTH + plot.legend_width + GAP


def _legend(groups: Sequence[Sequence[Panel]]) -> str:
    panels = [panel for group in groups for panel in group]
    words = ["red: negative"] if any(panel.negative.any() for panel in panels) else []
    if any(panel.image.quantity not in (*FRACTIONS, *SIGNED) for panel in panels):
        words.append(f"greys from 0 to the {PERCENTILE}th percentile")
    return " · ".join(words)


def _draw_block(page: Page, block: Block, left: int, top: int) -> None:
    top -= TITLE
    for panel in block.panels:
        width, height = panel.size
        page.image(left, top - height, width, height, block.scale.paint(panel.values, panel.negative))
        if panel.outline is not None:
            page.outline(left, top - height, width, height, panel.outline.values[0])
        page.text(left, top + 14, panel.title, size=9.5, va="bottom")
        if panel.in_space:
            page.scale_bar(left + width, top + 14, panel.dots_per_mm)
        for i, line in enumerate(panel.lines):
            page.text(left, top - height - 16 - i * LINE, line, size=8)
        left += width + GAP
    first = block.panels[0]
    unit = f" ({first.image.unit})" if first.image.unit else ""
    height, label = first.size[1], first.image.quantity.replace("_", " ") + unit
    page.colour_bar(left - GAP + BAR_WIDTH, top - height, height, block.scale, label)
