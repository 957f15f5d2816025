"""Fig. 3: the L-curves of least squares and of maximum entropy on the star phantom, and where rules see a corner."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from oatkit.data import Image
from oatkit.drawing.plot import Curve, Mark, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.paper.methods import L2, MAXENT, MAXENT_FLAT
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.star import Star
from oatkit.paper.sweep import Sweep, sweep

METHODS = (L2, MAXENT, MAXENT_FLAT)
WHY = "the scale of the paper's operator, on which its weights depend, is not stated"

SETTING = Setting()


def fig3(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    star = Star(setting)
    yield f"simulated: {setting.words()}"
    sweeps = []
    for method in METHODS:
        sweeps.append(sweep(method, star.problem, setting.per_decade, star.truth[0].values[0]))
        yield f"{method.label}: " + ", ".join(f"{rule} {w:.3g} ({db:.2f} dB)" for rule, w, db in _picks(sweeps[-1]))
    title = "Fig. 3: L-curves on the star phantom"
    groups = [[_panel(star.truth[0], found) for found in sweeps]]
    figure = sheet(groups, [_curve(found) for found in sweeps], title, setting.words())
    yield Outcome("fig3", title, figure, tuple(_beside(sweeps)), _table(sweeps), _notes(sweeps))


def _picks(found: Sweep) -> list[tuple[str, float, float]]:
    """Return rule, weight and PSNR for each way to choose."""
    rules = {"curvature": found.corner, "chord": found.chord, "nearest to the origin": _nearest(found)}
    return [(name, found.weights[i], found.scores[i]) for name, i in (rules | {"best": found.best}).items()]


def _nearest(found: Sweep) -> int:
    """Return the index of the point of least distance from the origin, which the paper names as the corner."""
    return int(np.argmin(np.hypot(np.square(found.residual_norms), found.penalties)))


def _panel(truth: Image, found: Sweep) -> Panel:
    image = replace(truth, values=found.ends[found.corner].image)
    lines = (f"weight {found.weights[found.corner]:.3g}, the corner", f"PSNR {found.scores[found.corner]:.2f} dB")
    return Panel(found.label, image, lines)


def _curve(found: Sweep) -> Plot:
    penalty = [max(value, 1e-300) for value in found.penalties]
    marks = tuple(
        Mark(found.residual_norms[i], penalty[i], name)
        for name, i in (("curvature", found.corner), ("chord", found.chord), ("best PSNR", found.best))
    )
    curves = (Curve("", found.residual_norms, penalty, "o-"),)
    return Plot(found.label, curves, "|A x - b|", "penalty", "xy", marks)


def _table(sweeps: Sequence[Sweep]) -> tuple[Sequence[str], ...]:
    heading = ("method", "rule", "weight", "PSNR, dB")
    rows = [(s.label, rule, f"{w:.3g}", f"{db:.2f}") for s in sweeps for rule, w, db in _picks(s)]
    return (heading, *rows)


def _beside(sweeps: Sequence[Sweep]) -> Iterator[Beside]:
    for found in sweeps:
        yield Beside(f"weight of {found.label}", "not stated", f"{found.weights[found.corner]:.3g} (curvature)", WHY)


def _notes(sweeps: Sequence[Sweep]) -> tuple[str, ...]:
    spread = max(max(w for _, w, _ in _picks(s)) / min(w for _, w, _ in _picks(s)) for s in sweeps)
    return (
        f"The rules differ by up to a factor of {spread:.3g} on the same data. The least distance from the origin, in "
        "the paper's words, depends on the units of the two axes: here |A x - b|² and the penalty as they stand.",
        "For maximum entropy the second axis is the relative entropy to the prior, which is never negative; the "
        "paper's sum of x log x can be, and then has no logarithm.",
    )
