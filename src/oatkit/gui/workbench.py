"""What all widgets of one viewer share: the session, the layers, and signals when something changed."""

from typing import Any

from psygnal import Signal

from oatkit.gui.document import PipelineDocument
from oatkit.gui.images.layers import Layers
from oatkit.gui.images.side_by_side import SideBySide
from oatkit.gui.images.viewing import Viewing
from oatkit.gui.session import Session
from oatkit.gui.settings import MB, Settings
from oatkit.memo import Memo


class Workbench:
    """One session shown in one viewer. The signals are sent in the thread of the window."""

    scan_changed = Signal()
    """Another scan, or another frame of it."""
    pipeline_changed = Signal()
    """An edit of the pipeline, also one that was taken back."""
    result_changed = Signal()
    """A run has ended with images."""
    run_wanted = Signal()
    """Somebody asks the widget that runs the pipeline to do so."""

    def __init__(self, viewer: Any) -> None:
        self.viewer = viewer
        settings = Settings.read()
        self.session = Session(PipelineDocument.of_preset(settings.pipeline), memo=Memo(settings.memory_mb * MB))
        self.live_preview = settings.live_preview
        self.layers = Layers(viewer)
        self.viewing = Viewing(viewer, self.layers)
        self.side_by_side = SideBySide(self.layers, self.viewing)


NAME = "_oatkit_workbench"


def workbench(viewer: Any) -> Workbench:
    """Return the workbench of a viewer, made at the first call; widgets that are opened later join it."""
    viewer = getattr(viewer, "__wrapped__", viewer)  # napari hands a proxy to widgets
    # The viewer itself holds it: a dictionary here would keep every viewer alive, since a workbench refers to its own.
    if NAME not in viewer.__dict__:
        viewer.__dict__[NAME] = Workbench(viewer)
    return viewer.__dict__[NAME]
