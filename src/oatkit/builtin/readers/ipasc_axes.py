"""The axes of an IPASC file: of its signals, and of what it says of each pulse."""

import numpy as np

from oatkit.builtin.readers.hdf5_signals import Axes


def find_axes(shape: tuple[int, ...], detectors: int, wavelengths: int) -> tuple[Axes, bool] | None:
    """Return which axis of the signals holds what, and whether all are turned around; None where they do not fit.

    The layout's order is (detector, sample, wavelength, frame), of which the last ones may be missing; MATLAB writes
    the reverse. A third axis that is no wavelengths counts frames.
    """
    for turned in (False, True):
        forward = shape[::-1] if turned else shape
        axes = _forward(forward, detectors, wavelengths)
        if axes is not None:
            return (_turned_around(axes, len(shape)) if turned else axes), turned
    return None


def _turned_around(axes: Axes, ndim: int) -> Axes:
    frame, wavelength, detector, sample = (None if axis is None else ndim - 1 - axis for axis in axes)
    return (frame, wavelength, detector, sample)


def _forward(shape: tuple[int, ...], detectors: int, wavelengths: int) -> Axes | None:
    """Return the axes of frame, wavelength, detector and sample in a shape of the layout's order."""
    if not 2 <= len(shape) <= 4 or shape[0] != detectors:
        return None
    further = shape[2:]
    if len(further) == 1 and wavelengths == 1:
        return (2, None, 0, 1)
    if (further or (1,))[0] != wavelengths:
        return None
    return (3 if len(further) == 2 else None, 2 if further else None, 0, 1)


def by_pulse(values: np.ndarray, frames: int, wavelengths: int) -> np.ndarray | None:
    """Return values as (frame, wavelength), or None where their axes cannot be told.

    Taken are one value for all pulses, for each frame, for each wavelength, or for each pulse: an array in the order
    of the signals' axes, or in the other order where that alone fits, or a flat one where frames or wavelengths are
    one.
    """
    values, shape = np.squeeze(values), (frames, wavelengths)
    if values.size == 1:
        return np.full(shape, values.item())
    if 1 in shape and values.size == frames * wavelengths:
        return values.reshape(shape)
    if values.shape in (shape, shape[::-1]):
        return values.T if values.shape == shape[::-1] else values
    if frames != wavelengths and values.shape in ((frames,), (wavelengths,)):
        return np.broadcast_to(values[:, None] if len(values) == frames else values, shape)
    return None
