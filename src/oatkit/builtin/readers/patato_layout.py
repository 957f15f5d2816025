"""What lies where in an HDF5 file of PATATO, and its attributes."""

import json
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.errors import ReadError
from oatkit.hostile import check_attribute_heaps, hdf5_group, printable

log = logging.getLogger("oatkit")

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
RAW_DATA = "raw_data"
RESULTS = {
    "recons": ("initial_pressure", "a.u."),
    "unmixed": ("", "a.u."),
    "so2": ("so2", ""),
    "thb": ("total_haemoglobin", "a.u."),
    "dso2": ("so2_change", ""),
    "baseline_so2": ("so2", ""),
    "baseline_so2_sigma": ("so2_deviation", ""),
    "dicg": ("icg_change", "a.u."),
    "baseline_icg": ("icg", "a.u."),
    "baseline_icg_sigma": ("icg_deviation", "a.u."),
    "ultrasound": ("ultrasound", "a.u."),
}
"""Quantity and unit of the images in each group; those in ``unmixed`` are named by their components."""
ROIS = "rois"
BESIDE_RAW_DATA = ("GEOMETRY", "wavelengths", "OverallCorrectionFactor", "irf", *RESULTS, ROIS)
IPASC = ("binary_time_series_data", "meta_data", "meta_data_device")
"""Roots of another format, which may hold groups of the same names."""
MAX_MEMBERS = 10_000
MAX_NUMBERS = 10_000
MAX_TEXTS = 64
"""Limits for one attribute."""


def has_layout(path: Path) -> bool:
    """Say whether a file is HDF5 with the groups and datasets of PATATO; it is opened only where it begins as HDF5."""
    if not path.is_file():
        return False
    with open(path, "rb") as start:
        if start.read(len(HDF5_SIGNATURE)) != HDF5_SIGNATURE:
            return False
    import h5py

    with h5py.File(path, "r") as file:
        return (has(file, RAW_DATA) and any(has(file, name) for name in BESIDE_RAW_DATA)) or _has_results(file)


def has(file: Any, name: str) -> bool:
    """Say whether there is a member of that name, without following a link."""
    return file.get(name, getlink=True) is not None


def members(file: Any, name: str) -> Iterator[str]:
    """Yield the paths of what lies in the groups in a group: ``recons/Model Based/0``. A missing one has none.

    A dataset in the place of such a group is passed over, with a warning in the log.
    Raises `ReadError` for links other than hard ones.
    """
    import h5py

    if not has(file, name):
        return
    parent = hdf5_group(file, name, MAX_MEMBERS)
    for group in parent:
        if isinstance(parent.get(group, getlink=True), h5py.HardLink) and isinstance(parent[group], h5py.Dataset):
            log.warning(
                "%s '%s': expected a group, found a dataset; it is left out",
                file.filename,
                printable(f"{name}/{group}", 120),
            )
            continue
        held = hdf5_group(file, f"{name}/{group}", MAX_MEMBERS)
        for number in sorted(held, key=_number_first):
            path = f"{name}/{group}/{number}"
            if not isinstance(held.get(number, getlink=True), h5py.HardLink):
                raise ReadError(f"{file.filename} '{printable(path, 120)}': links are refused")
            yield path


def numbers(item: Any, name: str) -> np.ndarray | None:
    """Return an attribute as a flat array of finite numbers, or None where it is none."""
    value = _attribute(item, name)
    if value is None or value.dtype.kind not in "biuf":
        return None
    values = value.ravel().astype(float)
    return values if values.size and np.isfinite(values).all() else None


def number(item: Any, name: str) -> float | None:
    """Return an attribute as one finite number, or None where it is none."""
    values = numbers(item, name)
    return float(values[0]) if values is not None and values.size == 1 else None


def texts(item: Any, name: str) -> tuple[str, ...]:
    """Return an attribute as texts: of an array, of a list in JSON, or a single one; none where it is no text."""
    value = _attribute(item, name)
    if value is None or value.dtype.kind not in "OSU" or value.size > MAX_TEXTS:
        return ()
    found = [entry.decode("utf-8", "replace") if isinstance(entry, bytes) else entry for entry in value.ravel()]
    if not all(isinstance(entry, str) for entry in found):
        return ()
    if len(found) == 1 and found[0].startswith("["):
        found = _listed(found[0])
    return tuple(printable(entry, 200) for entry in found)


def text(item: Any, name: str) -> str:
    """Return an attribute as one text, empty where it is none."""
    return "".join(texts(item, name)[:1])


def _has_results(file: Any) -> bool:
    import h5py

    found = [name for name in (*RESULTS, ROIS) if isinstance(file.get(name, getlink=True), h5py.HardLink)]
    foreign = any(has(file, name) for name in IPASC)
    return bool(found) and not foreign and all(isinstance(file[name], h5py.Group) for name in found)


def _attribute(item: Any, name: str) -> np.ndarray | None:
    """Return an attribute as an array; None where it is missing, empty, too large or cannot be read.

    Raises `ReadError` where a heap of texts is broken.
    """
    try:
        held = item.attrs.get_id(name)
        count = held.get_space().get_simple_extent_npoints()
        if not 0 < count <= (MAX_TEXTS if held.dtype.hasobject else MAX_NUMBERS):
            return None
        if held.dtype.hasobject:
            check_attribute_heaps(item)
        return np.asarray(item.attrs[name])
    except (KeyError, OSError, TypeError, ValueError, RuntimeError):
        return None


def _listed(found: str) -> list[str]:
    try:
        entries = json.loads(found)
    except (ValueError, RecursionError):
        return [found]
    return [str(entry) for entry in entries][:MAX_TEXTS]


def _number_first(name: str) -> tuple[bool, int, str]:
    """Sort ``2`` before ``10`` and both before words."""
    plain = name.isdecimal() and len(name) < 10
    return (not plain, int(name) if plain else 0, name)
