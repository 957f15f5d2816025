"""How alike pulses are: the correlation of their signals, which neither knows nor cares how strong they are."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from oatkit.data import Geometry, Grid, Scan
from oatkit.errors import ReadError

BLOCK_S = 0.2e-6
"""Signals are averaged over this time before their differences are taken, s: 0.3 mm of water, a band about 2 MHz."""
NEIGHBOURS = 6


def signature(scan: Scan, frame: int, grid: Grid) -> np.ndarray:
    """Return what is compared of a frame: shape ``(wavelength, detector, block)``, zero for channels not to trust."""
    block = max(1, round(BLOCK_S * scan.geometry.sampling_rate_hz))
    reached = _reached(scan.geometry, grid, block)
    try:
        samples = scan.frame(frame).signals[0]
    except ReadError:  # whoever runs the frame says so
        return np.zeros((len(scan.wavelengths_nm), *reached.shape), np.float32)
    blocks = samples[..., : samples.shape[-1] // block * block].reshape(*samples.shape[:-1], -1, block)
    change = np.diff(blocks.mean(axis=-1, dtype=float), axis=-1) * reached
    trusted = scan.valid[frame] & np.isfinite(change).all(axis=-1)
    return np.where(trusted[..., None], change, 0).astype(np.float32)


def between_frames(pulses: Iterator[np.ndarray], count: int) -> np.ndarray:
    """Return how alike the pulses of each wavelength are: [d - 1, f] compares frame f with f + d, else it is NaN."""
    near: deque[np.ndarray] = deque(maxlen=NEIGHBOURS)
    pairs: np.ndarray | None = None
    for frame, pulse in enumerate(pulses):
        if pairs is None:
            pairs = np.full((NEIGHBOURS, count, len(pulse)), np.nan)
        for distance, other in enumerate(near, start=1):
            pairs[distance - 1, frame - distance] = _alike(other, pulse)
        near.appendleft(pulse)
    assert pairs is not None
    return pairs


def between_wavelengths(pulse: np.ndarray) -> np.ndarray:
    """Return how alike the wavelengths of one frame are, as `between_frames` does for one wavelength."""
    count = len(pulse)
    pairs = np.full((NEIGHBOURS, count, 1), np.nan)
    for distance in range(1, min(NEIGHBOURS, count - 1) + 1):
        pairs[distance - 1, : count - distance, 0] = _alike(pulse[:-distance], pulse[distance:])
    return pairs


def _reached(geometry: Geometry, grid: Grid, block: int) -> np.ndarray:
    """Return which differences of blocks a point of the grid can reach: bool, shape ``(detector, block - 1)``."""
    near, far = geometry.reach(grid)
    starts = geometry.times_s[::block][: geometry.n_samples // block] * geometry.speed_of_sound_m_s
    return (starts[:-1] >= near[:, None]) & (starts[1:] <= far[:, None])


def _alike(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the correlation of pulses, shape ``(n,)``, over the channels that neither lacks; NaN where none is."""
    both = np.any(a, axis=-1, keepdims=True) & np.any(b, axis=-1, keepdims=True)
    a, b = (np.where(both, x, 0).reshape(len(x), -1).astype(float) for x in (a, b))
    product = np.einsum("ij,ij->i", a, b)
    size = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return np.divide(product, size, out=np.full_like(product, np.nan), where=size > 0)
