"""What the paper could not do: every installed solver on five bodies, five seeds of the noise, few data, much noise."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from oatkit.api import Problem
from oatkit.data import Grid, Image
from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import sheet
from oatkit.errors import OatkitError
from oatkit.metrics import negative_pixels, psnr, ssim
from oatkit.paper.methods import L1, L2, L2_THRESHOLD, MAXENT, MAXENT_FLAT, NNLS, TV, Method
from oatkit.paper.outcome import Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import Pressure, lit, pipeline_for, problem_of, scan_of
from oatkit.registry import installed
from oatkit.simulate import Body, breast_body, disc_body, mouse_body, star_body, vessel
from oatkit.weights import with_weight

SETTING = Setting(pixels=128, fine_pixels=311, per_decade=1)
CONDITIONS: Mapping[str, Mapping[str, float]] = {
    "270°, 256 detectors, 32 dB": {},
    "145°": {"coverage_deg": 145.0},
    "90°": {"coverage_deg": 90.0},
    "a quarter of the detectors": {"detectors": 64},
    "20 dB": {"snr_db": 20.0},
    "10 dB": {"snr_db": 10.0},
}
"""What is changed against the first one."""
TUNING_SEED = 100
"""Of the noise, and of the bodies that are drawn by a seed, to tune weights on; no row of the table has it."""
KNOWN = (L2, L2_THRESHOLD, NNLS, MAXENT, MAXENT_FLAT, L1, TV)


NOTES = (
    "Each weight is the one of the highest mean PSNR on other draws of the bodies (where they are drawn) and of the "
    "noise: what a careful user could reach, not the best for each image. The spread is the standard deviation over "
    'bodies and seeds, most of it between bodies; so compare methods by the column "best of all", too.',
)


@dataclass(frozen=True)
class Score:
    """One image against the truth."""

    psnr: float
    ssim: float
    negative: float
    """Share of all pixels."""


Scores = dict[tuple[str, str], list[Score]]
"""By condition and method."""
Tuned = dict[tuple[str, str], float | None]
"""Weights, likewise; None for a solver without one."""


def ranking(
    setting: Setting = SETTING, conditions: Mapping[str, Mapping[str, float]] = CONDITIONS
) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    methods = all_methods()
    yield f"{len(methods)} methods, {len(conditions)} conditions; {setting.words()}"
    scores: Scores = {}
    tuned: Tuned = {}
    for condition, changes in conditions.items():
        here = replace(setting, **changes)  # type: ignore[arg-type]
        tuned |= {(condition, name): weight for name, weight in _tuned(methods, here).items()}
        for (body, phantom), seed in product(_phantoms(setting.bodies, 0).items(), range(setting.seeds)):
            problem, truth = _posed(phantom, replace(here, seed=seed))
            for method in methods:
                score = _score(method, tuned[condition, method.label], problem, truth)
                scores.setdefault((condition, method.label), []).append(score)
            yield f"{condition}: {body}, seed {seed}"
    title = "Every installed solver: five bodies, five seeds of the noise"
    figure = sheet((), [_plot(scores, conditions, methods)], title, setting.words())
    yield Outcome("ranking", title, figure, (), _table(scores, tuned, conditions, methods), NOTES)


def all_methods() -> tuple[Method, ...]:
    """Return the methods of the paper's figures and, with its defaults, every other solver that is installed."""
    others = [cls.name for cls in installed().of_kind("solver") if cls.name not in {m.use for m in KNOWN}]
    return (*KNOWN, *(Method(name, name) for name in others))


def _phantoms(names: Sequence[str], seed: int) -> Mapping[str, Pressure]:
    bodies = (breast_body(seed), star_body(), disc_body(), mouse_body(seed))
    made: dict[str, Pressure] = {body.name: partial(_pressure, body) for body in bodies} | {"vessel": vessel}
    return {name: made[name] for name in names}


def _pressure(body: Body, grid: Grid) -> Image:
    return lit(body, grid)[0]


def _posed(phantom: Pressure, setting: Setting) -> tuple[Problem, np.ndarray]:
    """Return the problem and the truth of a phantom."""
    problem = problem_of(pipeline_for("lsqr", setting), scan_of(phantom, setting))
    return problem, phantom(setting.grid).values[0]


def _tuned(methods: Sequence[Method], setting: Setting) -> Mapping[str, float | None]:
    """Return for each method the weight of the highest mean PSNR over bodies and noise that the table does not use."""
    totals: dict[tuple[str, float], float] = {}
    for phantom in _phantoms(setting.bodies, TUNING_SEED).values():
        problem, truth = _posed(phantom, replace(setting, seed=TUNING_SEED))
        for method in methods:
            for weight in _candidates(method, setting):
                score = _score(method, weight, problem, truth).psnr
                totals[method.label, weight] = totals.get((method.label, weight), 0.0) + score
    return {m.label: max(_candidates(m, setting), key=lambda w: totals[m.label, w], default=None) for m in methods}


def _candidates(method: Method, setting: Setting) -> tuple[float, ...]:
    """Return the weights to try; none for a solver without one."""
    weighted = "weight" in type(method.solver()).model_fields
    return method.weights(setting.per_decade) if weighted else ()


def _score(method: Method, weight: float | None, problem: Problem, truth: np.ndarray) -> Score:
    """Solve and compare; a solver that fails scores NaN, so that others' plugins cannot end a long run."""
    solver = method.solver() if weight is None else with_weight(method.solver(), weight)
    try:
        image = solver.solve(problem).image
    except OatkitError:
        return Score(float("nan"), float("nan"), float("nan"))
    return Score(psnr(image, truth), ssim(image, truth), negative_pixels(image).share)


def _table(
    scores: Scores, tuned: Tuned, conditions: Iterable[str], methods: Sequence[Method]
) -> tuple[Sequence[str], ...]:
    heading = ("condition", "method", "weight", "PSNR, dB", "best of all", "SSIM", "negative pixels")
    rows = []
    for condition in conditions:
        winners = np.nanargmax([[s.psnr for s in scores[condition, m.label]] for m in methods], axis=0)
        for index, method in enumerate(methods):
            found, weight = scores[condition, method.label], tuned[condition, method.label]
            values = [score.psnr for score in found]
            rows.append(
                (
                    condition,
                    method.label,
                    "-" if weight is None else f"{weight:.3g}",
                    f"{np.mean(values):.1f} ± {np.std(values):.1f}",
                    f"{(winners == index).sum()} of {len(values)}",
                    f"{np.mean([score.ssim for score in found]):.3f}",
                    f"{100 * np.mean([score.negative for score in found]):.1f} %",
                )
            )
    return (heading, *rows)


def _plot(scores: Scores, conditions: Collection[str], methods: Sequence[Method]) -> Plot:
    curves = tuple(
        Curve(
            m.label,
            range(len(conditions)),
            [float(np.mean([s.psnr for s in scores[c, m.label]])) for c in conditions],
            "o",
        )
        for m in methods
    )
    names = tuple(name.replace(" ", "\n", 1) for name in conditions)
    return Plot("mean PSNR over bodies and seeds", curves, "", "PSNR, dB", names=names)
