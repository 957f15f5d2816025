"""How a solver converges, drawn live: residual, gap and negative pixels by iteration, each in its own frame."""

import math
from typing import Any

from qtpy.QtCore import QPointF, QRectF, Qt
from qtpy.QtGui import QColor, QPainter, QPen, QPolygonF
from qtpy.QtWidgets import QSizePolicy, QWidget

from oatkit.gui.pipeline.run_log import Curve

PANELS = (
    ("residual_norm", "residual", "#58a6ff", True),
    ("relative_gap", "gap", "#3fb950", True),
    ("negative_share", "negative", "#e5484d", False),
)
"""Series, title, colour, and whether its axis is logarithmic."""

Series = list[tuple[float, float]]


class Convergence(QWidget):
    """Three small plots, each with its last value."""

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self._curve: Curve | None = None
        self.setMinimumHeight(72)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setToolTip(
            "by iteration: |A x - b| and the certified gap to the optimum (both logarithmic), and the share of "
            "negative pixels"
        )

    def show_curve(self, curve: Curve | None) -> None:
        """Draw another curve, or the same one that has grown."""
        self._curve = curve
        self.update()

    def paintEvent(self, event: Any) -> None:  # noqa: D102
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        width = self.width() / len(PANELS)
        for index, (name, title, colour, logarithmic) in enumerate(PANELS):
            series = self._curve.series(name) if self._curve else []
            box = QRectF(index * width + 2, 0, width - 4, self.height() - 2)
            self._draw(painter, box, series, (title, colour, logarithmic))
        painter.end()

    def _draw(self, painter: QPainter, box: QRectF, series: Series, look: tuple[str, str, bool]) -> None:
        title, colour, logarithmic = look
        text = self.palette().windowText().color()
        painter.setPen(text)
        painter.drawText(box, Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignHCenter, _caption(title, series))
        inner = box.adjusted(0, painter.fontMetrics().height() + 2, 0, 0)
        faint = QColor(text)
        faint.setAlpha(90)
        painter.setPen(QPen(faint, 1))
        painter.drawRect(inner)
        points = _scaled(series, inner.adjusted(3, 3, -3, -3), logarithmic)
        painter.setPen(QPen(QColor(colour), 1.6))
        painter.drawPolyline(QPolygonF(points))


def _caption(title: str, series: Series) -> str:
    if not series:
        return title
    value = series[-1][1]
    return f"{title} {100 * value:.1f} %" if title == "negative" else f"{title} {value:.2g}"


def _scaled(series: Series, box: QRectF, logarithmic: bool) -> list[QPointF]:
    """Return the points of a curve within a box; a curve of one value lies in its middle."""
    pairs = [(x, math.log10(y) if logarithmic else y) for x, y in series if y > 0 or not logarithmic]
    if len(pairs) < 2:
        return []
    (x0, x1), (y0, y1) = ((min(axis), max(axis)) for axis in zip(*pairs, strict=True))
    if y1 == y0:
        y0, y1 = y0 - 1, y1 + 1
    return [
        QPointF(box.left() + box.width() * (x - x0) / (x1 - x0), box.bottom() - box.height() * (y - y0) / (y1 - y0))
        for x, y in pairs
    ]
