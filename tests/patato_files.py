"""HDF5 files as PATATO writes them, by the description of the format and PATATO's own writer."""

from pathlib import Path

import h5py
import numpy as np

FRAMES, WAVELENGTHS, DETECTORS, SAMPLES = 3, 2, 16, 40
SHAPE = (FRAMES, WAVELENGTHS, DETECTORS, SAMPLES)
RING = np.array([(0.04 * np.cos(a), 0.04 * np.sin(a), 0.0) for a in np.linspace(-0.8, 4.0, DETECTORS)])
"""Detectors on an arc open at the bottom, (x, y, z), m."""
YEAR_2020_TICKS = 637_371_523_560_823_431
"""Of 100 ns since the year 1: 1 October 2020, 12:32:36."""
RESULT_ATTRIBUTES = {
    "RECONSTRUCTION_NX": 9,
    "RECONSTRUCTION_NY": 7,
    "RECONSTRUCTION_NZ": 1,
    "RECONSTRUCTION_FIELD_OF_VIEW_X": 0.008,
    "RECONSTRUCTION_FIELD_OF_VIEW_Y": 0.006,
    "RECONSTRUCTION_FIELD_OF_VIEW_Z": 0.0,
    "RECONSTRUCTION_ALGORITHM": b"Model Based",
    "PREPROCESSING_ALGORITHM": b"Default Preprocessor",
    "FILTER_LOW_PASS": 7e6,
    "FILTER_HIGH_PASS": 5e3,
    "IRF": True,
    "HILBERT_TRANSFORM": True,
    "INTERPOLATE_TIME": 3,
    "INTERPOLATE_DETECTORS": 2,
    "ENVELOPE_DETECTION": np.nan,
    "speedofsound": 1469.0,
    "fs": 120e6,
}
HAND_DRAWN = np.array([[0.001, 0.002], [0.0031, 0.0019], [0.0012, 0.0033], [0.0029, 0.0041], [0.0007, 0.0021]])
"""(x, y), m; its sides cross."""


def raw_data(shape=SHAPE, seed=5) -> np.ndarray:
    """Signals of uint16, the largest and the smallest value among them."""
    raw = np.random.default_rng(seed).integers(0, 2**16, shape, dtype="u2")
    raw.flat[:2] = 0, 2**16 - 1
    return raw


def per_pulse(first: float, step: float, dtype=float) -> np.ndarray:
    """A number for each pulse."""
    return (first + step * np.arange(FRAMES * WAVELENGTHS)).reshape(FRAMES, WAVELENGTHS).astype(dtype)


def response() -> np.ndarray:
    """An impulse response with its peak in the middle, at index 20 of 40."""
    t = np.arange(SAMPLES) - SAMPLES // 2
    return np.exp(-0.5 * (t / 1.5) ** 2) * np.cos(t)


def write_patato(path: Path, raw: np.ndarray | None = None, results: bool = True) -> Path:
    """Write a file with everything in it; `raw` are other signals of the same shape."""
    with h5py.File(path, "w") as file:
        write_scan_part(file, raw_data() if raw is None else raw)
        if results:
            write_results(file)
    return path


def write_scan_part(file: h5py.File, raw: np.ndarray) -> None:
    """Raw data and what belongs to them, in the order in which PATATO writes them."""
    file.attrs["date"] = "2020-10-01 12:32:32.123456"
    file["raw_data"] = raw
    for item in (file["raw_data"], file):
        item.attrs["name"] = "201001_05"
        item.attrs["fs"] = 40e6
    for name, values in {
        "TEMPERATURE": per_pulse(33.0, 0.01),
        "OverallCorrectionFactor": per_pulse(1193.8, 7.0),
        "Z-POS": per_pulse(59.65, 0.5),
        "RUN": per_pulse(1, 0, "i8"),
        "REPETITION": per_pulse(1, 1, "i8"),
        "timestamp": YEAR_2020_TICKS + (10**6 * np.arange(FRAMES * WAVELENGTHS, dtype="u8")).reshape(FRAMES, -1),
        "GEOMETRY": RING,
        "irf": response(),
    }.items():
        file.create_dataset(name, data=values, compression="gzip")
    file["wavelengths"] = np.array([700.0, 850.0])
    file.create_dataset("water-absorption-coefficients", data=[0.647, 4.0], compression="gzip")
    file["water-absorption-coefficients"].attrs["pathlength"] = 0.03
    file.attrs["comment"] = ""
    file["ultraSound-frame-offset"] = per_pulse(-1, 0, "i8")


def planes(n: int, seed: int = 1) -> np.ndarray:
    """Images (frame, n, z, y, x) of one plane of 7 x 9 pixels, a NaN among them."""
    values = np.random.default_rng(seed).standard_normal((FRAMES, n, 1, 7, 9)).astype("f4")
    values[:, :, 0, 2, 3] = np.nan
    return values


def write_results(file: h5py.File) -> None:
    """Every kind of result, and regions of interest."""
    for name, values, more in [
        ("recons/Model Based/0", planes(2), {"wavelengths": [700.0, 850.0]}),
        ("recons/Model Based/1", planes(2, 2), {}),
        ("unmixed/Model Based/0", planes(2, 3), {"SPECTRA": [b"Hb", b"HbO2"], "WAVELENGTHS": [700.0, 850.0]}),
        ("so2/Model Based/0", planes(1, 4), {"SPECTRA": ["Hb", "HbO2"]}),
        ("thb/Model Based/0", planes(1, 5), {"SPECTRA": '["Hb", "HbO2"]'}),
        ("dso2/Model Based/0", planes(1, 6)[0, 0], {}),
    ]:
        add_result(file, name, values, **more)
    add_roi(file, "tumour_left", HAND_DRAWN)
    add_roi(file, "tumour_left", HAND_DRAWN[:4] * [-1, 1], run=2)
    add_roi(file, "reference_", np.array([[0.0, 0.0], [1e-3, 0.0], [1e-3, 1e-3]], "f4"))


def add_result(file: h5py.File, name: str, values: np.ndarray, **more) -> None:
    """Add images with the attributes of PATATO."""
    file[name] = values
    file[name].attrs.update({**RESULT_ATTRIBUTES, **more})


def add_roi(file: h5py.File, name: str, vertices: np.ndarray, run: int = 1) -> None:
    """Add a polygon (x, y), m, under the next number."""
    group = file.require_group(f"rois/{name}")
    number = str(len(group))
    group[number] = vertices
    label, position = name.split("_")
    group[number].attrs.update(
        {"class": label, "position": position, "z": 59.65, "run": run, "repetition": 1, "generated": False}
    )
