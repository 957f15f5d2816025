"""What a solver gets and what it yields, and the scale that makes weights and priors dimensionless."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from oatkit.data import Geometry, Grid, Image, read_only
from oatkit.errors import ValidationError


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
        """Return A x as float64, raveled."""
        return np.asarray(self.operator.matvec(np.ravel(image)), dtype=float).ravel()

    def adjoint(self, data: np.ndarray) -> np.ndarray:
        """Return A^T y as float64, of the shape of the image."""
        return np.asarray(self.operator.rmatvec(np.ravel(data)), dtype=float).reshape(self.shape)

    @cached_property
    def back_projected(self) -> np.ndarray:
        """A^T b, of the shape of the image."""
        return self.adjoint(self.data)

    @property
    def norm(self) -> float:
        """The spectral norm |A|, computed once for each operator object; see `spectral_norm`."""
        if self.operator not in _norms:
            _norms[self.operator] = spectral_norm(self)
        return _norms[self.operator]

    @cached_property
    def reference(self) -> "Reference":
        """The scale of the image, from a short least-squares solution; see `Reference`."""
        return reference(self)


_norms: WeakKeyDictionary[Any, float] = WeakKeyDictionary()


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


@dataclass(frozen=True, eq=False)
class UnmixProblem:
    """What an unmixer gets: the images so far. The last three are there where the pipeline has them."""

    initial_pressure: Image
    absorption: Image | None = None
    boundary: Image | None = None
    fluence_model: Any = None


def spectral_norm(problem: Problem, steps: int = 40, tolerance: float = 1e-4) -> float:
    """Return |A|, the largest singular value, by Golub-Kahan-Lanczos bidiagonalisation from a seeded start.

    It sees the same Krylov space as the power iteration and reads more off it: exact after n steps for an image of
    n pixels, and here stopped where the value grows by less than `tolerance` in a step. 0 for a zero operator.
    """
    steps = min(steps, *problem.operator.shape)
    v = np.random.default_rng(0).standard_normal(problem.shape)
    v /= np.linalg.norm(v)
    right = [v.ravel()]
    alphas: list[float] = []
    betas: list[float] = []
    u = problem.forward(v)
    value = 0.0
    for _ in range(steps):
        alphas.append(float(np.linalg.norm(u)))
        bidiagonal = np.diag(alphas) + np.diag(betas, 1)
        previous, value = value, float(np.linalg.norm(bidiagonal, 2))
        if alphas[-1] <= 1e-14 * value or value - previous <= tolerance * value:
            break
        u = u / alphas[-1]
        v = problem.adjoint(u).ravel()
        for vector in right:  # rounding would let old directions back in
            v = v - (vector @ v) * vector
        beta = float(np.linalg.norm(v))
        if beta <= 1e-14 * value:
            break
        right.append(v / beta)
        betas.append(beta)
        u = problem.forward(right[-1]) - beta * u
    return value


def laplacian(image: np.ndarray) -> np.ndarray:
    """Apply the 5-point Laplacian in pixel units with Neumann edges; it is symmetric, so it is its own adjoint."""
    out = np.zeros_like(image, dtype=float)
    down, across = np.diff(image, axis=0), np.diff(image, axis=1)
    out[:-1] += down
    out[1:] -= down
    out[:, :-1] += across
    out[:, 1:] -= across
    return out


def reference(problem: Problem, steps: int = 20) -> Reference:
    """Return the scale of the problem's image; see `Reference` for the rule."""
    weight = 1e-2 * problem.norm**2
    image = np.zeros(problem.shape)
    residual = problem.back_projected.copy()
    direction, energy = residual, float(np.vdot(residual, residual))
    for _ in range(steps):
        if energy <= 0:
            break
        curved = problem.adjoint(problem.forward(direction)) + weight * laplacian(laplacian(direction))
        curvature = float(np.vdot(direction, curved))
        if curvature <= 0:
            break
        step = energy / curvature
        image = image + step * direction
        residual = residual - step * curved
        previous, energy = energy, float(np.vdot(residual, residual))
        direction = residual + (energy / previous) * direction
    level = float(np.percentile(image, 99))
    if not level > 0:
        level = float(np.percentile(abs(image), 99))
    return Reference(level, read_only(image))
