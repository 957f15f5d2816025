"""What a solver gets and what it yields."""

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from oatkit.checked import as_data, as_operator, as_product, as_shape, as_start, as_valid
from oatkit.data import Geometry, Grid, Image, Optics
from oatkit.errors import SolverError, ValidationError
from oatkit.scale import Reference, recall_norm, reference, remember_norm, returned, spectral_norm

LARGEST_WEIGHT = 1e300


@dataclass(frozen=True, eq=False)
class Problem:
    """Find an image x of ``shape`` with ``operator @ x.ravel()`` near ``data``.

    Raises `ValidationError` where the sizes do not fit together, or the data are none, not finite or not real.
    """

    operator: Any
    """Anything with ``shape``, ``matvec`` and ``rmatvec``, or that scipy's ``aslinearoperator`` takes: a matrix, a
    sparse matrix, a ``LinearOperator``."""
    data: np.ndarray
    """The measured signals, raveled."""
    shape: tuple[int, int]
    """Shape of the image, ``(ny, nx)``."""
    geometry: Geometry | None = None
    """Where the data come from; only for solvers that are no inversion of an operator (back-projection)."""
    grid: Grid | None = None
    """Where the image lies; likewise."""
    valid: np.ndarray | None = None
    """Which detectors count, bool, shape ``(detector,)``; None where all do. In the rows of the others operator and
    data are zero: an inversion need not look at it, a sum over detectors must."""
    start: np.ndarray | None = None
    """An image of nearby data or of another weight, where there is one: in a scan that of the wavelength before, in the
    same frame. A solver may begin near it to have fewer steps to go; what it solves does not depend on it."""

    def __post_init__(self) -> None:
        checked = {
            "operator": as_operator(self.operator),
            "data": as_data(self.data),
            "shape": as_shape(self.shape),
            "valid": as_valid(self.valid, self.geometry),
            "start": as_start(self.start, self.shape),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        rows, columns = self.operator.shape
        if rows != self.data.size or columns != self.shape[0] * self.shape[1]:
            raise ValidationError(
                f"problem: an operator of shape {(rows, columns)} does not map an image of shape {self.shape} "
                f"to {self.data.size} data"
            )
        if self.geometry and self.geometry.shape[0] * self.geometry.shape[1] != rows:
            raise ValidationError(f"problem: a geometry of shape {self.geometry.shape} does not fit {rows} data")
        if self.grid and self.grid.shape != self.shape:
            raise ValidationError(f"problem: a grid of shape {self.grid.shape} does not fit an image of {self.shape}")

    def near(self, image: np.ndarray) -> "Problem":
        """Return the same problem with a start, with what is known of its scale; as it is where the image is not finite
        or of another shape.
        """
        if np.shape(image) != self.shape or not np.isfinite(image).all():
            return self
        made = replace(self, start=image)
        known = ("back_projected", "_norm", "_reference")
        made.__dict__.update({name: self.__dict__[name] for name in known if name in self.__dict__})
        return made

    def forward(self, image: np.ndarray) -> np.ndarray:
        """Return A x as float64, raveled. Raises `SolverError` where it is not finite."""
        return as_product(self.operator.matvec(np.ravel(image)), self.data.size).ravel()

    def adjoint(self, data: np.ndarray) -> np.ndarray:
        """Return A^T y as float64, of the shape of the image. Raises `SolverError` where it is not finite."""
        try:
            product = self.operator.rmatvec(np.ravel(data))
        except NotImplementedError:
            raise SolverError("operator: it has no adjoint; expected a method rmatvec beside matvec") from None
        return as_product(product, self.shape[0] * self.shape[1]).reshape(self.shape)

    @cached_property
    def back_projected(self) -> np.ndarray:
        """A^T b, of the shape of the image."""
        return self.adjoint(self.data)

    @property
    def norm(self) -> float:
        """The spectral norm |A|, computed once for each operator object; see `oatkit.scale.spectral_norm`."""
        return returned(self.settle_norm())[0]

    @property
    def norm_products(self) -> int:
        """Applications of A^T A that `norm` took, in this problem or in the one that found it first."""
        return returned(self.settle_norm())[1]

    @property
    def reference(self) -> Reference:
        """The scale of the image, from a short least-squares solution; see `Reference`."""
        return returned(self._settle_reference())

    @property
    def settling_products(self) -> int:
        """Applications of A^T A that `norm` and `reference` took, likewise."""
        return self.norm_products + self.reference.products

    def settle(self) -> Iterator[None]:
        """Determine `norm` and `reference`, yielding after each application of A^T A.

        A solver yields an iterate at each, so that it can be cancelled while the scale is being set.
        """
        yield from self.settle_norm()
        yield from self._settle_reference()

    def settle_norm(self) -> Generator[None, None, tuple[float, int]]:
        """Determine `norm`, yielding after each application of A^T A; for solvers that need no `reference`."""
        if "_norm" not in self.__dict__:
            found = recall_norm(self.operator)
            if found is None:
                found = yield from spectral_norm(self.forward, self.adjoint, self.operator.shape)
                remember_norm(self.operator, found)
            self.__dict__["_norm"] = found
        return self.__dict__["_norm"]

    def _settle_reference(self) -> Generator[None, None, Reference]:
        if "_reference" not in self.__dict__:
            found = yield from reference(
                lambda image: self.adjoint(self.forward(image)), self.back_projected, self.norm
            )
            self.__dict__["_reference"] = found
        return self.__dict__["_reference"]

    def applied_weight(self, weight: float | str, scaling: str, degree: int) -> float:
        """Return w of the formula for a solver's field ``weight``, read as its field ``scaling`` says.

        "relative": w = weight * |A|^2 x_ref^(2 - degree); "absolute": the weight itself. Raises `ValidationError` where
        the weight is still the name of a rule, and where w is too large or too small for a float.
        """
        if isinstance(weight, str):
            raise ValidationError(
                f"weight: the rule '{weight}' has not been applied yet; oatkit.run applies it, and so does "
                "oatkit.weights.resolve(solver, problem)"
            )
        unit = 1.0 if scaling == "absolute" else self._unit_of_weight(degree)
        if unit > 0 and not 1 / LARGEST_WEIGHT <= weight * unit <= LARGEST_WEIGHT:
            raise ValidationError(
                f"weight: {weight:g} in units of {unit:g} leaves the range of {1 / LARGEST_WEIGHT:g} to "
                f"{LARGEST_WEIGHT:g}; scale the data to order 1 or take another weight"
            )
        return weight * unit

    def _unit_of_weight(self, degree: int) -> float:
        # A quadratic penalty needs no x_ref, which takes products to find.
        return self.norm**2 * (1.0 if degree == 2 else self.reference.level ** (2 - degree))


@dataclass(frozen=True, eq=False)
class Iterate:
    """The state of a solver after one step. Its image is never modified afterwards."""

    image: np.ndarray
    """Of the problem's shape."""
    iteration: int
    """Steps done so far."""
    objective: float = float("nan")
    """What is minimised, in the units of the data squared."""
    residual_norm: float = float("nan")
    """|A x - b|, the first axis of the L-curve."""
    penalty: float = float("nan")
    """The unweighted regularization term, the second axis of the L-curve."""
    relative_gap: float = float("nan")
    """Certificate: an upper bound on (objective - optimum) / objective; NaN where the method has none, inf where it
    failed."""
    products: int = 0
    """Applications of A^T A (or of A and A^T, counted together) so far, to one, the setting of the scale included
    where the method needs it."""
    converged: bool = False
    """Whether the promise of the method is kept: set on the last iterate only."""
    reason: str = ""
    """Why it stopped, as advice to the user: set on the last iterate only."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Further numbers worth keeping with the image: the weight as applied, pixels set to zero, ..."""


@dataclass(frozen=True)
class Calibration:
    """A calibration that was found in the images of a scan, and how."""

    value: float | None
    """K Gamma: the signal that an absorption of 1/m gives at fluence 1, a.u. m; None where the images do not tell."""
    curve: tuple[tuple[float, float], ...] = ()
    """Calibrations that were tried, rising, and how badly each explains the images, relative to them."""
    notes: tuple[str, ...] = ()
    """What to know before trusting it."""

    def table(self) -> dict[str, Any]:
        """Return it as plain values."""
        tried, misfits = zip(*self.curve, strict=True) if self.curve else ((), ())
        return {"calibration": self.value, "tried": list(tried), "misfit": list(misfits), "notes": list(self.notes)}


@dataclass(frozen=True, eq=False)
class UnmixProblem:
    """What an unmixer gets: the images so far, and what it needs to compute light anew.

    All but the first are there where the pipeline has them.
    """

    initial_pressure: Image
    absorption: Image | None = None
    boundary: Image | None = None
    fluence: Image | None = None
    fluence_model: Any = None
    """A `FluenceModel`."""
    optics: Optics | None = None
    """mu_a that one assumes of the body, and its mu_s', at the wavelengths of the images."""
    calibration: float | None = None
    """K Gamma; None where it is not known."""
    calibrated_by: str = "hand"
    """Where that comes from: "hand", or "spectra" of the same scan."""
    floor: float = 0.02
    """Least fluence that is divided by, relative to the largest in the body."""
