"""The detectors of a scan of plain arrays: positions from a file, or an arc."""

from pathlib import Path

import numpy as np

from oatkit.builtin.readers.array_tables import MAX_DETECTORS, ArcTable, DetectorsTable
from oatkit.builtin.readers.number_files import read_numbers
from oatkit.builtin.readers.plane import axes_in_plane, flat_axes, seen_along
from oatkit.data import Detectors
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import inside, printable

SMALLEST_ARRAY_MM = 1.0
"""No array about the origin is smaller; positions in m that are taken for mm are."""
COORDINATES = ("x", "y", "z")
UNITS_M = {"m": 1.0, "mm": 1e-3}


def positions(table: DetectorsTable, folder: Path) -> tuple[Detectors, list[str]]:
    """Return the detectors at positions from a file, with notes. Raises `ReadError`."""
    path = inside(folder, table.positions)
    values = _one_row_each(path, read_numbers(path, table.dataset))
    axes = _axes(path, table, values.shape[1])
    points_m = np.zeros((len(values), 3))
    points_m[:, [COORDINATES.index(axis) for axis in axes]] = UNITS_M[table.unit] * values
    largest_mm = 1e3 * abs(points_m).max()
    if not largest_mm >= SMALLEST_ARRAY_MM:
        raise ReadError(
            f"{path}: all detectors lie within {largest_mm:.3g} mm of the origin; is their unit '{table.unit}'?"
        )
    across, note = _across(path, points_m, planar=len(axes) == 2)
    try:
        return seen_along(points_m, across), [*note, *_assumed(table, axes)]
    except ValidationError as error:
        raise ReadError(f"{path}: {error} (the description says: {table.unit})") from None


def arc(table: ArcTable) -> Detectors:
    """Return detectors on an arc about the origin."""
    from_middle = ((np.arange(table.count) + 0.5) / table.count - 0.5) * table.coverage_degrees
    sense = 1 if table.order == "anticlockwise" else -1
    angle = np.deg2rad(90 + table.rotation_degrees + sense * from_middle)
    return Detectors(1e-3 * table.radius_mm * np.column_stack([np.sin(angle), np.cos(angle)]))


def _one_row_each(path: Path, values: np.ndarray) -> np.ndarray:
    """Return positions as ``(detector, coordinate)``, whichever way the file holds them."""
    fitting = [length in (2, 3) for length in values.shape]
    if values.ndim != 2 or sum(fitting) != 1 or max(values.shape) > MAX_DETECTORS:
        raise ReadError(
            f"{path}: expected (n, 2) or (n, 3) positions of up to {MAX_DETECTORS} detectors, or the transpose, "
            f"found the shape {values.shape}"
        )
    return values if fitting[1] else values.T


def _axes(path: Path, table: DetectorsTable, count: int) -> tuple[str, ...]:
    """Return the names of the coordinates in the order of the file."""
    expected = COORDINATES[:count]
    axes = expected if table.axes is None else table.axes
    if sorted(axes) != list(expected):
        raise ReadError(
            f"{path}: {count} coordinates a detector; expected [detectors].axes to name {', '.join(expected)}, "
            f"got {printable(', '.join(axes), 60)}"
        )
    return axes


def _across(path: Path, points_m: np.ndarray, planar: bool) -> tuple[int, list[str]]:
    """Return the axis across the plane in which the detectors lie, with a note where there was one to be found."""
    across = flat_axes(points_m, str(path))[0]
    right, up = (COORDINATES[axis] for axis in axes_in_plane(across))
    note = f"The detectors lie in a plane of constant {COORDINATES[across]}: {right} is taken to the right, {up} up."
    return across, [] if planar else [note]


def _assumed(table: DetectorsTable, axes: tuple[str, ...]) -> list[str]:
    unit = [] if "unit" in table.model_fields_set else ["The unit of the detector positions is not stated: m assumed."]
    order = [f"The order of coordinates is not stated: {', '.join(axes)} assumed."] if table.axes is None else []
    return unit + order
