"""What a solver gets and what it yields, and the scale that makes weights and priors dimensionless."""

from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from oatkit.data import Geometry, Grid, Image, read_only
from oatkit.errors import SolverError, ValidationError
from oatkit.vectors import inner, norm

_norms: WeakKeyDictionary[Any, tuple[float, int]] = WeakKeyDictionary()
"""Spectral norm of each operator in use, and the applications of A^T A that it took."""


AT_LEAST = 20
"""Steps of `spectral_norm` before it trusts its value."""

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Problem:
    """Find an image x of ``shape`` with ``operator @ x.ravel()`` near ``data``.

    Raises `ValidationError` where the sizes do not fit together or the data are not finite.
    """

    operator: Any
    """Anything that scipy's ``aslinearoperator`` takes: a matrix, a sparse matrix, a ``LinearOperator``."""
    data: np.ndarray
    """The measured signals, raveled."""
    shape: tuple[int, int]
    """Shape of the image, ``(ny, nx)``."""
    geometry: Geometry | None = None
    """Where the data come from; only for solvers that are no inversion of an operator (back-projection)."""
    grid: Grid | None = None
    """Where the image lies; likewise."""

    def __post_init__(self) -> None:
        operator = self.operator
        if not (hasattr(operator, "matvec") and hasattr(operator, "rmatvec")):
            from scipy.sparse.linalg import aslinearoperator  # slow to import: only for bare matrices

            operator = aslinearoperator(operator)
        data = read_only(np.asarray(self.data, dtype=float).ravel())
        rows, columns = operator.shape
        if rows != data.size or columns != self.shape[0] * self.shape[1]:
            raise ValidationError(
                f"problem: an operator of shape {(rows, columns)} does not map an image of shape {tuple(self.shape)} "
                f"to {data.size} data"
            )
        if not np.isfinite(data).all():
            raise ValidationError(f"problem: {(~np.isfinite(data)).sum()} of {data.size} data are not finite")
        object.__setattr__(self, "operator", operator)
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "shape", (int(self.shape[0]), int(self.shape[1])))

    def forward(self, image: np.ndarray) -> np.ndarray:
        """Return A x as float64, raveled. Raises `SolverError` where it is not finite."""
        return _finite(self.operator.matvec(np.ravel(image))).ravel()

    def adjoint(self, data: np.ndarray) -> np.ndarray:
        """Return A^T y as float64, of the shape of the image. Raises `SolverError` where it is not finite."""
        return _finite(self.operator.rmatvec(np.ravel(data))).reshape(self.shape)

    @cached_property
    def back_projected(self) -> np.ndarray:
        """A^T b, of the shape of the image."""
        return self.adjoint(self.data)

    @property
    def norm(self) -> float:
        """The spectral norm |A|, computed once for each operator object; see `spectral_norm`."""
        return self._settled_norm[0]

    @cached_property
    def reference(self) -> "Reference":
        """The scale of the image, from a short least-squares solution; see `Reference`."""
        return _last(reference(self))

    def settle(self) -> Iterator[None]:
        """Determine `norm` and `reference`, yielding after each application of A^T A.

        A solver yields an iterate at each, so that it can be cancelled while the scale is being set.
        """
        yield from self.settle_norm()
        if "reference" not in self.__dict__:
            self.__dict__["reference"] = yield from reference(self)

    @property
    def settling_products(self) -> int:
        """Applications of A^T A that `norm` and `reference` took, or would have taken without what was known before."""
        return self._settled_norm[1] + self.reference.products

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
        if scaling == "absolute":
            return weight
        # A quadratic penalty needs no x_ref, which takes products to find.
        unit = self.norm**2 * (1.0 if degree == 2 else self.reference.level ** (2 - degree))
        if unit > 0 and not 1e-300 <= weight * unit <= 1e300:
            raise ValidationError(
                f"weight: {weight:g} times |A|^2 x_ref^{2 - degree} = {unit:g} leaves the range of floats; "
                "scale the data to order 1 or take another weight"
            )
        return weight * unit

    @property
    def _settled_norm(self) -> tuple[float, int]:
        return _last(self.settle_norm())

    def settle_norm(self) -> Generator[None, None, tuple[float, int]]:
        """Determine `norm`, yielding after each application of A^T A; for solvers that need no `reference`."""
        if self.operator not in _norms:
            _norms[self.operator] = yield from spectral_norm(self)
        return _norms[self.operator]


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
    """Applications of A^T A (or of A and A^T, counted together) so far, the setting of the scale included."""
    converged: bool = False
    """Whether the promise of the method is kept: set on the last iterate only."""
    reason: str = ""
    """Why it stopped, as advice to the user: set on the last iterate only."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Further numbers worth keeping with the image: the weight as applied, pixels set to zero, ..."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The scale of an image: x_ref, and the image that it was read off."""

    level: float
    """x_ref: the 99th percentile of `base` (of its absolute values where that is not positive); 0 for zero data."""
    base: np.ndarray
    """20 steps of conjugate gradients on least squares with the Laplacian at weight 1e-2 |A|^2, from zero."""
    products: int = 0
    """Applications of A^T A that it took."""


