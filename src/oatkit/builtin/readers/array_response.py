"""The impulse response of a scan of plain arrays."""

from pathlib import Path

import numpy as np

from oatkit.builtin.readers.array_tables import ResponseTable
from oatkit.builtin.readers.number_files import read_numbers
from oatkit.errors import ReadError
from oatkit.hostile import inside


def impulse_response(table: ResponseTable | None, folder: Path) -> tuple[np.ndarray | None, str]:
    """Return the response, time zero at index ``n // 2``, with a note; None where there is none.

    The scale is the file's. Raises `ReadError` where the file holds no single response, or only zeros.
    """
    if table is None:
        return None, "There is no impulse response: signals are taken as the ideal ones."
    path = inside(folder, table.file)
    found = read_numbers(path, table.dataset)
    values = found.ravel()
    if values.size != max(found.shape) or not values.any():
        raise ReadError(
            f"{path}: expected one impulse response for all detectors, shape (n,), found the shape {found.shape}"
            f"{'' if values.any() else ' of zeros'}"
        )
    if table.centre is not None and table.centre >= values.size:
        raise ReadError(f"{path}: the centre {table.centre} lies beyond the {values.size} samples of the response")
    centre = values.size // 2 if table.centre is None else table.centre
    assumed = ", the middle, assumed" if table.centre is None else ""
    return _centred(values, centre), (
        f"Impulse response of {values.size} samples from {path.name}, in its own scale, at the sampling rate of the "
        f"signals; time zero at index {centre}{assumed}."
    )


def _centred(values: np.ndarray, centre: int) -> np.ndarray:
    """Return `values` with zeros added so that index `centre` is at ``n // 2``."""
    if centre == values.size // 2:
        return values
    before, after = centre, values.size - 1 - centre
    half = max(before, after)
    return np.pad(values, (half - before, half - after))
