"""The detectors of an IPASC file."""

import re
from typing import Any

import numpy as np

from oatkit.builtin.readers.ipasc_fields import Fields
from oatkit.builtin.readers.plane import flat_axes, seen_along
from oatkit.data import Detectors
from oatkit.hostile import hdf5_dataset, hdf5_group
from oatkit.ipasc import MAX_DETECTORS

MAX_MEMBERS = 1000
"""Limit for the fields of one group."""


def read_detectors(device: Any) -> tuple[Detectors, int, list[str]]:
    """Return the detectors in the natural order of their names, the axis across their plane, and notes.

    Raises `ReadError` where there are none or more than `MAX_DETECTORS`, where one has no position, or where they do
    not lie in a plane of constant x, y or z.
    """
    group = hdf5_group(device, "detectors", MAX_DETECTORS)
    names = sorted(group, key=_natural)
    if not names:
        raise Fields(device).error("detectors", "a group for each detector", "an empty group")
    points = np.array([_position(group, name) for name in names])
    across, notes = _across(points, device)
    if Fields(hdf5_group(group, names[0], MAX_MEMBERS)).has("frequency_response"):
        notes.append("The file holds frequency responses of the detectors; without their phases, they are not used.")
    return seen_along(points, across), across, notes


def _natural(name: str) -> list[Any]:
    """Return a key that sorts ``element_10`` after ``element_9``, whatever the number of digits."""
    parts = re.split(r"([0-9]+)", name)
    numbers = [digits.lstrip("0") for digits in parts[1::2]]
    return [parts[0], *((len(n), n, text) for n, text in zip(numbers, parts[2::2], strict=True)), name]


def _position(group: Any, name: str) -> list[float]:
    dataset = f"{name}/detector_position"
    point = hdf5_dataset(group, dataset, "iuf", (1, 2), 1024)[()].ravel()
    if len(point) != 3:
        raise Fields(group).error(dataset, "x, y and z in m", f"{len(point)} numbers")
    return [float(coordinate) for coordinate in point]


def _across(points: np.ndarray, device: Any) -> tuple[int, list[str]]:
    """Return the axis across the image plane, and a note where the positions alone do not tell."""
    flat = flat_axes(points, f"{device.file.filename} '{device.name}/detectors'")
    if len(flat) == 1:
        return flat[0], []
    hinted = [axis for axis in flat if axis in _flat_in_view(device)]
    across = hinted[0] if len(hinted) == 1 else flat[0]
    reason = "as the field of view shows" if len(hinted) == 1 else "since nothing in the file says otherwise"
    return across, [f"The detectors lie on a line: images are of constant {'xyz'[across]}, {reason}."]


def _flat_in_view(device: Any) -> list[int]:
    """Return the axes along which the field of view has no extent."""
    if device.get("general", getlink=True) is None:
        return []
    view = Fields(hdf5_group(device, "general", MAX_MEMBERS)).array("field_of_view")
    if view is None or view.size != 6:
        return []
    return [axis for axis, size in enumerate(np.ptp(view.reshape(3, 2), axis=1)) if size == 0]
