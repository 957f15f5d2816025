"""Optoacoustic tomography: from a scan to non-negative images, by plugins.

>>> import oatkit
>>> scan = oatkit.read("Scan_9.msot")                    # doctest: +SKIP
>>> result = oatkit.run(oatkit.Pipeline.load("maxent"), scan)   # doctest: +SKIP
>>> result["initial_pressure"].values.min() >= 0         # doctest: +SKIP
True
"""

from importlib import import_module
from typing import Any

import lazy_loader

__version__ = "0.1.0"

# Each name is imported when it is first asked for; where it comes from stands in __init__.pyi.
_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Return a public name, or a module of this package."""
    if name in __all__:
        return _public(name)
    try:
        return import_module(f"{__name__}.{name}")
    except ModuleNotFoundError as error:
        if error.name != f"{__name__}.{name}":
            raise
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'") from None
