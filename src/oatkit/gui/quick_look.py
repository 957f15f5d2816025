"""A first picture of a scan, in a moment: coarse, but not negative."""

from typing import Any

import numpy as np

from oatkit.data import Image, Scan
from oatkit.engine import run
from oatkit.pipeline import Pipeline

PIXELS = 100
STEPS = 12
"""Of non-negative least squares, which has not converged by then, but shows what is there."""
BAND_MHZ = 2.5
"""What so few pixels can hold over the field of view of the presets."""


def quick_look(scan: Scan, frame: int, pipeline: Pipeline) -> Image:
    """Return a coarse image of a frame over the field of view of a pipeline.

    Raises what running a pipeline raises.
    """
    changes = (f"preprocess.band-pass.high={BAND_MHZ}", f"reconstruct.n_iterations={STEPS}")
    coarse = Pipeline.load("nnls", changes)
    return run(coarse.model_copy(update={"grid": _grid(pipeline)}), scan, frame)["initial_pressure"]


def awaited(pipeline: Pipeline) -> Image:
    """Return an image without values where a first picture will be."""
    grid = _grid(pipeline).grid()
    return Image(np.full(grid.shape, np.nan, np.float32), "initial_pressure", "a.u.", grid)


def _grid(pipeline: Pipeline) -> Any:
    return pipeline.grid.model_copy(update={"pixels": PIXELS})
