r"""Speed of sound by focus: the one that gives the sharpest image, after [Treeby2011]_ (see `oatkit.focus_metrics`).

The image is the back-projection A^T b of the pipeline's own forward model: one product for each speed that is tried. A
speed that is wrong by dc shifts each wave front by

.. math:: R \, \frac{dc}{c}, \qquad R \text{ the distance of the detectors,}

so the sweep goes in steps of half a pixel of that shift, and then more finely about the maximum. One speed holds for
water and body together, and a start time that is wrong by dt moves the pick by c^2 dt / R.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from oatkit.content import ByContent, check_range, frozen
from oatkit.data import Geometry, Grid, Scan
from oatkit.errors import ValidationError
from oatkit.events import Listener, StepStarted, ignore
from oatkit.focus_metrics import METRICS, TRUSTED
from oatkit.memo import Memo
from oatkit.names import did_you_mean
from oatkit.pipeline import Pipeline
from oatkit.reconstruction import preprocess, problems, raw_key, strongest

SOFT_TISSUE_M_S = (1400.0, 1600.0)
"""Speeds of sound of soft tissue by [Treeby2011]_, tried unless others are given or the file's is not among them."""

AROUND_M_S = 100.0
"""How far to either side of a file's speed that is outside of `SOFT_TISSUE_M_S`."""

STEP_PIXELS = 0.5
"""Coarse steps, as a shift of the wave fronts. The peak of sharp phantoms is two pixels wide from foot to foot."""

FINER = 4
"""Fine steps in a coarse one."""

DISAGREEMENT_M_S = 10.0
"""Difference from the pick that is worth a note."""

FLAT = 0.05
"""A maximum less than this share above the median of its curve is worth a note.

By variance and over 1400 .. 1600 m/s, `benchmarks/focus.py` finds 0.006 for noise, 0.10 for a real mouse and 0.30
and more for phantoms at 10 dB."""

RIVAL = 0.8
"""Another maximum that rises at least this far from the median to the pick is worth a note."""


@dataclass(frozen=True, eq=False)
class Focus(ByContent):
    """A speed of sound picked by the sharpness of the image, and all that was seen on the way."""

    speeds_m_s: tuple[float, ...]
    """All that were tried, rising: coarse over the whole range, fine about the maximum of `metric`."""
    scores: Mapping[str, tuple[float, ...]]
    """By metric, one for each speed; see `oatkit.focus_metrics`."""
    picks: Mapping[str, float]
    """By metric: the top of the parabola through the best speed and its neighbours, to 0.1 m/s."""
    metric: str
    header_m_s: float
    """What the scan says."""
    header_source: str
    """Where the scan has it from."""
    notes: tuple[str, ...] = ()
    """What to know before trusting the pick."""

    @property
    def speed_m_s(self) -> float:
        """The pick of the chosen metric."""
        return self.picks[self.metric]

    def apply(self, pipeline: Pipeline) -> Pipeline:
        """Return the same pipeline with the picked speed of sound."""
        table = pipeline.scan.model_copy(update={"speed_of_sound_m_s": self.speed_m_s})
        return pipeline.model_copy(update={"scan": table})

    def table(self) -> dict[str, Any]:
        """Return everything as plain values, for a result's record."""
        return {
            "speed_m_s": self.speed_m_s,
            "metric": self.metric,
            "header_m_s": self.header_m_s,
            "header_source": self.header_source,
            "picks": dict(self.picks),
            "speeds_m_s": list(self.speeds_m_s),
            "scores": {name: list(scores) for name, scores in self.scores.items()},
            "notes": list(self.notes),
        }


def focus(
    pipeline: Pipeline,
    scan: Scan,
    *,
    speeds_m_s: tuple[float, float] | None = None,
    frame: int = 0,
    metric: str = "variance",
    memo: Memo | None = None,
    on_event: Listener = ignore,
) -> Focus:
    """Reconstruct one frame at many speeds of sound and pick the sharpest image.

    `speeds_m_s` is the range ``(lowest, highest)``, `metric` a name in `oatkit.focus_metrics.METRICS`; all metrics are
    kept, `metric` decides. The frame is preprocessed once, so all images come from the same data: those of its
    wavelength with the largest signals. `on_event` is told of each speed. Raises `ValidationError` for an unknown
    metric, a range that is none, and data that are zero.
    """
    if metric not in METRICS:
        raise ValidationError(f"focus: no metric named '{metric}'{did_you_mean(metric, METRICS)}")
    memo = Memo() if memo is None else memo
    low, high = _range(scan, speeds_m_s)
    key = ("focus", *raw_key(pipeline, scan, frame), pipeline.grid, pipeline.forward, low, high, metric)
    table = memo.peek(key)
    if table is None:
        clean = strongest(preprocess(pipeline, scan, frame, memo))
        if not clean.signals[clean.valid].any():
            raise ValidationError("focus: the data are zero, so that no speed of sound gives a sharp image")
        table = _sweep(pipeline, clean, _coarse(clean.geometry, pipeline.grid.grid(), low, high), metric, on_event)
        memo.put(key, table, 100 * len(table) * len(METRICS))
    return _read(table, metric, scan)


def shift_per_speed(geometry: Geometry, grid: Grid) -> float:
    """Return by how much a speed of sound that is 1 m/s too high shifts a wave front from the middle of the grid, m."""
    distance = np.linalg.norm(geometry.detectors.positions_m - np.asarray(grid.centre_m), axis=1).mean()
    return float(distance) / geometry.speed_of_sound_m_s


