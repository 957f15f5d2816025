"""What tests of the window share: import this before anything of napari or Qt.

Where napari is missing the module that imports this is skipped; in CI it fails.
"""

import os
from collections.abc import Callable

import numpy as np
import pytest

if not os.environ.get("CI"):
    pytest.importorskip("napari", reason="needs the extra gui")

from napari.components import ViewerModel
from npe2 import PluginManager, PluginManifest
from qtpy.QtWidgets import QWidget

from oatkit import Grid, Image
from oatkit.gui.workbench import Workbench, workbench

__all__ = [
    "GRID", "WAVELENGTHS_NM", "PluginManager", "PluginManifest", "QWidget", "bench_without_window", "disc_boundary",
    "pressure", "wait_for",
]  # fmt: skip

GRID = Grid((20, 30), 2e-4, (1e-3, -5e-4))
"""Neither square nor centred, so that nothing turned or shifted looks right."""
WAVELENGTHS_NM = (700.0, 715.0, 900.0)


def bench_without_window() -> Workbench:
    """A workbench on a viewer that has no window, needs no display, and takes a few milliseconds."""
    return workbench(ViewerModel())


def pressure(seed: int = 0, wavelengths_nm: tuple[float, ...] = WAVELENGTHS_NM) -> Image:
    """Noise of both signs, with a share of zeros as non-negative methods leave them."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((max(1, len(wavelengths_nm)), *GRID.shape), np.float32)
    values[rng.random(values.shape) < 0.3] = 0.0
    return Image(values, "initial_pressure", "a.u.", GRID, wavelengths_nm)


def disc_boundary(radius_m: float = 1.5e-3) -> Image:
    """The signed distance to a circle about the middle of the grid."""
    y, x = GRID.y_m[:, None] - GRID.centre_m[0], GRID.x_m[None, :] - GRID.centre_m[1]
    return Image(np.hypot(y, x) - radius_m, "boundary", "m", GRID)


def wait_for(condition: Callable[[], bool], qtbot, seconds: float = 60) -> None:
    """Let the window live until a condition holds."""
    qtbot.waitUntil(condition, timeout=int(1e3 * seconds))
