"""Where long work may be stopped from outside: between the passes of a loop that nobody sees."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar


def _nothing() -> None:
    pass


_action: ContextVar[Callable[[], None]] = ContextVar("oatkit checkpoint", default=_nothing)


def checkpoint() -> None:
    """Do what `at_checkpoints` has asked for in this thread, else nothing; what it raises ends the work.

    Solvers need not call it: they are stopped where they yield.
    """
    _action.get()()


@contextmanager
def at_checkpoints(action: Callable[[], None]) -> Iterator[None]:
    """Have `action` called wherever the work within, in this thread, passes a checkpoint."""
    token = _action.set(action)
    try:
        yield
    finally:
        _action.reset(token)
