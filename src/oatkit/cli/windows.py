"""The command that opens the window."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from oatkit.cli.app import command
from oatkit.errors import ValidationError

INSTALL = 'pip install "oatkit[all]"'


@command
def gui(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", readable=False, help="A scan, a result (.zarr) or a pipeline (.toml)."),
    ] = None,
) -> None:
    """Open napari with the windows of oatkit, and a file in it."""
    _check_display()
    try:
        import napari  # noqa: F401
        import qtpy.QtWidgets  # noqa: F401
    except (ImportError, RuntimeError) as error:  # qtpy raises RuntimeErrors where there is no Qt binding
        raise ValidationError(f"the window needs napari and a Qt binding: {INSTALL} ({_short(error)})") from None
    from oatkit.gui.window import open_window

    open_window(file)


def _check_display() -> None:
    """Refuse where Qt would abort the whole process with a page of text."""
    known = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in known):
        raise ValidationError("there is no display to open a window on: DISPLAY and WAYLAND_DISPLAY are not set")


def _short(error: Exception) -> str:
    return str(error).strip().partition("\n")[0]
