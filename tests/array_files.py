"""Files of plain arrays with their descriptions, for the tests of their reader."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile

from oatkit.builtin.readers.array_signals import AXES
from oatkit.builtin.readers.plain_array import PlainArray
from oatkit.errors import ReadError

LENGTHS = {"frame": 4, "wavelength": 2, "detector": 5, "sample": 7}
LETTERS = {"frame": "f", "wavelength": "w", "detector": "d", "sample": "s"}
ARC = "[arc]\nradius_mm = 40.5\ncoverage_degrees = 270\ncount = {count}\n"
POSITIONS = '[detectors]\npositions = "{file}"\nunit = "m"\n'


def numbers(axes=AXES, dtype="u2") -> tuple[np.ndarray, np.ndarray]:
    """Signals that tell their place, as a file with `axes` holds them and in the order of a scan."""
    lengths = [LENGTHS[axis] if axis in axes else 1 for axis in AXES]
    frame, wavelength, detector, sample = np.ogrid[tuple(slice(n) for n in lengths)]
    whole = (1000 * frame + 100 * wavelength + 10 * detector + sample).astype(dtype)
    kept = whole[tuple(slice(None) if axis in axes else 0 for axis in AXES)]
    letters = "".join(LETTERS[axis] for axis in AXES if axis in axes)
    return np.einsum(f"{letters}->{''.join(LETTERS[axis] for axis in axes)}", kept), whole


def describe(folder: Path, file="scan.npy", axes=AXES, rest=None, **keys) -> Path:
    """Write a description of signals of `LENGTHS` on an arc; `keys` replace those of ``[signals]``."""
    folder.mkdir(exist_ok=True)
    table = {
        "file": f'"{file}"',
        "axes": str(list(axes)),
        "wavelengths_nm": "[700, 730]" if "wavelength" in axes else "[700]",
        "sampling_rate_mhz": "40",
    } | keys
    lines = [f"{key} = {value}" for key, value in table.items() if value is not None]
    rest = ARC.format(count=5 if "detector" in axes else 1) if rest is None else rest
    path = folder / "scan.toml"
    path.write_text("\n".join(["[signals]", *lines, rest]))
    return path


def saved(folder: Path, array=None, **options) -> Path:
    """Write signals and their description."""
    toml = describe(folder, **options)
    np.save(folder / "scan.npy", numbers()[0] if array is None else array)
    return toml


def refuses(toml: Path, *words: str) -> None:
    """The reader refuses the description, with all of these words."""
    with pytest.raises(ReadError) as caught:
        PlainArray().read(toml)
    for word in words:
        assert word in str(caught.value)


def write_plain(path, stored):
    """As tifffile does by default."""
    tifffile.imwrite(path, stored, photometric="minisblack")


def write_scattered(path, stored):
    """Big-endian BigTIFF, each page with its tags before the next."""
    with tifffile.TiffWriter(path, bigtiff=True, byteorder=">") as file:
        for page in stored.reshape(-1, *stored.shape[-2:]):
            file.write(page, contiguous=False, photometric="minisblack", metadata=None)


def write_mat(path: Path, **arrays) -> None:
    """Write arrays as HDF5 holds those of MATLAB's version 7.3."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file[name] = values
