"""Tells a slider that runs from one that is moved step by step."""

from collections.abc import Callable
from time import monotonic
from typing import Any


class Rest:
    """Watches the steps of a slider of one viewer. Without a window none is ever hurried.

    `then` is called once no step has come for `wait_ms` after a hurried one.
    """

    def __init__(self, viewer: Any, wait_ms: int, then: Callable[[], None]) -> None:
        self._viewer, self._wait_ms, self._then = viewer, wait_ms, then
        self._last = float("-inf")
        self._timer: Any = None

    def is_hurried(self) -> bool:
        """Take note of a step, and say whether it came sooner after the last one than the wait."""
        before, self._last = self._last, monotonic()
        if 1e3 * (self._last - before) >= self._wait_ms or getattr(self._viewer, "window", None) is None:
            return False
        if self._timer is None:
            from qtpy.QtCore import QTimer

            self._timer = QTimer(self._viewer.window._qt_window)
            self._timer.setSingleShot(True)
            self._timer.timeout.connect(self._then)
        self._timer.start(self._wait_ms)
        return True
