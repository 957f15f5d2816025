"""Rules in a pipeline: words that stand for numbers, replaced once for a scan, before anything is reconstructed."""

from dataclasses import dataclass

from oatkit import weights
from oatkit.blame import blame
from oatkit.calibrating import asks_for_calibration, calibrate, calibrated
from oatkit.data import Scan
from oatkit.events import Listener, StepStarted, ignore
from oatkit.focus import Focus, focus
from oatkit.memo import Memo
from oatkit.motion import Motion, find_motion
from oatkit.pipeline import Pipeline
from oatkit.problem import Calibration
from oatkit.reconstruction import preprocess, problems, strongest


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

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know before trusting the choices."""
        found = (self.speed, self.weight, self.calibration, self.motion)
        left_out = (f"left out: frames {', '.join(map(str, self.left_out))} (motion)",) if self.left_out else ()
        return (*(note for part in found if part for note in part.notes), *left_out)

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
    frame = frame if pipeline.scan.rules == "frame" else 0
    memo = Memo() if memo is None else memo
    motion = motion_in(pipeline, scan, memo, on_event)
    speed = None
    ready = pipeline
    if pipeline.scan.speed_of_sound_m_s == "focus":
        speed = focus(pipeline, scan, frame=frame, memo=memo, on_event=on_event)
        ready = speed.apply(pipeline)
    weight, calibration = None, None
    if isinstance(getattr(pipeline.reconstruct, "weight", None), str):
        ready, weight = _weighted(ready, scan, frame, memo, on_event)
    if asks_for_calibration(ready):
        calibration = calibrate(ready, scan, frame, memo, on_event)
        ready = calibrated(ready, calibration)
    return Resolved(ready, pipeline, weight, speed, calibration, motion)


def _weighted(
    pipeline: Pipeline, scan: Scan, frame: int, memo: Memo, on_event: Listener
) -> tuple[Pipeline, weights.Choice | None]:
    """Return the pipeline with its weight chosen, and how."""
    on_event(StepStarted("choosing the weight"))
    clean = strongest(preprocess(pipeline, scan, frame, memo))
    _, problem = next(problems(pipeline, clean, pipeline.grid.grid(), memo))
    with blame(pipeline.reconstruct):
        solver, choice = weights.resolve(pipeline.reconstruct, problem)
    return pipeline.with_solver(solver), choice


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
