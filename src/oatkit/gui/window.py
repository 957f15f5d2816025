"""The napari window with the widgets of oatkit beside the picture."""

from pathlib import Path

import napari
from npe2 import PluginManager
from qtpy.QtCore import QTimer

from oatkit.gui.opening import open_path
from oatkit.gui.warming import warm_up
from oatkit.gui.workbench import workbench

AT_REST_MS = 500
"""After which a window has been drawn."""
NAME = "oatkit"
"""Of the plugin, as napari knows it."""


def make_window(file: Path | None = None, show: bool = True) -> napari.Viewer:
    """Return a viewer with all our widgets in it, the first one on top, and `file` open.

    Raises what `oatkit.gui.opening.open_path` raises; the window is closed then.
    """
    viewer = napari.Viewer(title="oatkit", show=False)
    try:
        docks = [viewer.window.add_plugin_dock_widget(NAME, name, tabify=True)[0] for name in widget_names()]
        for dock, name in zip(docks, widget_names(), strict=True):
            dock.setWindowTitle(name)  # napari adds the name of the plugin, for which tabs have no room
        docks[0].raise_()
        if file is not None:
            open_path(workbench(viewer), file)
    except BaseException:
        viewer.close()
        raise
    if show:
        viewer.show()
        QTimer.singleShot(AT_REST_MS, warm_up)
    return viewer


def open_window(file: Path | None = None) -> None:
    """Open the window and stay until it is closed. Raises what `make_window` raises."""
    make_window(file)
    napari.run()


def widget_names() -> list[str]:
    """Return the names of our widgets, in the order of the manifest."""
    manager = PluginManager.instance()
    manager.discover()
    return [widget.display_name for widget in manager.get_manifest(NAME).contributions.widgets or ()]
