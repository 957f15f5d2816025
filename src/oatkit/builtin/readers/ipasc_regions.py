"""Regions of interest in an IPASC file."""

import logging
from collections.abc import Iterator

import numpy as np

from oatkit.api import PolygonRegion, RectangleRegion, Region
from oatkit.builtin.readers.ipasc_fields import Fields
from oatkit.builtin.readers.plane import axes_in_plane
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import hdf5_group, printable

REGIONS = "regions_of_interest"
MAX_REGIONS = 10_000
log = logging.getLogger("oatkit")


def read_regions(fields: Fields, across: int) -> tuple[Region, ...]:
    """Return the regions of ``/meta_data`` as they lie in the plane across an axis, by the names of their arrays.

    An array is, after the consortium, a box (x, y and z from and to, six numbers) or points (x, y, z) around the
    region; they are taken as the corners of a polygon, in their order. What is neither is left out, with a warning in
    the log. Raises `ReadError` for links.
    """
    found = []
    for name, values in _arrays(fields):
        try:
            found.append(_region(name, values, across))
        except ValidationError as error:
            log.warning("%s: %s; it is left out", fields.group.file.filename, error)
    return tuple(found)


def _arrays(fields: Fields) -> Iterator[tuple[str, np.ndarray | None]]:
    """Yield the arrays by name; those that are grouped under a name of their own have both."""
    import h5py

    if fields.group.get(REGIONS, getlink=True) is None:
        return
    group = hdf5_group(fields.group, REGIONS, MAX_REGIONS)
    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise ReadError(f"{group.file.filename} '{group.name}/{printable(name, 60)}': links are refused")
        if isinstance(group[name], h5py.Group):
            inner = hdf5_group(group, name, MAX_REGIONS)
            yield from ((f"{name}/{key}", Fields(inner, fields.turned).array(key)) for key in inner)
        else:
            yield name, Fields(group, fields.turned).array(name)


def _region(name: str, values: np.ndarray | None, across: int) -> Region:
    called, axes = printable(name, 200), axes_in_plane(across)
    if values is not None and values.size == 6 and max(values.shape, default=0) == 6:
        (left, right), (bottom, top) = (values.astype(float).reshape(3, 2)[axis] for axis in axes)
        centre = ((bottom + top) / 2, (left + right) / 2)
        return RectangleRegion(called, centre, ((top - bottom) / 2, (right - left) / 2))
    if values is None or values.ndim != 2 or values.shape[1] != 3:
        shape = () if values is None else values.shape
        raise ValidationError(f"region '{called}': expected six numbers or points (x, y, z), found the shape {shape}")
    return PolygonRegion(called, values.astype(float)[:, axes[::-1]])
