"""The sweep over speeds of sound: coarse over the whole range, fine about the sharpest image."""

from collections.abc import Mapping, Sequence
from math import ceil

import numpy as np

from oatkit.content import check_range, frozen
from oatkit.data import Geometry, Grid, Scan
from oatkit.errors import ValidationError
from oatkit.events import Listener, StepStarted, ignore
from oatkit.focus.choice import Focus
from oatkit.focus.metrics import METRICS
from oatkit.focus.peak import disagreements, doubts, peak_of
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

    `speeds_m_s` is the range ``(lowest, highest)``, `metric` a name in `oatkit.focus.metrics.METRICS`; all metrics are
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
    found = [*doubts(speeds, curves[metric]), *disagreements(picks, metric, header, scan.speed_of_sound_source)]
    notes = tuple(f"{about}: {doubt}" for doubt in found)
    return Focus(speeds, frozen(curves), frozen(picks), metric, header, scan.speed_of_sound_source, notes)
