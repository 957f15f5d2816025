"""All that the author of a plugin imports.

A plugin is a frozen class derived from the base class of its kind, with a ``name`` and with fields declared by
`param`; a function marked `hookimpl` returns it (see `oatkit.hookspecs`), and an entry point of the group ``oatkit``
names the module that holds the function. A class is abstract or final: derive from the base classes here, not from
another plugin.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pluggy

from oatkit.checkpoint import checkpoint
from oatkit.data import Detectors, Geometry, Grid, Image, Optics, Scan, Signals
from oatkit.errors import OatkitError, PluginError, ReadError, SolverError, ValidationError
from oatkit.parameters import Parameters, param
from oatkit.problem import Calibration, Iterate, Problem, UnmixProblem
from oatkit.scale import Reference
from oatkit.shapes import EllipseRegion, PolygonRegion, RectangleRegion, Region

__all__ = [
    "API_VERSION", "KINDS", "Calibration", "Detectors", "EllipseRegion", "FluenceModel", "ForwardModel", "Geometry",
    "Grid", "Image", "Iterate", "OatkitError", "Optics", "Plugin", "PluginError", "PolygonRegion", "Preprocessor",
    "Problem", "Proximable", "Quadratic", "ReadError", "Reader", "RectangleRegion", "Reference", "Region",
    "Regularizer", "Scan", "Segmenter", "Signals", "Smooth", "Solver", "SolverError", "UnmixProblem", "Unmixer",
    "ValidationError", "Weight", "hookimpl", "param",
]  # fmt: skip

hookimpl = pluggy.HookimplMarker("oatkit")

API_VERSION = (1, 0)
"""Of all in this module. The second number rises when something is added, the first when something is taken away.

A package that says what it was made for, ``OATKIT_API = (1, 0)`` in the module that its entry point names, is refused
with a sentence by an oatkit that does not have it."""

Weight = float | Literal["l-curve", "hold-out"]
"""Type of a solver's weight: a number above 0, or the rule of `oatkit.weights` that chooses it."""


class Plugin(Parameters, ABC):
    """What all plugins are: a frozen set of parameters with a name, picklable and hashable."""


class Reader(Plugin):
    """Reads scans of one file format, and what else such files hold: finished images, regions of interest."""

    kind: ClassVar[str] = "reader"

    @abstractmethod
    def can_read(self, path: Path) -> bool:
        """Say whether this reader claims `path`, by its name and first bytes; never raises."""

    @abstractmethod
    def read(self, path: Path) -> Scan:
        """Return the scan in `path`, its signals lazily where the format allows. Raises `ReadError`."""

    def images(self, path: Path) -> Mapping[str, Sequence[Image]]:
        """Return the finished images in or beside `path` by name, each a sequence with one image for each frame.

        A sequence reads an image when it is asked for it. Raises `ReadError`.
        """
        return {}

    def regions(self, path: Path) -> tuple[Region, ...]:
        """Return the regions of interest in or beside `path`. Raises `ReadError`."""
        return ()


class Preprocessor(Plugin):
    """Turns raw signals into cleaner ones.

    It gets a scan of one frame. The geometry of what it returns may depend on the geometry and the parameters alone,
    never on the signals, since the operator is built once for a scan: a filter convolves its response into
    ``geometry.impulse_response``. Records may become shorter (a crop moves ``start_time_s`` and ``n_samples``); frames,
    wavelengths and detectors stay. Channels not to be trusted are marked in ``scan.valid``. Bad signals are a
    `ReadError`, bad parameters a `ValidationError`.
    """

    kind: ClassVar[str] = "preprocessor"

    @abstractmethod
    def process(self, scan: Scan) -> Scan:
        """Return the processed scan; its notes say what was found."""


