"""Arrays of numbers in MATLAB's files of version 7.3, which are HDF5."""

from pathlib import Path

import numpy as np

from oatkit.errors import ReadError
from oatkit.hostile import hdf5_dataset, open_hdf5, regular_file

OLDER = b"MATLAB 5.0"
"""How the files of MATLAB's versions 5 to 7.2 begin."""


def read_mat(path: Path, dataset: str, limit: int) -> np.ndarray:
    """Return a matrix of at most `limit` bytes, rows and columns as in MATLAB. Raises `ReadError`."""
    with open(regular_file(path), "rb") as file:
        if file.read(len(OLDER)) == OLDER:
            raise ReadError(f"{path}: expected a MATLAB file of version 7.3, found an older one; save it with '-v7.3'")
    with open_hdf5(path) as file:
        # MATLAB lets the first index run fastest, HDF5 the last.
        return np.asarray(hdf5_dataset(file, dataset, "fiu", 2, limit)[()]).T
