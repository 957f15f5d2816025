"""What a widget leaves in order when Qt destroys it."""

from collections.abc import Callable
from typing import Any
from weakref import WeakMethod

_WAITING: set[Callable[..., None]] = set()
"""Held here until they are called: what only Qt holds may be collected while Qt calls it, which crashes."""


def when_gone(widget: Any, action: Callable[[], Any]) -> None:
    """Call `action` once the widget (or timer) is destroyed. It must not ask the widget's own parts."""

    def call(*_: Any) -> None:
        action()
        _WAITING.discard(call)

    _WAITING.add(call)
    widget.destroyed.connect(call)


def link(widget: Any, signal: Any, slot: Callable[..., Any]) -> None:
    """Connect a signal that outlives the widget to a method of it, for as long as the widget lives."""
    signal.connect(slot)
    weak = WeakMethod(slot)  # else the widget would be kept until it is destroyed, which it would not be then

    def unlink() -> None:
        if (known := weak()) is not None:
            signal.disconnect(known, missing_ok=True)

    when_gone(widget, unlink)
