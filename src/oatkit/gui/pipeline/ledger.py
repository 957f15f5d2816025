"""Which steps are up to date: what each was made of when it last ran, how long it took, and what went wrong."""

from dataclasses import dataclass, field
from typing import Any

from oatkit.events import Event, StepDone, StepStarted
from oatkit.gui.pipeline.slots import Place, places
from oatkit.pipeline import Pipeline

ORDER = ("scan", "preprocess", "grid", "forward", "reconstruct", "segment", "optics", "fluence", "absorption", "unmix")
"""A step depends on its own table and on those before it."""

RULES = {"choosing": "reconstruct", "looking": "motion", "finding": "absorption", "speed": "scan"}
"""First words of what the engine does before its steps, by the table that asked for it."""

STEP_OF = {"grid": "reconstruct", "forward": "reconstruct", "optics": "fluence", "scan": "preprocess"}
"""Which step uses a table that is none."""


@dataclass(frozen=True)
class State:
    """How a table stands to the last run."""

    word: str = ""
    """``""`` (never run), ``"fresh"``, ``"stale"``, ``"running"`` or ``"failed"``."""
    seconds: float | None = None
    sentence: str = ""
    """Why it failed."""


@dataclass
class Ledger:
    """What ran, over all runs of a window."""

    running: str = ""
    """The step at work."""
    scan: Any = None
    """Of the last run."""
    frame: int = 0
    _ran: Pipeline | None = None
    _done: dict[str, tuple[Any, float]] = field(default_factory=dict)
    _failed: dict[Place, tuple[Any, str]] = field(default_factory=dict)

    def begin(self, pipeline: Pipeline, scan: Any, frame: int) -> None:
        """A run of `pipeline` begins."""
        if not self.is_of(scan, frame):
            self._done.clear()
        self.scan, self.frame, self._ran, self.running = scan, frame, pipeline, ""
        self._failed.clear()

    def is_of(self, scan: Any, frame: int) -> bool:
        """Say whether the last run was of this frame of this scan."""
        return self.scan is scan and self.frame == frame

    def take(self, event: Event) -> None:
        """Something has happened in the run."""
        if isinstance(event, StepStarted):
            self.running = RULES.get(event.step.split()[0], event.step)
        elif isinstance(event, StepDone) and self._ran is not None:
            chain = _chain(self._ran, event.step)
            if (
                self._done.get(event.step, (None,))[0] != chain
            ):  # else it was known, and its seconds are those of looking
                self._done[event.step] = (chain, event.seconds)
            self.running = ""

    def end(self, sentence: str = "") -> Place | None:
        """The run has ended; `sentence` says why it failed. Return where it failed."""
        running, self.running = self.running, ""
        if not sentence or self._ran is None:
            return None
        place = _blamed(self._ran, sentence) or _first(self._ran, running or "preprocess")
        self._failed[place] = (place.part(self._ran), sentence)
        return place

    def state(self, place: Place, pipeline: Pipeline, scan: Any, frame: int) -> State:
        """Return how a table of `pipeline` stands."""
        slot = place.slot.name
        made_of, sentence = self._failed.get(place, (None, ""))
        if sentence and made_of == place.part(pipeline):
            return State("failed", sentence=sentence)
        if self.running == slot:
            return State("running")
        if place.part(pipeline) is None or self._ran is None:
            return State()
        chain, seconds = self._done.get(STEP_OF.get(slot, slot), (None, None))
        if chain is None:
            return State()
        known = _chain(pipeline, slot)
        fresh = self.is_of(scan, frame) and chain[: len(known)] == known
        own = slot not in STEP_OF
        return State("fresh" if fresh else "stale", seconds if fresh and own else None)


def _chain(pipeline: Pipeline, step: str) -> tuple[Any, ...]:
    """Return all that a step depends on."""
    before = ORDER[: ORDER.index(step) + 1] if step in ORDER else (step,)
    return tuple(getattr(pipeline, name) for name in before)


def _blamed(pipeline: Pipeline, sentence: str) -> Place | None:
    """Return the place of the plugin that a sentence begins with: ``solver 'tv' failed: ...``."""
    for place in places(pipeline):
        part = place.part(pipeline)
        if part is not None and part.name and sentence.startswith(f"{part.kind.replace('_', ' ')} '{part.name}'"):
            return place
    return None


def _first(pipeline: Pipeline, slot: str) -> Place:
    found = places(pipeline)
    return next((place for place in found if place.slot.name == slot), found[0])
