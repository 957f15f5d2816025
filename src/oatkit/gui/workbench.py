"""What all widgets of one viewer share: the session, the layers, and signals when something changed."""

from typing import Any
from weakref import WeakKeyDictionary

from psygnal import Signal

from oatkit.gui.layers import Layers
from oatkit.gui.session import Session


class Workbench:
    """One session shown in one viewer. The signals are sent in the thread of the window."""

    scan_changed = Signal()
    """Another scan, or another frame of it."""
    pipeline_changed = Signal()
    """An edit of the pipeline, also one that was taken back."""
    result_changed = Signal()
    """A run has ended with images."""

    def __init__(self, viewer: Any) -> None:
        self.session = Session()
        self.layers = Layers(viewer)


_benches: WeakKeyDictionary[Any, Workbench] = WeakKeyDictionary()


def workbench(viewer: Any) -> Workbench:
    """Return the workbench of a viewer, made at the first call; widgets that are opened later join it."""
    if viewer not in _benches:
        _benches[viewer] = Workbench(viewer)
    return _benches[viewer]
