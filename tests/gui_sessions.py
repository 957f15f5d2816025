"""Sessions on small scans, which run in a moment."""

from oatkit.gui.document import PipelineDocument
from oatkit.gui.session import Session

SMALL = {"pixels": 32, "field_of_view_mm": 9.0}


def small_session(scan, preset="lsqr"):
    """A session on a small scan."""
    session = Session(PipelineDocument.of_preset(preset), scan)
    for key, value in SMALL.items():
        session.document.set("grid", key, value)
    return session
