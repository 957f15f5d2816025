"""Rules in a pipeline: words that stand for numbers, replaced once for a scan, before anything is reconstructed."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from oatkit import weights
from oatkit.api import Solver
from oatkit.data import Scan
from oatkit.engine.calibrating import asks_for_calibration, calibrate, calibrated
from oatkit.events import Listener, StepStarted, ignore
from oatkit.focus import Focus, focus
from oatkit.memo import Memo
from oatkit.motion import Motion, find_motion
from oatkit.pipeline import Pipeline
from oatkit.problem import Calibration
from oatkit.reconstruction import preprocess, problems, raw_key, strongest

BYTES_OF_POINT = 500
"""Of the curve of a choice in a memo, about."""


@dataclass(frozen=True)
class Resolved:
    """A pipeline that is ready to run, and what it was made from."""

    pipeline: Pipeline
    """With numbers in place of rules."""
    requested: Pipeline
    weight: weights.Choice | None = None
    """How the weight was chosen; None where it was given as a number."""
    speed: Focus | None = None
    """How the speed of sound was chosen; None where it was not by focus."""
    calibration: Calibration | None = None
    """How the calibration was found; None where nobody asked."""
    motion: Motion | None = None
    """Which pulses are out of place; None where nobody asked."""
    left_out: tuple[int, ...] = ()
    """Frames of the scan that are not run, since they are out of place."""
    known: Mapping[str, Mapping[str, Any]] | None = None
    """The `choices`, where they were made by an earlier run."""

    @cached_property
    def choices(self) -> Mapping[str, Mapping[str, Any]]:
        """How each number was chosen, as plain values, by its field in a `Result`; empty tables where none was."""
        found = {"speed_choice": self.speed, "weight_choice": self.weight, "calibration_choice": self.calibration}
        return self.known or {name: choice.table() if choice else {} for name, choice in found.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know before trusting the choices."""
        chosen = [note for choice in self.choices.values() for note in choice.get("notes", ())]
        moved = self.motion.notes if self.motion else ()
        left_out = (f"left out: frames {', '.join(map(str, self.left_out))} (motion)",) if self.left_out else ()
        return (*chosen, *moved, *left_out)

    def notes_on(self, frame: int) -> tuple[str, ...]:
        """What to know of one frame of the scan."""
        return self.motion.of_frame(frame) if self.motion else ()


def resolve(
    pipeline: Pipeline, scan: Scan, memo: Memo | None = None, on_event: Listener = ignore, frame: int = 0
) -> Resolved:
    """Return the pipeline with its speed of sound, its weight and its calibration chosen, and how they were chosen.

    Each rule runs on the scan's first frame, whatever part of the scan is asked for, or on `frame` where
    ``scan.rules = "frame"`` asks for it; in this order, since each depends on those before; the first two on its
    strongest wavelength (the one of the largest signals). Numbers are left alone.
    """
    frame = frame_of_rules(pipeline, frame)
    memo = Memo() if memo is None else memo
    motion = motion_in(pipeline, scan, memo, on_event)
    ready, speed = with_speed(pipeline, scan, frame, memo, on_event)
    weight, calibration = None, None
    if isinstance(getattr(pipeline.reconstruct, "weight", None), str):
        ready, weight = _weighted(ready, scan, frame, memo, on_event)
    if asks_for_calibration(ready):
        calibration = calibrate(ready, scan, frame, memo, on_event)
        ready = calibrated(ready, calibration)
    return Resolved(ready, pipeline, weight, speed, calibration, motion)


def frame_of_rules(pipeline: Pipeline, frame: int) -> int:
    """Return which frame the rules look at where `frame` is to be run."""
    return frame if pipeline.scan.rules == "frame" else 0


def with_speed(
    pipeline: Pipeline, scan: Scan, frame: int, memo: Memo, on_event: Listener = ignore
) -> tuple[Pipeline, Focus | None]:
    """Return the pipeline with its speed of sound chosen on a frame, and how; None where it was no rule."""
    if pipeline.scan.speed_of_sound_m_s != "focus":
        return pipeline, None
    speed = focus(pipeline, scan, frame=frame, memo=memo, on_event=on_event)
    return speed.apply(pipeline), speed


def remember_choice(choice: weights.Choice, pipeline: Pipeline, scan: Scan, frame: int, memo: Memo) -> None:
    """Let `resolve` find what the rule of a choice gave on the strongest wavelength of a frame.

    The pipeline is one that `with_speed` returned; its weight may be any.
    """
    solver = pipeline.reconstruct.model_copy(update={"weight": choice.rule})
    memo.put(_choice_key(pipeline, scan, frame, solver), choice, BYTES_OF_POINT * len(choice.curve))


def _choice_key(pipeline: Pipeline, scan: Scan, frame: int, solver: Solver) -> tuple[Any, ...]:
    return ("weight", *raw_key(pipeline, scan, frame), pipeline.grid, pipeline.forward, solver)


def _weighted(
    pipeline: Pipeline, scan: Scan, frame: int, memo: Memo, on_event: Listener
) -> tuple[Pipeline, weights.Choice]:
    """Return the pipeline with its weight chosen, and how; a choice that is known is not made again."""
    solver = pipeline.reconstruct
    choice = memo.peek(_choice_key(pipeline, scan, frame, solver))
    if choice is None:
        on_event(StepStarted(weights.CHOOSING))
        clean = strongest(preprocess(pipeline, scan, frame, memo))
        _, problem = next(problems(pipeline, clean, pipeline.grid.grid(), memo))
        choice = weights.choose(solver, problem, getattr(solver, "weight", ""), on_event=on_event)
        remember_choice(choice, pipeline, scan, frame, memo)
    return pipeline.with_solver(weights.with_weight(solver, choice.weight)), choice


def motion_in(pipeline: Pipeline, scan: Scan, memo: Memo, on_event: Listener = ignore) -> Motion | None:
    """Return which pulses of the whole scan are out of place, where the pipeline has a table ``[motion]``."""
    settings = pipeline.motion
    if settings is None:
        return None

    def find() -> Motion:
        on_event(StepStarted("looking for motion"))
        return find_motion(pipeline.scan.apply(scan), settings, pipeline.grid.grid())

    key = ("motion", scan.fingerprint, pipeline.scan, settings, pipeline.grid)
    return memo.get(key, find, lambda found: 3 * found.correlation.nbytes)
