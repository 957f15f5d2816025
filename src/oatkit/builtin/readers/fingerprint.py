"""Telling files of signals apart without reading all of them."""

import hashlib
from pathlib import Path

import numpy as np

BLOCKS = 64
BLOCK_BYTES = 4096


def sampled_fingerprint(path: Path, salt: bytes = b"") -> str:
    """Return the SHA-256, in hexadecimal, of `salt`, the size of a file and 64 evenly spaced blocks of 4 KiB.

    The first and the last block are among them. A file of up to 256 KiB is read whole; in a larger one, a change
    between the blocks goes unseen. Raises `OSError`.
    """
    size = path.stat().st_size
    digest = hashlib.sha256(salt + b"%d:" % size)
    with open(path, "rb") as file:
        for start in np.unique(np.linspace(0, max(0, size - BLOCK_BYTES), BLOCKS).astype(int)):
            file.seek(start)
            digest.update(file.read(BLOCK_BYTES))
    return digest.hexdigest()
