"""Work beside the window: one generator in one thread, which never raises and can always be stopped."""

import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from oatkit.checkpoint import at_checkpoints
from oatkit.errors import OatkitError

PATIENCE_S = 5.0
"""How long the end of a job is waited for when its window closes."""


@dataclass(frozen=True)
class Failure:
    """Why a job failed."""

    sentence: str
    details: str
    """The traceback, to copy."""


class Cancelled(BaseException):
    """The job was asked to stop."""


class Job:
    """A generator that runs in a thread of its own.

    What it yields waits in `drain` for whoever looks; it is stopped at its next yield, or wherever it calls `check`.
    Its end is in `done`, `failure` and `cancelled`. Nothing is raised in the thread, whatever the work does.
    """

    def __init__(self, work: Callable[["Job"], Iterator[Any]]) -> None:
        self._work = work
        self._items: deque[Any] = deque()
        self._stop = threading.Event()
        self._ended = threading.Event()
        self.failure: Failure | None = None
        self.newest: Any = None
        """Set by the work: what only the newest of is worth looking at."""
        self._thread = threading.Thread(target=self._run, name="oatkit job", daemon=True)

    def start(self) -> "Job":
        """Begin, and return the job itself."""
        self._thread.start()
        return self

    def cancel(self) -> None:
        """Ask the work to stop."""
        self._stop.set()

    def show(self, item: Any) -> None:
        """Called by the work: leave something to be drained, as a yield does."""
        self._items.append(item)

    def check(self) -> None:
        """Called by the work: raise `Cancelled` where it was asked to stop."""
        if self._stop.is_set():
            raise Cancelled

    @property
    def cancelled(self) -> bool:
        """Whether it was asked to stop."""
        return self._stop.is_set()

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way; what it yielded may still wait to be drained."""
        return self._ended.is_set()

    def drain(self) -> list[Any]:
        """Return what was yielded since the last call."""
        items = []
        while self._items:
            items.append(self._items.popleft())
        return items

    def wait(self, seconds: float = PATIENCE_S) -> bool:
        """Wait for the end; say whether it came."""
        return self._ended.wait(seconds)

    def _run(self) -> None:
        try:
            with at_checkpoints(self.check):
                for item in self._work(self):
                    self._items.append(item)
                    self.check()
        except Cancelled:
            pass
        except BaseException as error:  # a plugin may raise anything, SystemExit too
            self.failure = failure_of(error)
        finally:
            self._ended.set()


def failure_of(error: BaseException) -> Failure:
    """Return an error as a sentence and its traceback."""
    known = isinstance(error, OatkitError)
    sentence = str(error) if known else f"{type(error).__name__}: {error}"
    return Failure(sentence, "".join(traceback.format_exception(error)))