class ForwardModel(Plugin):
    """Predicts the signals of an image."""

    kind: ClassVar[str] = "forward_model"

    @abstractmethod
    def operator(self, geometry: Geometry, grid: Grid) -> Any:
        """Return a scipy ``LinearOperator`` from the raveled image (y, x) to the raveled record (detector, sample).

        ``rmatvec`` is its exact adjoint. An operator that holds much memory says so in ``nbytes``. Raises
        `ValidationError` where the grid cannot be seen.
        """


class Regularizer(Plugin):
    """A penalty on an image. Derive from one or more of its abilities: `Smooth`, `Proximable`, `Quadratic`."""

    kind: ClassVar[str] = "regularizer"
    degree: ClassVar[int]
    """How the penalty grows with the image: 1 for entropy, L1 and TV, 2 for quadratic ones."""

    @abstractmethod
    def value(self, image: np.ndarray) -> float:
        """Return the unweighted penalty of an image of shape ``(y, x)``."""


class Smooth(Regularizer):
    """A regularizer with a gradient."""

    @abstractmethod
    def gradient(self, image: np.ndarray) -> np.ndarray:
        """Return the gradient of `value`, of the shape of the image."""


class Proximable(Regularizer):
    """A regularizer with a proximal map."""

    @abstractmethod
    def prox(self, image: np.ndarray, step: float) -> np.ndarray:
        """Return the u that minimises ``|u - image|^2 / 2 + step * value(u)``."""


class Quadratic(Regularizer):
    """A regularizer of the form |L x|^2."""

    degree: ClassVar[int] = 2

    @abstractmethod
    def operator(self, shape: tuple[int, int]) -> Any:
        """Return L for images of `shape`: something with ``shape``, ``matvec`` and ``rmatvec``, as in scipy."""


class Solver(Plugin):
    """Turns data into an image.

    A solver that weighs a penalty has a field ``weight: Weight`` and one ``scaling``: "relative" reads the weight as
    the dimensionless tau = w / (|A|^2 x_ref^(2 - degree)), "absolute" as the w of the formula.
    """

    kind: ClassVar[str] = "solver"

    @abstractmethod
    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the state after each step; the last one says whether and why it ended. At least one is yielded.

        Raises `ValidationError` where the weight is still the name of a rule, `SolverError` where no finite image
        comes out.
        """

    def solve(self, problem: Problem) -> Iterate:
        """Run to the end and return the last state."""
        last = None
        for state in self.iterate(problem):
            checkpoint()
            last = state
        if last is None:
            raise PluginError(f"solver '{self.name}' ended without yielding an image")
        return last


class Segmenter(Plugin):
    """Finds the boundary of the body."""

    kind: ClassVar[str] = "segmenter"

    @abstractmethod
    def segment(self, image: Image) -> Image:
        """Return the signed distance to the boundary, m, negative inside, as an image named ``boundary``."""


class FluenceModel(Plugin):
    """Predicts how much light reaches each pixel."""

    kind: ClassVar[str] = "fluence_model"

    @abstractmethod
    def fluence(self, boundary: Image, optics: Optics) -> Image:
        """Return the fluence relative to the incident one, for each wavelength of `optics`."""


class Unmixer(Plugin):
    """Turns images at many wavelengths into images of chromophores."""

    kind: ClassVar[str] = "unmixer"

    @abstractmethod
    def unmix(self, problem: UnmixProblem) -> Mapping[str, Image]:
        """Return images by name: one for each chromophore, and what is derived from them."""

    def calibrate(self, problem: UnmixProblem) -> Calibration:
        """Return the calibration at which the images agree best with what the unmixer knows of spectra.

        An unmixer need not be able to do this; then it raises `ValidationError`.
        """
        raise ValidationError(
            f"unmixer '{self.name}' finds no calibration by the spectra; take 'fluence-corrected', or give the number "
            "absorption.calibration"
        )


KINDS: Mapping[str, type[Plugin]] = {
    base.kind: base
    for base in (Reader, Preprocessor, ForwardModel, Solver, Regularizer, Segmenter, FluenceModel, Unmixer)
}
"""The base class of each kind."""
