"""Hand-written IPASC files, as small as they can be, by h5py alone."""

from pathlib import Path

import h5py
import numpy as np

ARC = np.array([(0.04 * np.cos(a), 0.04 * np.sin(a), 0.0) for a in np.linspace(0.3, 5.0, 5)])
"""Five detectors on an arc, (x, y, z), m."""
SHAPE = (5, 8, 2, 3)
"""Detectors, samples, wavelengths, frames."""


def samples(shape=SHAPE, dtype="u2") -> np.ndarray:
    """Signals of which no two are equal, in the order of the file's axes."""
    return np.arange(np.prod(shape)).reshape(shape).astype(dtype)


def as_scan(values: np.ndarray) -> np.ndarray:
    """Signals of four axes in the order of a scan's."""
    return values.transpose(3, 2, 0, 1)


def fields(**changes) -> dict:
    """Fields of ``/meta_data``; those set to None are left out."""
    usual = {
        "ad_sampling_rate": 40e6,
        "acquisition_wavelengths": np.array([700e-9, 813.5e-9]),
        "speed_of_sound": 1480.0,
    }
    return {name: value for name, value in (usual | changes).items() if value is not None}


def write(path: Path, signals=None, points=ARC, names="{:010}", device=None, **changes) -> Path:
    """Write a file; `names` says how detectors are called, `device` are fields of ``general``."""
    with h5py.File(path, "w") as file:
        file["binary_time_series_data"] = samples() if signals is None else signals
        for name, value in fields(**changes).items():
            file[f"meta_data/{name}"] = value
        for name, value in (device or {}).items():
            file[f"meta_data_device/general/{name}"] = value
        for number, point in enumerate(points):
            name = names.format(number) if isinstance(names, str) else names[number]
            file[f"meta_data_device/detectors/{name}/detector_position"] = point
    return path


def write_as_matlab_does(path: Path, signals: np.ndarray, **changes) -> Path:
    """Write a file as the consortium's MATLAB program does.

    Axes reversed and the last ones dropped where they are of length one, numbers as matrices, texts of variable
    length as matrices of one element, names of detectors with a prefix.
    """
    given = fields(**changes)
    shape = signals.shape
    while len(shape) > 2 and shape[-1] == 1:
        shape = shape[:-1]
    with h5py.File(path, "w") as file:
        file["binary_time_series_data"] = signals.reshape(shape).T
        for name, value in given.items():
            if isinstance(value, str):
                file.create_dataset(f"meta_data/{name}", (1, 1), h5py.string_dtype())[0, 0] = value
            else:
                file[f"meta_data/{name}"] = np.atleast_2d(value).T
        for number, point in enumerate(ARC):
            file[f"meta_data_device/detectors/deleteme{number:010}/detector_position"] = point[:, None]
            file[f"meta_data_device/detectors/deleteme{number:010}/detector_geometry"] = np.zeros((3, 1))
    return path
