"""Fig. S1: maximum entropy over the range of the weight."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.paper.methods import Method
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.star import Star
from oatkit.paper.sweep import Sweep, sweep

RANGE = (1e-4, 10.0)
METHODS = (
    Method("structural prior", "maxent-nlcg", RANGE),
    Method("flat prior", "maxent-nlcg", RANGE, {"prior": 0.01}),
)
WITHIN_DB = 1.0

SETTING = Setting()


def figS1(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    star = Star(setting)
    yield f"simulated: {setting.words()}"
    sweeps = []
    for method in METHODS:
        sweeps.append(sweep(method, star.problem, setting.per_decade, star.truth[0].values[0]))
        low, high = useful(sweeps[-1])
        yield f"{method.label}: within {WITHIN_DB:g} dB of the best for weights {low:.3g} .. {high:.3g}"
    title = "Fig. S1: maximum entropy by weight"
    groups = [_panels(star, found) for found in sweeps]
    curves = tuple(Curve(s.label, s.weights, s.scores, "o-") for s in sweeps)
    plot = Plot("PSNR by weight", curves, "weight, dimensionless", "PSNR, dB", "x")
    figure = sheet(groups, [plot], title, setting.words())
    yield Outcome("figS1", title, figure, tuple(_beside(sweeps)), _table(sweeps))


def useful(found: Sweep) -> tuple[float, float]:
    """Return the least and the largest weight whose PSNR is within `WITHIN_DB` of the best."""
    good = [w for w, db in zip(found.weights, found.scores, strict=True) if db >= max(found.scores) - WITHIN_DB]
    return min(good), max(good)


def _panels(star: Star, found: Sweep) -> list[Panel]:
    """Return four images across the range."""
    chosen = [round(i * (len(found.ends) - 1) / 3) for i in range(4)]
    return [
        Panel(
            f"{found.label}, weight {found.weights[i]:.2g}",
            replace(star.truth[0], values=found.ends[i].image),
            (f"PSNR {found.scores[i]:.2f} dB", f"gap {found.ends[i].relative_gap:.1e}"),
        )
        for i in chosen
    ]


def _table(sweeps: Sequence[Sweep]) -> tuple[Sequence[str], ...]:
    heading = ("prior", "weight", "PSNR, dB", "residual norm", "relative gap", "products")
    rows = [
        (s.label, f"{w:.3g}", f"{db:.2f}", f"{e.residual_norm:.3g}", f"{e.relative_gap:.1e}", f"{e.products}")
        for s in sweeps
        for w, db, e in zip(s.weights, s.scores, s.ends, strict=True)
    ]
    return (heading, *rows)


def _beside(sweeps: Sequence[Sweep]) -> Iterator[Beside]:
    for found in sweeps:
        low, high = useful(found)
        yield Beside(
            f"range of useful weights, {found.label}",
            "1 .. 10,000, a factor of 10,000",
            f"{low:.3g} .. {high:.3g}, a factor of {high / low:.3g}",
            f"ours are dimensionless and the criterion is PSNR within {WITHIN_DB:g} dB of the best; the paper's scale "
            "and criterion are not stated",
        )
