"""Regions of interest in an HDF5 file of PATATO."""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.api import PolygonRegion
from oatkit.builtin.readers.patato_layout import ROIS, members
from oatkit.errors import ValidationError
from oatkit.hostile import hdf5_dataset, printable

MAX_OUTLINE_BYTES = 16 * 2**20
NUMBERS = "numbers"
log = logging.getLogger("oatkit")


def regions(file: Any, path: Path) -> tuple[PolygonRegion, ...]:
    """Return the polygons in ``rois``, by the names ``<class>_<position>/<n>``, with the vertices of the file.

    What is no polygon, of three corners or more and of finite numbers in m, is left out with a warning in the log.
    Raises `ReadError` for what leads out of the file or is larger than an outline can be.
    """
    found = (_region(file, path, name) for name in members(file, ROIS))
    return tuple(region for region in found if region is not None)


def _region(file: Any, path: Path, name: str) -> PolygonRegion | None:
    called = printable(name.removeprefix(f"{ROIS}/"), 200)
    found = _what(file[name])
    if found == NUMBERS:
        outline = hdf5_dataset(file, name, "iuf", range(33), MAX_OUTLINE_BYTES)
        found = "" if _is_polygon(outline.shape) else f"numbers of the shape {outline.shape}"
    if found:
        log.warning("%s: region '%s' is no polygon but %s; it is left out", path, called, found)
        return None
    # The file holds (x, y), y up.
    vertices = np.asarray(outline[()], float)[:, ::-1]
    try:
        return PolygonRegion(called, vertices)
    except ValidationError as error:
        log.warning("%s: %s; it is left out", path, error)
        return None


def _is_polygon(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and shape[1] == 2 and shape[0] >= 3


def _what(item: Any) -> str:
    """Say what kind of thing lies in the place of a polygon, without reading it."""
    import h5py

    if not isinstance(item, h5py.Dataset):
        return f"a {type(item).__name__}"
    return NUMBERS if item.dtype.kind in "iuf" else f"data of the type {item.dtype}"
