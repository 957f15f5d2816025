"""The pictures of a report: one PNG for each plane of an image, and the lines that are drawn over it.

Every pixel of a plane is one pixel of its PNG, row 0 at the bottom, in the colours of the figures.
"""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.data import Grid, Image
from oatkit.drawing.page import Scale
from oatkit.drawing.sheet import Panel
from oatkit.regions import Region
from oatkit.report.ticks import Axis, linear, plain, round_part

UNITS = {"m": ("mm", 1e3)}
"""Units that are shown as others, and by how much values grow."""
BAR = np.linspace(1, 0, 256)[:, None]
"""Positions along a colour bar, the high end on top."""


@dataclass(frozen=True)
class Bar:
    """What colours mean."""

    src: str
    axis: Axis
    unit: str


@dataclass(frozen=True)
class Outline:
    """Lines over all pictures on one grid."""

    label: str
    path: str
    """As SVG writes it, in pixels from the upper left corner."""
    colour: int | None = None
    """Which of the colours of curves; None for the boundary of the body."""


@dataclass(frozen=True)
class Overlay:
    """All lines over pictures on one grid, and the length of their scale bar."""

    key: str
    width: int
    height: int
    outlines: tuple[Outline, ...]
    ruler_mm: str
    ruler_share: float
    """Length of the scale bar in widths of the picture."""


def plane_src(image: Image, index: int, scale: Scale) -> str:
    """Return one plane as the address of an inline PNG, negative pixels in pure red."""
    panel = Panel("", image, wavelength=index)
    return png_src(scale.paint(panel.values, panel.negative)[::-1])


def bar_of(image: Image, scale: Scale) -> Bar:
    """Return the colour bar of a scale."""
    low, high = float(scale.normalise.vmin or 0), float(scale.normalise.vmax or 1)
    unit, factor = UNITS.get(image.unit, (image.unit, 1.0))
    values = low + BAR * (high - low)
    return Bar(png_src(scale.paint(values, np.zeros(BAR.shape, bool))), linear(low * factor, high * factor), unit)


def png_src(colours: np.ndarray) -> str:
    """Return colours in 0 .. 1 of shape ``(y, x, 4)``, first row on top, as the address of an inline PNG."""
    from PIL import Image as Picture  # comes with matplotlib

    file = io.BytesIO()
    Picture.fromarray(np.round(255 * colours[..., :3]).astype(np.uint8)).save(file, "PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def overlay(key: str, grid: Grid, boundary: Image | None, regions: Sequence[Region]) -> Overlay:
    """Return the outlines of body and regions on `grid`, and its scale bar."""
    outlines = []
    if boundary is not None and boundary.grid == grid:
        outlines.append(Outline("outline of the body", _contour(boundary.values[0], 0.0)))
    for i, region in enumerate(regions):
        outlines.append(Outline(region.name, _region_path(region, grid), i))
    width_mm = 1e3 * grid.pixel_size_m * grid.shape[1]
    ruler = round_part(width_mm)
    return Overlay(key, grid.shape[1], grid.shape[0], tuple(outlines), plain(ruler), ruler / width_mm)


def _region_path(region: Region, grid: Grid) -> str:
    outline_m = region.outline_m
    if not len(outline_m):
        return _contour(np.where(np.pad(region.mask(grid), 1), 1.0, 0.0), 0.5, 1)
    left, _, bottom, _ = grid.extent_m
    return _path((outline_m - (bottom, left)) / grid.pixel_size_m, grid.shape[0])


def _contour(values: np.ndarray, level: float, padding: int = 0) -> str:
    """Return the lines of equal value; a pixel's centre lies half a pixel from its edge."""
    from skimage.measure import find_contours

    rows = values.shape[0] - 2 * padding
    return " ".join(_path(line - padding + 0.5, rows) for line in find_contours(values, level))


def _path(points: np.ndarray, rows: int) -> str:
    """Return a closed polygon of points ``(row, column)``, counted from the lower left corner."""
    return "M" + "L".join(f"{column:.2f} {rows - row:.2f}" for row, column in points) + "Z"
