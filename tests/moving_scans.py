"""Scans of a body that moves, changes or rests: linear combinations of signals that are simulated once."""

from functools import cache

import numpy as np

from oatkit import Geometry, Grid, Scan, plugin
from oatkit.simulate import arc_detectors, breast, useful_window
from oatkit.simulate.raster import area_average

GEOMETRY = Geometry(arc_detectors(48, 0.0405, 270), 20e6, 1015, speed_of_sound_m_s=1500)
GRID = Grid((160, 160), 25e-3 / 160)
TISSUE = np.array([1.0, 0.8, 0.7, 0.75])
VESSELS = np.array([0.3, 0.2, 0.25, 0.4])
"""How strong the two are at the wavelengths of the scans."""
DIRECTIONS = ((1.0, 0.0), (0.5, 0.8660254), (-0.8660254, 0.5))


@cache
def parts(move_m: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Signals of tissue and of vessels after a move (y, x): shape ``(2, detector, sample)``."""
    operator = plugin("forward_model", "arc")().operator(GEOMETRY, GRID)
    grid = Grid(GRID.shape, GRID.pixel_size_m, (-move_m[0], -move_m[1]))
    images = (breast(grid).values[0], area_average(_vessels, grid))
    return np.stack([operator.matvec(image.ravel()).reshape(GEOMETRY.shape) for image in images])


def _vessels(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(5)
    discs = np.column_stack([rng.uniform(-6e-3, 6e-3, (12, 2)), rng.uniform(0.2e-3, 0.6e-3, 12)])
    return np.any([np.hypot(y - v, x - u) <= r for v, u, r in discs], axis=0).astype(float)


def pulses(tissue: np.ndarray, vessels: np.ndarray, move_m: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Noise-free signals of pulses with these strengths."""
    mixture = np.stack(np.broadcast_arrays(tissue, vessels), axis=-1)
    return np.tensordot(mixture, parts(move_m), axes=1).astype(np.float32)


def at_rest(frames: int) -> np.ndarray:
    """Noise-free signals of frames that are all alike."""
    return np.repeat(pulses(TISSUE, VESSELS)[None], frames, axis=0)


def noisy_scan(clean: np.ndarray, snr_db: float, seed: int, **fields) -> Scan:
    """A scan with noise of this level over the samples that the field of view reaches."""
    level = np.sqrt((clean[..., useful_window(GEOMETRY, GRID)] ** 2).mean()) * 10 ** (-snr_db / 20)
    noise = level * np.random.default_rng(seed).standard_normal(clean.shape, dtype=np.float32)
    return Scan(clean + noise, GEOMETRY, tuple(700.0 + 50 * i for i in range(clean.shape[1])), **fields)
