"""Passes between absorption and light until they agree."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from oatkit.checkpoint import checkpoint
from oatkit.light.coarse import CoarseLight

MOST_HELD = 0.005
"""Share of the body's pixels, held by the limit of the diffusion of light alone, above which the passes ran away."""


@dataclass(frozen=True)
class State:
    """Absorption, light and concentrations after a pass."""

    light: np.ndarray
    """Shape ``(wavelength, y, x)``, as the next two; undefined (NaN) outside of the body."""
    absorption: np.ndarray
    """p0 / (K Gamma Phi), 1/m."""
    fitted: np.ndarray
    """What the concentrations absorb, 1/m: this is what the light sees."""
    concentrations: np.ndarray
    """Shape ``(chromophore, y, x)``."""
    calibration: float
    """K Gamma, a.u. m."""


@dataclass(frozen=True)
class Settled:
    """The state in which the passes ended, and how they came to it."""

    state: State
    changes: tuple[tuple[float, ...], ...] = ()
    """Relative change of the fitted absorption at each wavelength, in each pass but the first."""
    converged: bool = False
    """Whether the last change was within the tolerance, and the passes did not run away."""
    held: float = 0.0
    """Share of the body's pixels in which the light sees mu_s' instead of the larger absorption found."""

    @property
    def largest(self) -> tuple[float, ...]:
        """The largest of the changes of each pass."""
        return tuple(map(max, self.changes))

    @property
    def passes(self) -> int:
        """How many were made."""
        return len(self.changes) + 1

    @property
    def diverged(self) -> bool:
        """Whether the absorption ran away and came to rest at the limit only; what is deep is then far too dark."""
        return not self.held <= MOST_HELD


class Ahead:
    """Looks ahead along the way that the passes take, by Anderson's mixing of the last two (J. ACM 12, 547, 1965)."""

    def __init__(self) -> None:
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._mixed: np.ndarray | None = None

    def tell(self, seen: np.ndarray, found: np.ndarray) -> None:
        """Take note of a pass: the absorption that its light saw, and the one that it found."""
        before, self._last = self._last, (seen, found)
        self._mixed = None if before is None else _mixed(*before, seen, found)

    def of(self, found: np.ndarray) -> np.ndarray:
        """Return what the light of the next pass should see: no negative absorption."""
        return found if self._mixed is None else np.maximum(self._mixed, 0)


def _mixed(seen0: np.ndarray, found0: np.ndarray, seen: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Return the mix of two passes in which, were they linear, what is seen and what is found would differ least."""
    gap0, gap = np.nan_to_num(found0 - seen0), np.nan_to_num(found - seen)
    turn = gap - gap0
    size = float(np.vdot(turn, turn))
    share = float(np.vdot(gap, turn)) / size if size > 0 else 0.0
    return found - share * (found - found0)


@dataclass(frozen=True)
class Passes:
    """What does not change from pass to pass."""

    pressure: np.ndarray
    """p0, shape ``(wavelength, y, x)``, a.u."""
    model: CoarseLight
    fit: Callable[[np.ndarray], np.ndarray]
    """From mu_a to concentrations."""
    spectra: np.ndarray
    """Shape ``(wavelength, chromophore)``."""
    calibration: float | None
    """K Gamma, a.u. m; None where the mean absorption of the body sets it."""
    floor: float
    """Least light that is divided by, relative to the largest."""
    scattering: float = 1.0
    """Factor on mu_s'."""

    def settle(self, most: int, tolerance: float, start: np.ndarray | None = None) -> Settled:
        """Make passes until the absorption rests or `most` are made; the first light sees the absorption `start`."""
        state = self._pass(self.model.homogeneous if start is None else self._light(start))
        changes: tuple[tuple[float, ...], ...] = ()
        ahead = Ahead()
        while len(changes) < most - 1 and not (changes and max(changes[-1]) <= tolerance):
            checkpoint()
            seen = ahead.of(state.fitted)
            state = self._pass(self._light(seen))
            ahead.tell(seen, state.fitted)
            changes = (*changes, self._change(seen, state.fitted))
        held = self._held(state)
        return Settled(state, changes, bool(changes) and max(changes[-1]) <= tolerance and held <= MOST_HELD, held)

    def misfit(self, state: State) -> float:
        """Return |p0 - K Gamma Phi E c| / |p0| over the body and all wavelengths."""
        inside = self.model.inside
        pressure = self.pressure[:, inside]
        shown = (state.calibration * self._floored(state.light) * state.fitted)[:, inside]
        size = float(np.linalg.norm(pressure))
        return float(np.linalg.norm(pressure - shown)) / size if size > 0 else 0.0

    def _light(self, absorption_per_m: np.ndarray) -> np.ndarray:
        return self.model.light(np.where(self.model.inside, absorption_per_m, 0.0), self.scattering)

    def _pass(self, light: np.ndarray) -> State:
        inside = self.model.inside
        signal = np.where(inside, self.pressure / self._floored(light), np.nan)
        concentrations = self.fit(signal)
        # What is negative absorbs nothing.
        fitted = np.maximum(np.tensordot(self.spectra, concentrations, 1), 0)
        # An image of zeros has no scale.
        scale = self.calibration or float(np.mean(fitted[:, inside])) / self._stated_mean or 1.0
        return State(light, signal / scale, fitted / scale, concentrations / scale, scale)

    def _floored(self, light: np.ndarray) -> np.ndarray:
        """Return the light that is divided by."""
        return np.maximum(light, self.floor * np.where(self.model.inside, light, 0).max((1, 2), keepdims=True))

    @property
    def _stated_mean(self) -> float:
        stated = self.model.optics.absorption_per_m
        return float(np.mean(stated if stated.ndim == 1 else stated[:, self.model.inside]))

    def _held(self, state: State) -> float:
        beyond = state.fitted > self.model.limit(self.scattering)
        return float(beyond[:, self.model.inside].any(0).mean())

    def _change(self, before: np.ndarray, after: np.ndarray) -> tuple[float, ...]:
        inside = self.model.inside
        moved, size = (np.linalg.norm(v[:, inside], axis=1) for v in (after - before, after))
        return tuple(map(float, np.divide(moved, size, out=np.zeros_like(size), where=size > 0)))
