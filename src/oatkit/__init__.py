"""Optoacoustic tomography: from a scan to non-negative images, by plugins.

>>> import oatkit
>>> scan = oatkit.read("Scan_9.msot")                    # doctest: +SKIP
>>> result = oatkit.run(oatkit.Pipeline.load("maxent"), scan)   # doctest: +SKIP
>>> result["initial_pressure"].values.min() >= 0         # doctest: +SKIP
True
"""

from oatkit.batch import run_frames
from oatkit.data import Detectors, Geometry, Grid, Image, Optics, Scan
from oatkit.engine import run
from oatkit.engine.stepping import steps
from oatkit.errors import OatkitError, PluginError, ReadError, ResultError, SolverError, ValidationError
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.reading import read, read_images, read_regions
from oatkit.registry import plugin
from oatkit.result import Result
from oatkit.store import load, verify

__version__ = "0.1.0"

__all__ = [
    "Detectors", "Geometry", "Grid", "Image", "Memo", "OatkitError", "Optics", "Pipeline", "PluginError", "ReadError",
    "Result", "ResultError", "Scan", "SolverError", "ValidationError", "load", "plugin", "read", "read_images",
    "read_regions", "run", "run_frames", "steps", "verify",
]  # fmt: skip
