"""Regions of interest in an HDF5 file of PATATO."""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.patato_layout import ROIS, members
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import hdf5_dataset, printable
from oatkit.regions import PolygonRegion

MAX_OUTLINE_BYTES = 16 * 2**20
log = logging.getLogger("oatkit")


def regions(file: Any, path: Path) -> tuple[PolygonRegion, ...]:
    """Return the polygons in ``rois``, by the names ``<class>_<position>/<n>``, with the vertices of the file.

    What has fewer than three corners has no area: it is left out, with a warning in the log. Raises `ReadError`.
    """
    found = (_region(file, path, name) for name in members(file, ROIS))
    return tuple(region for region in found if region is not None)


def _region(file: Any, path: Path, name: str) -> PolygonRegion | None:
    outline = hdf5_dataset(file, name, "iuf", range(33), MAX_OUTLINE_BYTES)
    called = printable(name.removeprefix(f"{ROIS}/"), 200)
    if outline.ndim != 2 or outline.shape[1] != 2 or outline.shape[0] < 3:
        log.warning("%s: region '%s' has the shape %s, no area; it is left out", path, called, outline.shape)
        return None
    # The file holds (x, y), y up.
    vertices = np.asarray(outline[()], float)[:, ::-1]
    try:
        return PolygonRegion(called, vertices)
    except ValidationError as error:
        raise ReadError(f"{path}: {error}") from None
