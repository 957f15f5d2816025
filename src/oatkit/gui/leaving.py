"""What a widget leaves in order when its window closes, and when Qt destroys it."""

from collections.abc import Callable
from typing import Any
from weakref import WeakMethod

from qtpy.QtCore import QEvent, QObject

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


def when_closed(widget: Any, action: Callable[[], Any]) -> None:
    """Call `action` each time the window that the widget is in closes; one that the system made small goes on."""
    _WindowWatch(widget, action)


class _WindowWatch(QObject):
    """Follows a widget into whatever window it comes, and belongs to it."""

    def __init__(self, widget: Any, action: Callable[[], Any]) -> None:
        super().__init__(widget)
        self._widget, self._action = widget, action
        self._window: Any = None
        widget.installEventFilter(self)

    def eventFilter(self, watched: Any, event: Any) -> bool:
        if watched is self._widget and event.type() == QEvent.Type.Show and self._window is not watched.window():
            self._window = watched.window()
            self._window.installEventFilter(self)
        if watched is self._window and event.type() == QEvent.Type.Hide and not event.spontaneous():
            self._action()
        return False
