"""What an engine is."""

from abc import ABC, abstractmethod
from collections.abc import Generator, Sequence

from oatkit.batch.pieces import Outcome, Work
from oatkit.events import Listener
from oatkit.memo import Memo

Outcomes = Generator[Outcome, None, None]

IN_FLIGHT = 2
"""Frames under way for each worker: one at work, one waiting. More would only fill memory."""


class Engine(ABC):
    """Runs frames, in any order, and yields what becomes of each exactly once."""

    @abstractmethod
    def run(self, work: Work, frames: Sequence[int], memo: Memo, on_event: Listener) -> Outcomes:
        """Yield the outcome of each frame as it comes; closed early, it stops what is under way."""
