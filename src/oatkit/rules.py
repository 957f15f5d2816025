"""Rules in a pipeline: words that stand for numbers, replaced once for a scan, before anything is reconstructed."""

from dataclasses import dataclass

from oatkit import weights
from oatkit.blame import blame
from oatkit.data import Scan
from oatkit.events import Listener, StepStarted, ignore
from oatkit.focus import Focus, focus
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.reconstruction import preprocess, problems
from oatkit.vectors import norm


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

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know before trusting the choices."""
        return (*(self.speed.notes if self.speed else ()), *(self.weight.notes if self.weight else ()))


def resolve(pipeline: Pipeline, scan: Scan, memo: Memo | None = None, on_event: Listener = ignore) -> Resolved:
    """Return the pipeline with its speed of sound and its weight chosen, and how they were chosen.

    Each rule runs once, on the scan's first frame and its strongest wavelength (the one of the largest signals),
    whatever part of the scan is asked for; the speed of sound first, since the weight depends on it. Numbers are left
    alone.
    """
    memo = Memo() if memo is None else memo
    speed = None
    ready = pipeline
    if pipeline.scan.speed_of_sound_m_s == "focus":
        speed = focus(pipeline, scan, memo=memo, on_event=on_event)
        ready = speed.apply(pipeline)
    if not isinstance(getattr(pipeline.reconstruct, "weight", None), str):
        return Resolved(ready, pipeline, None, speed)
    on_event(StepStarted("choosing the weight"))
    clean = preprocess(ready, scan, 0, memo)
    each = problems(ready, clean, ready.grid.grid(), memo)
    _, strongest = max(each, key=lambda pair: norm(pair[1].data))
    with blame(ready.reconstruct):
        solver, choice = weights.resolve(ready.reconstruct, strongest)
    return Resolved(ready.with_solver(solver), pipeline, choice, speed)
