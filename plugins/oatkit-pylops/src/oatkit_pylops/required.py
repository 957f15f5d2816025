"""Whether a library is there."""

import importlib.util

from oatkit.api import PluginError


def require(library: str) -> None:
    """Raise `PluginError` where a library is not installed; it is not imported to find out."""
    if importlib.util.find_spec(library) is None:
        raise PluginError(f"needs {library}, which is not installed: pip install {library}")
