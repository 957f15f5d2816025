"""The scale of an impulse response, one for the files of all formats."""

import numpy as np

from oatkit.errors import ReadError


def of_unit_peak(values: np.ndarray, origin: str) -> tuple[np.ndarray, float]:
    """Return a response ``(n,)`` divided by the largest magnitude of its spectrum, and that magnitude.

    The unit of a response is rarely known; so, images made with and without it have one scale. `origin` is the file
    and the place in it. Raises `ReadError` where the response is not finite, or all zeros.
    """
    if not np.isfinite(values).all():
        raise ReadError(f"{origin}: expected finite numbers, found {(~np.isfinite(values)).sum()} that are not")
    with np.errstate(over="ignore", invalid="ignore"):
        largest = float(np.max(abs(np.fft.rfft(values))))
    if not 0 < largest < float("inf"):
        raise ReadError(f"{origin}: expected an impulse response, found only zeros or numbers out of range")
    return values / largest, largest
