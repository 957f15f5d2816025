"""Fig. S2: L1 penalties, with and without x >= 0, beside least squares and maximum entropy, on printed vessels."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.metrics import negative_pixels, ssim
from oatkit.paper.methods import L1, L2, MAXENT, TV, Method
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import pipeline_for, problem_of, scan_of
from oatkit.paper.sweep import Sweep, sweep
from oatkit.simulate import vessel

METHODS = (
    L2,
    Method("L1, signed", "l1", L1.range, {"non_negative": False}),
    L1,
    TV,
    MAXENT,
)

SETTING = Setting()


def figS2(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    truth = vessel(setting.grid)
    problem = problem_of(pipeline_for("lsqr", setting), scan_of(vessel, setting))
    yield f"simulated: {setting.words()}"
    sweeps = []
    for method in METHODS:
        sweeps.append(sweep(method, problem, setting.per_decade, truth.values[0]))
        yield f"{method.label}: {sweeps[-1].scores[sweeps[-1].best]:.2f} dB at its best weight"
    title = "Fig. S2: L1 beside least squares and maximum entropy, each at its best weight"
    panels = [Panel("truth", truth)]
    for found in sweeps:
        image = found.ends[found.best].image
        lines = (f"PSNR {found.scores[found.best]:.2f} dB", f"{negative_pixels(image).count:,} negative pixels")
        panels.append(Panel(found.label, replace(truth, values=image), lines))
    curves = tuple(Curve(s.label, s.weights, s.scores, "o-") for s in sweeps)
    plot = Plot("PSNR by weight", curves, "weight, dimensionless", "PSNR, dB", "x")
    figure = sheet([panels], [plot], title, setting.words())
    yield Outcome("figS2", title, figure, tuple(_beside(sweeps)), _table(sweeps))


def _table(sweeps: Sequence[Sweep]) -> tuple[Sequence[str], ...]:
    heading = ("method", "best weight", "PSNR, dB", "SSIM", "negative pixels")
    rows = []
    for found in sweeps:
        image = found.ends[found.best].image
        rows.append(
            (
                found.label,
                f"{found.weights[found.best]:.3g}",
                f"{found.scores[found.best]:.2f}",
                f"{ssim(image, found.truth):.3f}",
                f"{negative_pixels(image).count:,}",
            )
        )
    return (heading, *rows)


def _beside(sweeps: Sequence[Sweep]) -> Iterator[Beside]:
    counts = {s.label: negative_pixels(s.ends[s.best].image).count for s in sweeps}
    yield Beside(
        "negative pixels of L1 over those of L2",
        "similar (shown, no number)",
        f"{counts['L1, signed'] / max(counts['L2'], 1):.2f}",
        "retinal vessels of scikit-image's picture here; the paper's print is not public",
    )
    yield Beside(
        "negative pixels of L1 with x ≥ 0",
        "the constraint is by thresholding",
        f"{counts['L1, x ≥ 0']:,}",
        "here the constraint is part of the problem that is solved",
    )
