"""The command that opens the window."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from oatkit.cli.app import command
from oatkit.errors import ValidationError

INSTALL = 'pip install "oatkit[all]"'
BINDINGS = ("PyQt6", "PySide6", "PyQt5", "PySide2")
"""That qtpy takes, any of them."""


@command
def gui(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", readable=False, help="A scan, a result (.zarr) or a pipeline (.toml)."),
    ] = None,
) -> None:
    """Open napari with the windows of oatkit, and a file in them."""
    _check_installed()
    _check_display()
    try:
        import napari  # noqa: F401
        import qtpy.QtWidgets  # noqa: F401
    except (ImportError, RuntimeError) as error:  # a library that Qt takes from the system is missing
        raise ValidationError(f"napari and Qt are installed but cannot be started: {_short(error)}") from None
    from oatkit.gui.window import open_window

    open_window(file)


def _check_installed() -> None:
    """Refuse where napari or every Qt binding is missing, without importing what is there."""
    missing = [] if find_spec("napari") else ["napari"]
    if not any(find_spec(binding) for binding in BINDINGS):
        missing.append("a Qt binding")
    if missing:
        raise ValidationError(f"the window needs {' and '.join(missing)}, not installed here: {INSTALL}")


def _check_display() -> None:
    """Refuse where Qt would abort the whole process with a page of text."""
    known = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in known):
        raise ValidationError("there is no display to open a window on: DISPLAY and WAYLAND_DISPLAY are not set")


def _short(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
