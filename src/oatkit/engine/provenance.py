"""Which versions of what made a result."""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from oatkit.pipeline import Pipeline
from oatkit.registry import installed

LIBRARIES = ("oatkit", "numpy", "scipy", "numba", "scikit-image", "h5py", "zarr", "pydantic", "pluggy")
"""Packages whose version can change a number or a file."""


def versions(pipeline: Pipeline) -> dict[str, str]:
    """Return the version of Python, the platform, each library, and each distribution with a plugin in `pipeline`."""
    used = {type(step) for step in pipeline.plugins()}
    foreign = {e.distribution: e.version for e in installed().entries if e.cls in used}
    found = {name: known for name in LIBRARIES if (known := _version(name))}
    return {"python": platform.python_version(), "platform": platform.platform(), **foreign, **found}


@cache  # a run over many frames asks for each
def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
