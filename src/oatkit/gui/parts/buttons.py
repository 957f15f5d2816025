"""Buttons: a text, a word on what it does, and what it does."""

from collections.abc import Callable
from typing import Any

from qtpy.QtWidgets import QAbstractButton, QPushButton, QToolButton


def button(text: str, tip: str, action: Callable[[], Any] | None = None, checkable: bool = False) -> QPushButton:
    """Return a button with a text."""
    return _made(QPushButton(), text, tip, action, checkable)


def tool(text: str, tip: str, action: Callable[[], Any] | None = None, checkable: bool = False) -> QToolButton:
    """Return a small button, for a sign or a short word."""
    return _made(QToolButton(), text, tip, action, checkable)


def _made(made: QAbstractButton, text: str, tip: str, action: Callable[[], Any] | None, checkable: bool) -> Any:
    made.setText(text)
    made.setToolTip(tip)
    made.setCheckable(checkable)
    if action is not None:
        made.clicked.connect(lambda: action())
    return made
