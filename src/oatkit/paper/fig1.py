"""Fig. 1: a breast-like body in diffuse light, reconstructed by least squares and by maximum entropy."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from oatkit.drawing.plot import Curve, Mark, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.metrics import negative_pixels, psnr, rmse, ssim
from oatkit.paper.methods import L1, L2, L2_THRESHOLD, MAXENT, MAXENT_FLAT, NNLS, TV
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import lit, pipeline_for, problem_of, scan_of
from oatkit.paper.sweep import Sweep, sweep
from oatkit.simulate import breast_body

SETTING = Setting(pixels=256, fine_pixels=512)
"""The paper's two grids."""
METHODS = (L2, NNLS, MAXENT, MAXENT_FLAT, L1, TV)
PAPER_PSNR = {"L2": 29.9736, "L2, thresholded": 30.2616, "MaxEnt": 30.3529}
PAPER_RMSE = {"L2": 0.0453, "L2, thresholded": 0.0451, "MaxEnt": 0.0450}
PAPER_NEGATIVE = 4370
ANOTHER = "another body: the paper's phantom, from a patient's MRI, is not public"
RMSE_OF = f"{ANOTHER}; its maximum is not stated, and the paper's PSNR and RMSE imply three different ones"
LEVEL = f"{ANOTHER}; the body decides the level, so compare differences between methods"


def fig1(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    body = breast_body()
    pressure, fluence = lit(body, setting.grid)
    inside = body.boundary(setting.grid).values[0] < 0
    scan = scan_of(lambda grid: lit(body, grid)[0], setting)
    yield f"simulated: {setting.words()}"
    problem = problem_of(pipeline_for("lsqr", setting), scan)
    sweeps: dict[str, Sweep] = {}
    for method in METHODS:
        found = sweep(method, problem, setting.per_decade, pressure.values[0])
        sweeps[method.label] = found
        if method is L2:
            sweeps[L2_THRESHOLD.label] = found.thresholded(L2_THRESHOLD.label)
        yield _line(found)
    images = [(s.label, replace(pressure, values=s.ends[s.best].image), _scores(s, inside)) for s in sweeps.values()]
    panels = [
        [Panel("absorption", body.absorption(setting.grid), ("mu_a of the phantom",))],
        [Panel("fluence", fluence, ("diffusion, mu_a 0.2 and mu_s' 12 per cm",))],
        [Panel("initial pressure", pressure, ("the truth",)), *(Panel(n, i, lines) for n, i, lines in images)],
    ]
    title = "Fig. 1: a breast-like body, each method at its best weight"
    figure = sheet(panels, [_psnr_plot(list(sweeps.values()))], title, setting.words())
    yield Outcome("fig1", title, figure, tuple(_beside(sweeps, inside)), _table(sweeps, inside), tuple(_notes(sweeps)))


def _line(found: Sweep) -> str:
    best, corner = found.best, found.corner
    return (
        f"{found.label}: {found.scores[best]:.2f} dB at its best weight {found.weights[best]:.3g}, "
        f"{found.scores[corner]:.2f} dB at the L-curve's {found.weights[corner]:.3g}"
    )


def _scores(found: Sweep, inside: np.ndarray) -> tuple[str, ...]:
    image, truth = found.ends[found.best].image, found.truth
    return (
        f"PSNR {psnr(image, truth):.2f} dB, SSIM {ssim(image, truth):.3f}",
        f"RMSE {rmse(image, truth):.4f}",
        f"{negative_pixels(image, inside).count:,} negative pixels in the body",
        f"weight {found.weights[found.best]:.3g} (best), by L-curve {found.weights[found.corner]:.3g}",
    )


def _table(sweeps: dict[str, Sweep], inside: np.ndarray) -> tuple[Sequence[str], ...]:
    heading = (
        "method", "PSNR, dB", "RMSE", "SSIM", "negative pixels in the body", "best weight", "by L-curve: weight",
        "PSNR, dB", "lost, dB",
    )  # fmt: skip
    return (heading, *(_row(found, inside) for found in sweeps.values()))


def _row(found: Sweep, inside: np.ndarray) -> Sequence[str]:
    image, best, corner = found.ends[found.best].image, found.best, found.corner
    return (
        found.label,
        f"{found.scores[best]:.2f}",
        f"{rmse(image, found.truth):.4f}",
        f"{ssim(image, found.truth):.3f}",
        f"{negative_pixels(image, inside).count:,}",
        f"{found.weights[best]:.3g}",
        f"{found.weights[corner]:.3g}",
        f"{found.scores[corner]:.2f}",
        f"{found.scores[best] - found.scores[corner]:.2f}",
    )


def _beside(sweeps: dict[str, Sweep], inside: np.ndarray) -> Iterator[Beside]:
    ours = {"L2": sweeps[L2.label], "L2, thresholded": sweeps[L2_THRESHOLD.label], "MaxEnt": sweeps[MAXENT.label]}
    for name, found in ours.items():
        yield Beside(f"PSNR of {name}", f"{PAPER_PSNR[name]:.2f} dB", f"{found.scores[found.best]:.2f} dB", LEVEL)
    for name, found in ours.items():
        error = rmse(found.ends[found.best].image, found.truth) / found.truth.max()
        yield Beside(f"RMSE of {name}", f"{PAPER_RMSE[name]:.4f}", f"{error:.4f} of the maximum", RMSE_OF)
    gain = ours["MaxEnt"].scores[ours["MaxEnt"].best] - ours["L2, thresholded"].scores[ours["L2, thresholded"].best]
    yield Beside(
        "MaxEnt minus thresholded L2",
        f"{PAPER_PSNR['MaxEnt'] - PAPER_PSNR['L2, thresholded']:+.2f} dB",
        f"{gain:+.2f} dB",
        "both at their best weight here; the paper's weights are the L-curve's, on scales that it does not state",
    )
    best, weakest = (negative_pixels(ours["L2"].ends[i].image, inside).count for i in (ours["L2"].best, 0))
    yield Beside(
        "negative pixels of L2 in the body",
        f"{PAPER_NEGATIVE:,}",
        f"{best:,} at the best weight, {weakest:,} at {ours['L2'].weights[0]:.0e}",
        "it depends on the weight and on the number of steps more than on the method",
    )


def _notes(sweeps: dict[str, Sweep]) -> Iterator[str]:
    reference = sweeps[L2_THRESHOLD.label]
    for method in (MAXENT, MAXENT_FLAT):
        found = sweeps[method.label]
        distance = found.scores[found.best] - reference.scores[reference.best]
        yield f"{found.label} is {distance:+.2f} dB from thresholded L2, each at its best weight."
    ends = [s.label for s in sweeps.values() if s.best in (0, len(s.weights) - 1)]
    if ends:
        yield f"The best weight is at the end of the range that was tried for: {', '.join(ends)}."
    losses = {s.label: s.scores[s.best] - s.scores[s.corner] for s in sweeps.values()}
    missed = [f"{label} by {loss:.1f} dB" for label, loss in losses.items() if loss > 1.5]
    yield "The L-curve's weight misses the best by more than 1.5 dB for: " + (", ".join(missed) or "none") + "."


def _psnr_plot(sweeps: Sequence[Sweep]) -> Plot:
    curves = tuple(Curve(s.label, s.weights, s.scores, "o-") for s in sweeps)
    marks = tuple(Mark(s.weights[s.corner], s.scores[s.corner], "") for s in sweeps)
    return Plot("PSNR by weight (diamond: the L-curve's)", curves, "weight, dimensionless", "PSNR, dB", "x", marks)
