"""Where the public names come from: read by `lazy_loader.attach_stub` and by type checkers."""

from .batch import run_frames
from .data import Detectors, Geometry, Grid, Image, Optics, Scan
from .engine import run
from .engine.stepping import steps
from .errors import OatkitError, PluginError, ReadError, ResultError, SolverError, ValidationError
from .memo import Memo
from .pipeline import Pipeline
from .reading import read, read_images, read_regions
from .registry import plugin
from .result import Result
from .store import load, verify

__version__: str

__all__ = [
    "Detectors",
    "Geometry",
    "Grid",
    "Image",
    "Memo",
    "OatkitError",
    "Optics",
    "Pipeline",
    "PluginError",
    "ReadError",
    "Result",
    "ResultError",
    "Scan",
    "SolverError",
    "ValidationError",
    "load",
    "plugin",
    "read",
    "read_images",
    "read_regions",
    "run",
    "run_frames",
    "steps",
    "verify",
]
