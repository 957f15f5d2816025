"""Where detectors are, and when they sample."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from oatkit.content import ByContent, check_range, read_only
from oatkit.data.grid import Grid
from oatkit.errors import ValidationError

SMALLEST_ARRAY_M = 1e-3
"""No array is smaller; positions in m that were converted from mm twice are."""


@dataclass(frozen=True, eq=False)
class Detectors(ByContent):
    """Point detectors in the image plane, anywhere and in any order.

    Raises `ValidationError` where positions are not of shape ``(n, 2)``, not finite, further than 2 m from the origin,
    or all within 1 mm of it. `from_xyz` takes points in the order in which most files hold them.
    """

    positions_m: np.ndarray
    """Shape ``(n, 2)``, each ``(y, x)``, m."""

    def __post_init__(self) -> None:
        positions = np.asarray(self.positions_m, dtype=float)
        if positions.ndim != 2 or positions.shape[1] != 2 or len(positions) == 0:
            raise ValidationError(
                f"detector positions: expected shape (n, 2) in the order (y, x), got {positions.shape}; "
                "Detectors.from_xyz takes points of shape (n, 3) in the order (x, y, z)"
            )
        check_range("detector positions", positions, -2.0, 2.0, "the unit is m, so 40 mm is 0.04")
        if len(positions) > 1 and not abs(positions).max() >= SMALLEST_ARRAY_M:
            raise ValidationError(
                f"detector positions: all lie within {1e3 * abs(positions).max():.3g} mm of the origin; the unit is m, "
                "so 40 mm is 0.04"
            )
        object.__setattr__(self, "positions_m", read_only(positions))

    @classmethod
    def from_xyz(cls, points_m: Any) -> Self:
        """Take points of shape ``(n, 3)`` in the order ``(x, y, z)``, all in one plane of constant z.

        Raises `ValidationError` where z varies by more than 0.1 mm: this package images planes.
        """
        points = np.asarray(points_m, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValidationError(f"detector points: expected shape (n, 3) in the order (x, y, z), got {points.shape}")
        if not np.ptp(points[:, 2]) <= 1e-4:
            raise ValidationError(
                f"detector points: z varies by {np.ptp(points[:, 2]) * 1e3:.3g} mm; they must lie in one plane"
            )
        return cls(points[:, [1, 0]])

    @property
    def count(self) -> int:
        """Number of detectors."""
        return len(self.positions_m)


@dataclass(frozen=True, eq=False)
class Geometry(ByContent):
    """Where and when the signals were taken: all that an acoustic operator depends on.

    Sample k is taken at ``start_time_s + k / sampling_rate_hz`` after the light pulse. Raises `ValidationError` for
    values out of their physical range, with a hint at the unit.
    """

    detectors: Detectors
    sampling_rate_hz: float
    n_samples: int
    start_time_s: float = 0.0
    speed_of_sound_m_s: float = 1500.0
    impulse_response: np.ndarray | None = None
    """Convolved with every ideal signal: shape ``(n,)``, at the sampling rate, time zero at index ``n // 2``.

    It holds the electrical impulse response of the detectors and whatever filter was applied to the data."""

    def __post_init__(self) -> None:
        for name in ("sampling_rate_hz", "start_time_s", "speed_of_sound_m_s"):
            object.__setattr__(self, name, float(getattr(self, name)))
        check_range("sampling_rate_hz", self.sampling_rate_hz, 1e5, 1e10, "the unit is Hz, so 40 MHz is 40e6")
        check_range("n_samples", self.n_samples, 1, 10_000_000, "a record has at least one sample")
        if int(self.n_samples) != self.n_samples:
            raise ValidationError(f"n_samples: must be a whole number, got {self.n_samples}")
        object.__setattr__(self, "n_samples", int(self.n_samples))
        check_range("start_time_s", self.start_time_s, -1e-2, 1e-2, "the unit is s, so 10 us is 1e-5")
        check_range("speed_of_sound_m_s", self.speed_of_sound_m_s, 300, 7000, "the unit is m/s, so 1.5 km/s is 1500")
        if self.impulse_response is not None:
            response = np.asarray(self.impulse_response, dtype=float)
            if response.ndim != 1 or response.size == 0 or not np.isfinite(response).all() or not response.any():
                raise ValidationError("impulse_response: expected a finite, non-zero array of shape (n,)")
            object.__setattr__(self, "impulse_response", read_only(response))

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of one record, ``(detector, sample)``."""
        return (self.detectors.count, self.n_samples)

    @cached_property
    def times_s(self) -> np.ndarray:
        """Time of each sample after the light pulse, shape ``(sample,)``, s."""
        return read_only(self.start_time_s + np.arange(self.n_samples) / self.sampling_rate_hz)

    def reach(self, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance of each detector from the nearest and the farthest point of `grid`, m."""
        left, right, bottom, top = grid.extent_m
        y, x = self.detectors.positions_m.T
        near = np.hypot(np.maximum(np.maximum(bottom - y, y - top), 0), np.maximum(np.maximum(left - x, x - right), 0))
        far = np.hypot(np.maximum(abs(y - bottom), abs(y - top)), np.maximum(abs(x - left), abs(x - right)))
        return near, far

    def check_grid(self, grid: Grid) -> None:
        """Raise `ValidationError` where no image on `grid` could be seen by these detectors.

        That is: a detector lies on or inside the grid, or no sample of the record reaches any pixel.
        """
        near, far = self.reach(grid)
        height, width = (1e3 * n * grid.pixel_size_m for n in grid.shape)
        inside = int((near <= grid.pixel_size_m).sum())
        if inside:
            raise ValidationError(
                f"grid: {inside} of {self.detectors.count} detectors lie inside the field of view of "
                f"{height:.4g} x {width:.4g} mm; take a smaller one (the unit is mm)"
            )
        first, last = self.times_s[[0, -1]] * self.speed_of_sound_m_s
        if not ((far >= first) & (near <= last)).any():
            raise ValidationError(
                f"grid: the record reaches distances of {1e3 * first:.4g} .. {1e3 * last:.4g} mm, but the field of "
                f"view is {1e3 * near.min():.4g} .. {1e3 * far.max():.4g} mm from the detectors; "
                "check its centre and the start time"
            )
