"""Figures of images: side by side in one scale of grey, negative pixels in pure red and counted, y upwards.

Every pixel of an image covers a whole square of dots and nothing covers an image, so a single negative pixel is as red
as many. Importing this module needs matplotlib, the extra ``report``.
"""

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.atomic import write_file
from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.page import BAR_WIDTH, PALE, PERCENTILE, Figure, Page, Scale, png
from oatkit.result import Result

PANEL, MARGIN, GAP, TITLE, LINE = 640, 64, 48, 72, 44
"""Sizes in dots: least width of a panel, page margin, gap between panels, height of a title and of a line of text."""
BAR_SPACE = 220
"""Dots for the colour bar and its numbers."""
COLUMNS = 4
SIGNED = ("boundary",)
"""Quantities that are negative by nature."""


@dataclass(frozen=True)
class Panel:
    """One picture of a figure: a plane of an image, with a title above it and lines of text beneath."""

    title: str
    image: Image
    lines: tuple[str, ...] = ()
    wavelength: int = 0
    """Index of the plane of `image`."""

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


def compare(panels: Sequence[tuple[str, Image, Sequence[str]]], title: str = "", caption: str = "") -> Figure:
    """Draw the first planes of images side by side in one colour scale.

    A panel is its title, its image, and the lines of text beneath: figures of merit, the number of negative pixels.
    """
    if not panels:
        raise ValidationError("a figure needs at least one panel")
    return _draw([[Panel(name, image, tuple(lines)) for name, image, lines in panels]], title, caption)


def write_comparison(
    path: Path,
    panels: Sequence[tuple[str, Image, Sequence[str]]],
    title: str = "",
    caption: str = "",
    overwrite: bool = False,
) -> None:
    """Write `compare` as a PNG file. Raises `ResultError` where it exists already, unless `overwrite`."""
    write_file(path, png(compare(panels, title, caption)), overwrite)


def image_figure(result: Result) -> Figure:
    """Draw all images of a result's (first) frame, one panel for each wavelength, with how they came about."""
    groups = [
        [Panel(_title(image, i), image, tuple(_lines(image, i)), i) for i in range(len(image.values))]
        for image in result.values()
    ]
    name = result.scan.get("name") or "Reconstruction"
    return _draw(groups, f"{name}, frame {result.frame_index}", " · ".join(_provenance(result)))


def _title(image: Image, index: int) -> str:
    quantity = image.quantity.replace("_", " ")
    return f"{quantity}, {image.wavelengths_nm[index]:g} nm" if image.wavelengths_nm else quantity


def _lines(image: Image, index: int) -> Iterator[str]:
    """Yield how many pixels of one wavelength are negative, and what its solver promises."""
    plane, found = image.values[index], image.diagnostics
    negative = int((plane < 0).sum())
    if image.quantity not in SIGNED:
        share = 100 * negative / plane.size
        yield f"{negative:,} negative pixel{'s' * (negative > 1)} ({share:.1f} %)" if negative else "no negative pixels"
    gap = _of_wavelength(found.get("relative_gap"), index)
    if gap is not None and math.isfinite(gap):
        yield f"certified within {gap:.1e} of the optimum"
    elif gap is not None and math.isinf(gap):
        yield "uncertified"
    if _of_wavelength(found.get("converged"), index) is False:
        yield "did not converge"


def _of_wavelength(value: Any, index: int) -> Any:
    return value[index] if isinstance(value, tuple | list | np.ndarray) else value


def _provenance(result: Result) -> Iterator[str]:
    """Yield solver with weight, speed of sound and version, as far as they are known."""
    solver, asked = result.pipeline.get("reconstruct") or {}, result.requested.get("reconstruct") or {}
    if "use" in solver:
        yield str(solver["use"])
    if isinstance(solver.get("weight"), int | float):
        rule = f" (by {asked['weight']})" if isinstance(asked.get("weight"), str) else ""
        yield f"weight {solver['weight']:.3g}{rule}"
    if "speed_of_sound_m_s" in result.scan:
        origin = result.scan.get("speed_of_sound_source")
        yield f"speed of sound {result.scan['speed_of_sound_m_s']:.1f} m/s" + (f" ({origin})" if origin else "")
    if "oatkit" in result.versions:
        yield f"oatkit {result.versions['oatkit']}"


def _draw(groups: Sequence[Sequence[Panel]], title: str, caption: str) -> Figure:
    """Lay out rows of at most `COLUMNS` panels; panels of one group share their colours."""
    rows = [
        (group[i : i + COLUMNS], scale)
        for group, scale in ((group, _scale(group)) for group in groups)
        for i in range(0, len(group), COLUMNS)
    ]
    width = 2 * MARGIN + BAR_SPACE + max(sum(p.size[0] + GAP for p in row) - GAP for row, _ in rows)
    notes = textwrap.wrap(f"{caption} · {_legend(groups)}" if caption else _legend(groups), width // 16)
    heading = TITLE if title else 0
    page = Page(width, 2 * MARGIN + heading + sum(_height(row) for row, _ in rows) + LINE * len(notes))
    top = page.height - MARGIN
    page.text(MARGIN, top - 8, title, size=12, weight="bold")
    top -= heading
    for row, scale in rows:
        _draw_row(page, row, scale, top)
        top -= _height(row)
    for i, line in enumerate(notes):
        page.text(MARGIN, top - i * LINE, line, size=7.5, color=PALE)
    return page.figure


def _scale(panels: Sequence[Panel]) -> Scale:
    values = np.concatenate([panel.values[np.isfinite(panel.values)] for panel in panels]).astype(float)
    return Scale.signed(values) if panels[0].image.quantity in SIGNED else Scale.grey(values)


def _legend(groups: Sequence[Sequence[Panel]]) -> str:
    greys = f"greys from 0 to the {PERCENTILE}th percentile"
    return f"red: negative · {greys}" if any(panel.negative.any() for group in groups for panel in group) else greys


def _height(row: Sequence[Panel]) -> int:
    return TITLE + max(p.size[1] for p in row) + 16 + LINE * max(len(p.lines) for p in row) + GAP


def _draw_row(page: Page, row: Sequence[Panel], scale: Scale, top: int) -> None:
    left, top = MARGIN, top - TITLE
    for panel in row:
        width, height = panel.size
        page.image(left, top - height, width, height, scale.paint(panel.values, panel.negative))
        page.text(left, top + 14, panel.title, size=9.5, va="bottom")
        page.scale_bar(left + width, top + 14, panel.dots_per_mm)
        for i, line in enumerate(panel.lines):
            page.text(left, top - height - 16 - i * LINE, line, size=8)
        left += width + GAP
    first = row[0]
    unit = f" ({first.image.unit})" if first.image.unit else ""
    height, label = first.size[1], first.image.quantity.replace("_", " ") + unit
    page.colour_bar(left - GAP + BAR_WIDTH, top - height, height, scale, label)