def _range(scan: Scan, speeds_m_s: tuple[float, float] | None) -> tuple[float, float]:
    header = scan.geometry.speed_of_sound_m_s
    if speeds_m_s is None:
        low, high = SOFT_TISSUE_M_S
        if not low <= header <= high:
            low, high = max(300.0, header - AROUND_M_S), min(7000.0, header + AROUND_M_S)
        return low, high
    if len(speeds_m_s) != 2 or not speeds_m_s[0] < speeds_m_s[1]:
        raise ValidationError(f"focus: expected a range (lowest, highest) of speeds of sound in m/s, got {speeds_m_s}")
    check_range("focus: speeds_m_s", speeds_m_s, 300, 7000, "the unit is m/s; water has about 1500")
    return float(speeds_m_s[0]), float(speeds_m_s[1])


def _coarse(geometry: Geometry, grid: Grid, low: float, high: float) -> tuple[float, ...]:
    step = STEP_PIXELS * grid.pixel_size_m / shift_per_speed(geometry, grid)
    return tuple(float(c) for c in np.linspace(low, high, max(5, ceil((high - low) / step) + 1)))


def _sweep(
    pipeline: Pipeline, clean: Scan, coarse: Sequence[float], metric: str, on_event: Listener
) -> dict[float, dict[str, float]]:
    """Return the scores by speed: of the coarse speeds, then of fine ones about the best of them."""

    def scores(speed: float) -> dict[str, float]:
        on_event(StepStarted(f"speed of sound by focus, {speed:.1f} m/s"))
        at_speed = clean.with_speed_of_sound(speed, "focus")
        # A memo of its own, so that the operator which the caller's memo keeps stays there.
        _, problem = next(problems(pipeline, at_speed, pipeline.grid.grid(), Memo()))
        return {name: score(problem.back_projected) for name, score in METRICS.items()}

    table = {speed: scores(speed) for speed in coarse}
    best = max(coarse, key=lambda speed: table[speed][metric])
    step = (coarse[1] - coarse[0]) / FINER
    fine = (best + k * step for k in range(1 - FINER, FINER) if k)
    return table | {speed: scores(speed) for speed in fine if coarse[0] < speed < coarse[-1]}


def _read(table: Mapping[float, Mapping[str, float]], metric: str, scan: Scan) -> Focus:
    """Return what the scores say."""
    speeds = tuple(sorted(table))
    curves = {name: tuple(table[speed][name] for speed in speeds) for name in METRICS}
    picks = {name: round(peak_of(speeds, curve), 1) for name, curve in curves.items()}
    header = scan.geometry.speed_of_sound_m_s
    about = f"speed of sound {picks[metric]:.1f} m/s by focus ({metric})"
    found = [*_doubts(speeds, curves[metric]), *_disagreements(picks, metric, header, scan.speed_of_sound_source)]
    notes = tuple(f"{about}: {doubt}" for doubt in found)
    return Focus(speeds, frozen(curves), frozen(picks), metric, header, scan.speed_of_sound_source, notes)


def peak_of(speeds: Sequence[float], curve: Sequence[float]) -> float:
    """Return where the parabola through the best point and its neighbours is highest; the end of the range as it is.

    >>> peak_of([0.0, 1.0, 3.0], [0.0, 8.0, 0.0])
    1.5
    """
    best = int(np.argmax(curve))
    if best in (0, len(curve) - 1):
        return speeds[best]
    before, after = speeds[best] - speeds[best - 1], speeds[best + 1] - speeds[best]
    rise, fall = (curve[best] - curve[best - 1]) / before, (curve[best] - curve[best + 1]) / after
    if not rise + fall > 0:
        return speeds[best]
    return speeds[best] + (rise * after - fall * before) / (2 * (rise + fall))


def _doubts(speeds: Sequence[float], curve: Sequence[float]) -> Iterator[str]:
    """Yield a sentence for each reason in the curve to doubt its maximum."""
    best, median = int(np.argmax(curve)), float(np.median(curve))
    if best in (0, len(curve) - 1):
        yield f"the end of the range {speeds[0]:g} .. {speeds[-1]:g} m/s that was tried; a better one may lie beyond"
    if not curve[best] > (1 + FLAT) * median:
        yield "the curve is flat; noise, a smooth body or too narrow a range decides where its maximum is"
    rivals = _rivals(speeds, curve, median)
    if rivals:
        yield f"the image is nearly as sharp at {', '.join(f'{speed:.0f}' for speed in rivals[:5])} m/s"


def _rivals(speeds: Sequence[float], curve: Sequence[float], median: float) -> list[float]:
    """Return where other maxima rise nearly as far above the median as the best one, the highest first."""
    best, step = int(np.argmax(curve)), float(np.max(np.diff(speeds)))
    level = median + RIVAL * (curve[best] - median)
    tops = [
        i
        for i in range(1, len(curve) - 1)
        if curve[i] > max(curve[i - 1], level) and curve[i] >= curve[i + 1] and abs(speeds[i] - speeds[best]) > 2 * step
    ]
    return [speeds[i] for i in sorted(tops, key=lambda i: -curve[i])]


def _disagreements(picks: Mapping[str, float], metric: str, header: float, source: str) -> Iterator[str]:
    """Yield a sentence on the metrics, and one on the scan, that say something else."""
    far = [
        f"{name} {pick:.1f}"
        for name, pick in picks.items()
        if name in TRUSTED and abs(pick - picks[metric]) > DISAGREEMENT_M_S
    ]
    if far:
        yield f"other metrics differ by more than {DISAGREEMENT_M_S:g} m/s ({', '.join(far)})"
    if abs(header - picks[metric]) > DISAGREEMENT_M_S:
        yield f"the scan says {header:.1f} m/s ({source}); a wrong start time or array radius has the same effect"
