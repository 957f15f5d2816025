"""A first picture of a scan, in a moment: its coarse back-projection."""

from typing import Any

import numpy as np

from oatkit.data import Image, Scan
from oatkit.engine import run
from oatkit.pipeline import Pipeline

PIXELS = 100
BAND_MHZ = 2.5
"""What so few pixels can hold over the field of view of the presets."""


def quick_look(scan: Scan, frame: int, pipeline: Pipeline) -> Image:
    """Return the back-projection of a frame over the field of view, and with the speed of sound, of a pipeline.

    Raises what running a pipeline raises.
    """
    coarse = Pipeline.load("backprojection", (f"grid.pixels={PIXELS}", f"preprocess.band-pass.high={BAND_MHZ}"))
    return run(coarse.model_copy(update={"grid": _grid(pipeline)}), scan, frame)["initial_pressure"]


def awaited(pipeline: Pipeline) -> Image:
    """Return an image without values where a first picture will be."""
    grid = _grid(pipeline).grid()
    return Image(np.full(grid.shape, np.nan, np.float32), "initial_pressure", "a.u.", grid)


def _grid(pipeline: Pipeline) -> Any:
    return pipeline.grid.model_copy(update={"pixels": PIXELS})
