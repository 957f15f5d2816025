"""Plugins that are wrong in one way each, made from the right ones of `toy_plugins`.

They are derived from those to be short, which a real plugin must not be; the check `final` is right to say so.
"""

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, field_validator

from oatkit.api import Detectors, Segmenter, Solver, param
from toy_plugins import (
    Landweber,
    Matrix,
    Ridge,
    Threshold,
)

ALTERED: dict[str, type] = {}


def altered(base: type, **methods: Any) -> type:
    """A class that does some things otherwise than its base, which its methods reach as ``self`` does."""
    name = f"Altered{len(ALTERED)}"
    ALTERED[name] = type(name, (base,), {"__doc__": base.__doc__, "__module__": __name__, **methods})
    globals()[name] = ALTERED[name]  # where pickle looks for it
    return ALTERED[name]


class Abstract(Solver):
    """It has no method, after [Nobody2020]."""

    name: ClassVar[str] = "No Name"


class Thawed(Landweber):
    """Its parameters can be set, and other ones given, after [Nobody2020]."""

    model_config = ConfigDict(frozen=False, extra="ignore")


class WrongDefault(Landweber):
    """Its default is out of its range, after [Nobody2020]."""

    n_iterations: int = param(0, "largest number of steps", at_least=1)


class Bare(Segmenter):
    name: ClassVar[str] = "bare"

    def segment(self, image): ...


class Unsourced(Ridge):
    """The usual penalty."""

    def value(self, image):
        """Return it."""
        return float((image**2).sum())

    def gradient(self, image):
        """Return its gradient."""
        return 2.0 * image

    def operator(self, shape):
        """Return the identity."""
        return super().operator(shape)


class OddParameters(Threshold):
    """Its parameters are of types that no file holds, undeclared, or None without being so by default."""

    listed: list = param((), "a list")
    plain: int = 3
    nothing: float | None = param(1.0, "a share, or nothing")
    silent: int = param(1, "")


class Unitless(Threshold):
    """How far is a length without a unit."""

    reach: float = param(1.0, "how far it looks", above=0)


class Lenient(Threshold):
    """It takes whatever it is given."""

    reach: float = param(1.0, "how far it looks", unit="mm", above=0)

    @field_validator("reach", mode="before")
    @classmethod
    def _any(cls, value: Any) -> Any:
        return value

    @classmethod
    def _check(cls, value: Any, handler: Any, info: Any) -> Any:
        return value


class Blind(Threshold):
    """It is equal to all others of its class."""

    reach: float = param(1.0, "how far it looks", unit="mm", above=0)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other)

    def __hash__(self) -> int:
        return 0


class Forgetful(Threshold):
    """It writes its parameters without one of them."""

    reach: float = param(1.0, "how far it looks", unit="mm", above=0)

    def model_dump(self, **options: Any) -> dict[str, Any]:
        """Return the name alone."""
        return {"use": self.name}


def scaled_operator(factor_of_adjoint: float):
    """An operator whose adjoint is wrong by a factor."""

    def operator(self, geometry, grid):
        from scipy.sparse.linalg import LinearOperator

        geometry.check_grid(grid)
        a = Matrix().matrix(geometry, grid)
        return LinearOperator(a.shape, lambda x: a @ x, rmatvec=lambda y: factor_of_adjoint * (a.T @ y), dtype=float)

    return operator


def mapped(change):
    """A forward model whose matrix is that of a changed geometry, grid, or otherwise changed."""

    def matrix(self, geometry, grid):
        return change(geometry, grid)

    return matrix


def bent(self, geometry, grid):
    """An operator that is not linear."""
    from scipy.sparse.linalg import LinearOperator

    geometry.check_grid(grid)
    a = Matrix().matrix(geometry, grid)
    return LinearOperator(a.shape, lambda x: abs(a @ x), rmatvec=lambda y: a.T @ y, dtype=float)


def greedy(self, geometry, grid):
    """An operator that changes what it is given."""
    from scipy.sparse.linalg import LinearOperator

    geometry.check_grid(grid)
    a = Matrix().matrix(geometry, grid)

    def matvec(x):
        out = a @ x.ravel()
        x *= 2
        return out

    return LinearOperator(a.shape, matvec, rmatvec=lambda y: a.T @ y, dtype=float)


def unchecked(self, geometry, grid):
    """An operator on any grid."""
    from scipy.sparse.linalg import aslinearoperator

    return aslinearoperator(np.ones((np.prod(geometry.shape), 1)) * np.ones((1, np.prod(grid.shape))))


def absolute_place(geometry, grid):
    """Signals that depend on where the origin is."""
    a = Matrix().matrix(geometry, grid)
    return a * (1 + 30 * np.repeat(geometry.detectors.positions_m[:, :1], geometry.n_samples, axis=0))


def flipped(geometry, grid):
    """The axes exchanged in the detectors."""
    return Matrix().matrix(replace(geometry, detectors=Detectors(geometry.detectors.positions_m[:, ::-1])), grid)


