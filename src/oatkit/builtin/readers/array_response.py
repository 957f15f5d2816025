"""The impulse response of a scan of plain arrays."""

from pathlib import Path

import numpy as np

from oatkit.builtin.readers.array_tables import ResponseTable
from oatkit.builtin.readers.number_files import read_numbers
from oatkit.builtin.readers.response_scale import of_unit_peak
from oatkit.errors import ReadError
from oatkit.hostile import inside


def impulse_response(table: ResponseTable | None, folder: Path) -> tuple[np.ndarray | None, str]:
    """Return the response, time zero at index ``n // 2``, with a note; None where there is none.

    It is scaled by `of_unit_peak`. Raises `ReadError` where the file holds no single response, or only zeros.
    """
    if table is None:
        return None, "There is no impulse response: signals are taken as the ideal ones."
    path = inside(folder, table.file)
    found = read_numbers(path, table.dataset)
    values = found.ravel()
    if values.size != max(found.shape):
        raise ReadError(
            f"{path}: expected one impulse response for all detectors, shape (n,), found the shape {found.shape}"
        )
    scaled, scale = of_unit_peak(values, str(path))
    if table.centre is not None and table.centre >= values.size:
        raise ReadError(f"{path}: the centre {table.centre} lies beyond the {values.size} samples of the response")
    centre = values.size // 2 if table.centre is None else table.centre
    assumed = ", the middle, assumed" if table.centre is None else ""
    return _centred(scaled, centre), (
        f"Impulse response of {values.size} samples from {path.name}, divided by {scale:.4g}, at the sampling rate of "
        f"the signals; time zero at index {centre}{assumed}."
    )


def _centred(values: np.ndarray, centre: int) -> np.ndarray:
    """Return `values` with zeros added so that index `centre` is at ``n // 2``."""
    if centre == values.size // 2:
        return values
    before, after = centre, values.size - 1 - centre
    half = max(before, after)
    return np.pad(values, (half - before, half - after))
