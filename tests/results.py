"""Results for the tests of store and export: small, seeded, with negative pixels and pixels without a value."""

from pathlib import Path
from typing import Any

import numpy as np

from oatkit.data import Grid, Image
from oatkit.result import Result
from oatkit.store import StoreWriter

GRID = Grid((24, 30), 1.25e-4, (2e-3, -1e-3))
WAVELENGTHS_NM = (700.0, 757.5)


def pressure(seed: int = 0) -> Image:
    """A noisy initial pressure in float64 with a bright pixel in the lower left corner."""
    values = np.random.default_rng(seed).standard_normal((2, *GRID.shape))
    values[:, 0, 0] = 9.0
    history = ({"step": "preprocess", "use": "band-pass", "low": 0.1}, {"step": "reconstruct", "prior": (1, 2.5)})
    found = {"relative_gap": (3.4e-5, float("inf")), "converged": (True, False), "reason": ("", "slow")}
    return Image(values, "initial_pressure", "a.u.", GRID, WAVELENGTHS_NM, history, found)


def absorption(seed: int = 1) -> Image:
    """A float32 image that is NaN outside a disc."""
    y, x = np.meshgrid(GRID.y_m - GRID.centre_m[0], GRID.x_m - GRID.centre_m[1], indexing="ij")
    values = np.random.default_rng(seed).random((2, *GRID.shape), np.float32)
    return Image(np.where(np.hypot(y, x) < 1e-3, values, np.float32("nan")), "absorption", "1/m", GRID, WAVELENGTHS_NM)


def make_result(seed: int = 0, **changes: Any) -> Result:
    """A result of two images; `changes` are fields of `Result`."""
    fields: dict[str, Any] = {
        "images": {"initial_pressure": pressure(seed), "absorption": absorption(seed)},
        "pipeline": {"reconstruct": {"use": "maxent-nlcg", "weight": 0.00923}, "preprocess": ({"use": "offset"},)},
        "requested": {"reconstruct": {"use": "maxent-nlcg", "weight": "l-curve"}},
        "versions": {"oatkit": "0.1.0", "python": "3.11"},
        "scan": {"name": "Scan_9", "source": "", "speed_of_sound_m_s": 1469.3, "speed_of_sound_source": "header"},
        "seconds": {"reconstruct": 1.25},
        "warnings": ("one channel is dead",),
        "frame_index": seed,
        "weight_choice": {"rule": "l-curve", "weights": (1e-3, 1e-2)},
    }
    return Result(**{**fields, **changes})


def write_frames(path: Path, *frames: Result | str | BaseException, overwrite: bool = False) -> Path:
    """Write results and the reasons of failed frames to a folder in this order; an exception is raised in its turn."""
    with StoreWriter(path, len(frames), overwrite=overwrite) as writer:
        for index, frame in enumerate(frames):
            if isinstance(frame, BaseException):
                raise frame
            if isinstance(frame, str):
                writer.fail(index, frame)
            else:
                writer.write(index, frame)
    return path