def slow_sound(geometry, grid):
    """Sound that takes a fifth longer."""
    slow = replace(geometry, speed_of_sound_m_s=geometry.speed_of_sound_m_s / 1.2)
    return Matrix().matrix(slow, grid)


def no_start(geometry, grid):
    """A record that always starts at the light pulse."""
    return Matrix().matrix(replace(geometry, start_time_s=0.0), grid)


def late_zero(geometry, grid):
    """The time zero of the response at its begin."""
    response = geometry.impulse_response
    padded = None if response is None else np.concatenate([np.zeros(len(response) - 1), response])
    return Matrix().matrix(replace(geometry, impulse_response=padded), grid)


FORWARD = {
    "operator": altered(Matrix, operator=greedy),
    "adjoint": altered(Matrix, operator=scaled_operator(1 + 1e-6)),
    "linearity": altered(Matrix, operator=bent),
    "translation": altered(Matrix, matrix=mapped(absolute_place)),
    "arrival (slow)": altered(Matrix, matrix=mapped(slow_sound)),
    "arrival": altered(Matrix, matrix=mapped(flipped)),
    "record": altered(Matrix, matrix=mapped(no_start)),
    "impulse_response": altered(Matrix, matrix=mapped(late_zero)),
    "blind": altered(Matrix, operator=unchecked),
}


def each(change):
    """Landweber whose iterates are changed on their way out; `change` gets the state and the problem."""

    def iterate(self, problem):
        for state in Landweber.iterate(self, problem):
            yield change(state, problem)

    return iterate


def last_only(self, problem):
    """All steps before the only iterate."""
    yield list(Landweber.iterate(self, problem))[-1]


KEPT = []


def keeping(self, problem):
    """Problems that are kept for ever."""
    KEPT.append(problem)
    yield from Landweber.iterate(self, problem)


def stubborn(self, problem):
    """Steps that go on when they are told to stop."""
    for state in Landweber.iterate(self, problem):
        try:
            yield state
        except GeneratorExit:
            yield state


def reused(self, problem):
    """One image for all iterates."""
    image = np.zeros(problem.shape)
    for state in Landweber.iterate(self, problem):
        image[...] = state.image
        yield replace(state, image=image)


def restless(self, problem):
    """A start that nobody chose."""
    for state in Landweber.iterate(self, problem):
        yield replace(state, image=state.image + 1e-9 * np.random.default_rng().random(problem.shape))


def dividing(self, problem):
    """0 / 0 for zero data."""
    for state in Landweber.iterate(self, problem):
        with np.errstate(invalid="ignore"):
            yield replace(state, image=state.image * np.float64(problem.data.max()) / problem.data.max())


def told_whole(self, problem):
    """An image that is scaled by the number of detectors, valid or not."""
    n = problem.geometry.detectors.count if problem.geometry else 24
    for state in Landweber.iterate(self, problem):
        yield replace(state, image=state.image * n / 24, residual_norm=float("nan"))


def rising(self, problem):
    """An objective that rises."""
    for i, state in enumerate(Landweber.iterate(self, problem)):
        yield replace(state, objective=float(i))


class AnyWeight(Landweber):
    """It does not look at its weight, after [Nobody2020]."""

    weight: float | Literal["l-curve"] = param("l-curve", "weight, dimensionless", above=0)


SOLVERS = {
    "known_answers": altered(Landweber, iterate=each(lambda s, p: replace(s, image=1.2 * s.image))),
    "sees": altered(Landweber, iterate=each(lambda s, p: replace(s, image=s.image[::-1, ::-1]))),
    "falls": altered(Landweber, iterate=rising),
    "residuals": altered(Landweber, iterate=each(lambda s, p: replace(s, residual_norm=2 * s.residual_norm + 1))),
    "repeats": altered(Landweber, iterate=restless),
    "scales": altered(Landweber, iterate=dividing),
    "cancelling": altered(Landweber, iterate=last_only),
    "cancelling (kept)": altered(Landweber, iterate=keeping),
    "cancelling (stubborn)": altered(Landweber, iterate=stubborn),
    "honest (silent)": altered(Landweber, iterate=each(lambda s, p: replace(s, converged=False, reason=""))),
    "iterates (shape)": altered(Landweber, iterate=each(lambda s, p: replace(s, image=s.image.ravel()))),
    "honest": altered(Landweber, iterate=each(lambda s, p: replace(s, converged=True))),
    "iterates": altered(Landweber, iterate=reused),
    "products": altered(Landweber, iterate=each(lambda s, p: replace(s, products=0))),
    "valid_detectors": altered(Landweber, iterate=told_whole),
    "rules": AnyWeight,
}


FORM = {
    "abstract": Abstract,
    "final": altered(Threshold),
    "frozen": Thawed,
    "defaults": WrongDefault,
    "docstring": Bare,
    "docstring (reference)": Unsourced,
    "parameters": OddParameters,
    "units": Unitless,
    "bounds": Lenient,
    "value": Blind,
    "toml": Forgetful,
}
