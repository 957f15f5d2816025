"""One piece of work, a frame, and what becomes of it: what goes to a worker, and what comes back."""

from dataclasses import dataclass, replace
from typing import Any

from oatkit.data import Scan
from oatkit.engine import run_resolved
from oatkit.engine.rules import Resolved, resolve
from oatkit.errors import OatkitError
from oatkit.events import Listener, ignore
from oatkit.memo import Memo
from oatkit.reconstruction import frame_key
from oatkit.result import Result


@dataclass(frozen=True)
class Work:
    """What all frames of a run share. It pickles: a lazy scan as its path, never as its content."""

    resolved: Resolved
    """With rules replaced already, unless each frame is to do so by itself."""
    scan: Scan


@dataclass(frozen=True)
class Outcome:
    """What became of one frame."""

    frame: int
    """Of the scan."""
    result: Result | None = None
    error: OatkitError | None = None
    """Why there is no result."""


def run_piece(work: Work, frame: int, memo: Memo, on_event: Listener = ignore) -> Outcome:
    """Run one frame. An error of it is part of the outcome, whatever is not of oatkit is raised."""
    resolved, scan = work.resolved, work.scan
    try:
        if resolved.pipeline.scan.rules == "frame":
            own = resolve(resolved.requested, scan, memo, on_event, frame)
            resolved = replace(own, left_out=resolved.left_out)
        return Outcome(frame, run_resolved(resolved, scan, frame, memo, on_event))
    except OatkitError as error:
        # Without its frames of the stack, which hold the images that were in the making.
        return Outcome(frame, error=_bare(error))
    finally:
        # No other frame needs what was made of this one; without this, memory grows with the scan.
        memo.forget(*frame_key(scan, frame))


def _bare(error: Any) -> Any:
    error.__traceback__ = error.__cause__ = error.__context__ = None
    return error
