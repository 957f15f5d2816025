"""A page to draw on with matplotlib, without a display and without pyplot; `oatkit.figure` lays it out.

Importing it raises `ResultError` where matplotlib, the extra ``report``, is not installed.
"""

import io
import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from oatkit.errors import ResultError

try:
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import ScalarFormatter
except ImportError as error:
    raise ResultError('a figure needs matplotlib, which is not installed: pip install "oatkit[report]"') from error

# A power of two, so that sizes in dots survive the way through inches exactly.
DOTS_PER_INCH = 256
BAR_WIDTH = 28
SCALE_BAR = 240
"""Greatest length of a scale bar in dots."""
INK, PALE, UNDEFINED = "#1a1a1a", "#666666", "#d8d4cc"
RED = (1.0, 0.0, 0.0, 1.0)
LINE = "#19c1ff"
"""Colour of what is drawn over an image: neither a grey nor the red of negative pixels."""
PERCENTILE = 99.9


@dataclass(frozen=True)
class Scale:
    """Which colour stands for which value."""

    normalise: Normalize
    colours: Any

    @classmethod
    def grey(cls, values: np.ndarray) -> Self:
        """Black at zero, white at the 99.9th percentile of finite `values`; undefined pixels in pale brown."""
        high = float(np.percentile(values, PERCENTILE)) if values.size else 0.0
        return cls(Normalize(0, high if high > 0 else _size(values)), colormaps["gray"].with_extremes(bad=UNDEFINED))

    @classmethod
    def signed(cls, values: np.ndarray) -> Self:
        """Blue below zero, white at zero, red above, up to the largest of finite `values`."""
        return cls(Normalize(-_size(values), _size(values)), colormaps["RdBu_r"].with_extremes(bad=UNDEFINED))

    @classmethod
    def fraction(cls) -> Self:
        """From dark blue at 0 to yellow at 1, in even steps for the eye, whatever the values."""
        return cls(Normalize(0, 1), colormaps["viridis"].with_extremes(bad=UNDEFINED))

    def paint(self, values: np.ndarray, negative: np.ndarray) -> np.ndarray:
        """Return the colours of `values`, pure red where `negative`: shape ``(y, x, 4)``."""
        colours = np.asarray(self.colours(self.normalise(np.ma.masked_invalid(values.astype(float)))))
        colours[negative] = RED
        return colours


class Page:
    """A white page measured in dots from its lower left corner."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        inches = (width / DOTS_PER_INCH, height / DOTS_PER_INCH)
        self.figure = Figure(figsize=inches, dpi=DOTS_PER_INCH, facecolor="white")

    def text(self, left: float, top: float, text: str, size: float, **style: Any) -> None:
        """Write a line of `size` points, taken literally."""
        style = {"color": INK, "va": "top", "ha": "left", **style}
        self.figure.text(left / self.width, top / self.height, text, size=size, parse_math=False, **style)

    def image(self, left: int, bottom: int, width: int, height: int, colours: np.ndarray) -> None:
        """Draw pixels, row 0 at the bottom."""
        axes = self.axes(left, bottom, width, height)
        axes.imshow(colours, origin="lower", interpolation="nearest", aspect="auto")
        axes.set_axis_off()

    def scale_bar(self, right: int, bottom: int, dots_per_mm: float) -> None:
        """Draw a bar of a round length."""
        length = _round_length(SCALE_BAR / dots_per_mm)
        ends = [(right - length * dots_per_mm) / self.width, right / self.width]
        self.figure.add_artist(
            Line2D(ends, [bottom / self.height] * 2, color=INK, linewidth=1.5, solid_capstyle="butt", label="scale bar")
        )
        self.text(right, bottom + 6, f"{length:g} mm", size=7.5, ha="right", va="bottom")

    def colour_bar(self, left: int, bottom: int, height: int, scale: Scale, label: str) -> None:
        """Draw the values of a scale, with what they are."""
        numbers = ScalarFormatter(useMathText=True)
        numbers.set_powerlimits((-2, 4))
        axes = self.axes(left, bottom, BAR_WIDTH, height)
        bar = self.figure.colorbar(ScalarMappable(scale.normalise, scale.colours), axes, format=numbers)
        axes.tick_params(labelsize=7.5, length=2, width=0.5, colors=INK)
        axes.yaxis.get_offset_text().set(size=7.5, ha="left")
        bar.outline.set(edgecolor=PALE, linewidth=0.5)
        bar.set_label(label, size=8, color=INK)

    def outline(self, left: int, bottom: int, width: int, height: int, signed: np.ndarray) -> None:
        """Draw the line along which `signed`, of one value for each pixel of the image in that box, is zero."""
        axes = self.axes(left, bottom, width, height)
        rows, columns = signed.shape
        axes.contour(signed, levels=[0], colors=[LINE], linewidths=0.9)
        axes.set(xlim=(-0.5, columns - 0.5), ylim=(-0.5, rows - 0.5))
        axes.set_axis_off()

    def axes(self, left: int, bottom: int, width: int, height: int) -> Any:
        """Return matplotlib's axes over a box of the page."""
        return self.figure.add_axes((left / self.width, bottom / self.height, width / self.width, height / self.height))


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file."""
    file = io.BytesIO()
    FigureCanvasAgg(figure).print_png(file)
    return file.getvalue()


def _size(values: np.ndarray) -> float:
    return float(np.max(abs(values), initial=0)) or 1.0


def _round_length(length: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is at most `length`."""
    decade = 10.0 ** math.floor(math.log10(length))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= length * (1 + 1e-9)))