@dataclass(frozen=True, eq=False)
class UnmixProblem:
    """What an unmixer gets: the images so far. The last three are there where the pipeline has them."""

    initial_pressure: Image
    absorption: Image | None = None
    boundary: Image | None = None
    fluence_model: Any = None


def spectral_norm(
    problem: Problem, steps: int = 40, tolerance: float = 1e-2
) -> Generator[None, None, tuple[float, int]]:
    """Return |A|, the largest singular value, and the steps taken, yielding after each.

    By Golub-Kahan-Lanczos bidiagonalisation from a seeded start. It sees the same Krylov space as the power iteration
    and reads more off it: exact after n steps for an image of n pixels, and here stopped where the triplet of the
    largest value fits by `tolerance`, |A^T u - s v| <= tolerance * s, but not before `AT_LEAST` steps: a second value
    close to the largest fits sooner. A bound from below, and within 1e-3 on all matrices tried. 0 for a zero operator.
    """
    steps = min(steps, *problem.operator.shape)
    v = np.random.default_rng(0).standard_normal(problem.shape).ravel()
    right = [v / norm(v)]
    alphas: list[float] = []
    betas: list[float] = []
    value, u = 0.0, np.zeros(problem.data.shape)
    for _ in range(steps):
        u = problem.forward(right[-1]) - (betas[-1] if betas else 0.0) * u
        alphas.append(norm(u))
        left, values, _ = np.linalg.svd(np.diag(alphas) + np.diag(betas, 1))
        value = float(values[0])
        if alphas[-1] <= 1e-14 * value:
            break
        u = u / alphas[-1]
        v = problem.adjoint(u).ravel()
        yield
        basis = np.array(right)
        v = v - np.einsum("i,ij->j", np.einsum("ij,j->i", basis, v), basis)  # rounding would let old directions back in
        betas.append(norm(v))
        fits = betas[-1] * abs(left[-1, 0]) <= tolerance * value
        if betas[-1] <= 1e-14 * value or (fits and len(alphas) >= AT_LEAST):
            break
        right.append(v / betas[-1])
    return value, len(alphas)


def reference(problem: Problem, steps: int = 20) -> Generator[None, None, Reference]:
    """Return the scale of the problem's image, yielding after each step; see `Reference` for the rule."""
    weight = 1e-2 * problem.norm**2
    image = np.zeros(problem.shape)
    residual = problem.back_projected
    direction, energy = residual, inner(residual, residual)
    products = 0
    while products < steps and energy > 0:
        curved = problem.adjoint(problem.forward(direction)) + weight * laplacian(laplacian(direction))
        products += 1
        yield
        curvature = inner(direction, curved)
        if curvature <= 0:
            break
        step = energy / curvature
        image = image + step * direction
        residual = residual - step * curved
        previous, energy = energy, inner(residual, residual)
        direction = residual + (energy / previous) * direction
    level = float(np.percentile(image, 99))
    if not level > 0:
        level = float(np.percentile(abs(image), 99))
    return Reference(level, read_only(image), products)


def _finite(product: np.ndarray) -> np.ndarray:
    product = np.asarray(product, dtype=float)
    if not np.isfinite(product).all():
        raise SolverError(
            f"operator: {(~np.isfinite(product)).sum()} of {product.size} values of its product are not finite; "
            "the operator is faulty, or the image grew beyond the range of its numbers"
        )
    return product


def laplacian(image: np.ndarray) -> np.ndarray:
    """Apply the 5-point Laplacian in pixel units with Neumann edges; it is symmetric, so it is its own adjoint."""
    out = np.zeros_like(image, dtype=float)
    down, across = np.diff(image, axis=0), np.diff(image, axis=1)
    out[:-1] += down
    out[1:] -= down
    out[:, :-1] += across
    out[:, 1:] -= across
    return out


def _last(steps: Generator[None, None, Result]) -> Result:
    """Run a generator to its end and return what it returns."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
