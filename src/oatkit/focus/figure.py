"""The figure of a speed of sound by focus: how sharp the image is at each speed, and what each metric picks."""

from collections.abc import Iterable

import numpy as np

from oatkit.drawing.page import Figure
from oatkit.drawing.plot import Curve, Mark, Plot
from oatkit.drawing.sheet import sheet
from oatkit.focus import Focus
from oatkit.focus.metrics import TRUSTED


def focus_figure(focus: Focus) -> Figure:
    """Return the curves of all metrics, each scaled to 0 .. 1, with the pick, what the scan says, and what to doubt."""
    plots = (
        _plot(focus, "Metrics that hold in simulation", TRUSTED),
        _plot(focus, "Other metrics", [name for name in focus.scores if name not in TRUSTED]),
    )
    title = f"Speed of sound by focus: {focus.speed_m_s:.1f} m/s"
    return sheet((), plots, title, " · ".join(focus.notes))


def _plot(focus: Focus, title: str, names: Iterable[str]) -> Plot:
    return Plot(
        title,
        tuple(_curve(focus, name) for name in names),
        x_label="speed of sound (m/s)",
        y_label="sharpness, scaled to 0 .. 1",
        marks=(Mark(focus.speed_m_s, 1.0, f"the pick, {focus.speed_m_s:.1f}"),),
        verticals=((focus.header_m_s, f"the scan says {focus.header_m_s:.1f}"),),
    )


def _curve(focus: Focus, name: str) -> Curve:
    scores = np.array(focus.scores[name])
    return Curve(
        f"{name}, best at {focus.picks[name]:.1f}", focus.speeds_m_s, (scores - scores.min()) / (np.ptp(scores) or 1)
    )
