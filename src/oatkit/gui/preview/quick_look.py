"""A first picture of a scan, in a moment: coarse, but not negative."""

from typing import Any

import numpy as np

from oatkit.data import Image, Scan
from oatkit.gui.preview.coarse import coarsened
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.reconstruction import preprocess, reconstruct

PIXELS = 100
STEPS = 25
"""Of non-negative least squares, which has not converged by then, but shows what is there."""


def quick_look(scan: Scan, frame: int, pipeline: Pipeline) -> Image:
    """Return a coarse image of a frame over the field of view of a pipeline.

    Raises what running a pipeline raises.
    """
    coarse = Pipeline.load("nnls", [f"reconstruct.n_iterations={STEPS}"]).model_copy(update={"grid": _grid(pipeline)})
    grid = coarse.grid.grid()
    *_, images = reconstruct(coarse, coarsened(preprocess(coarse, scan, frame), grid), grid, Memo())
    return images["initial_pressure"]


def awaited(pipeline: Pipeline) -> Image:
    """Return an image without values where a first picture will be."""
    grid = _grid(pipeline).grid()
    return Image(np.full(grid.shape, np.nan, np.float32), "initial_pressure", "a.u.", grid)


def _grid(pipeline: Pipeline) -> Any:
    return pipeline.grid.model_copy(update={"pixels": PIXELS})
