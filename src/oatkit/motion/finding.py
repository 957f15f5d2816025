"""Motion between pulses: wavelengths are taken one after another, and a breath in between puts some out of place.

A pulse at rest looks like the pulses taken beside it, one out of place does not. How alike two pulses are is the
correlation of their signals, which neither knows nor cares how strong they are.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from oatkit.content import read_only
from oatkit.data import Geometry, Grid, Scan
from oatkit.errors import ReadError
from oatkit.tables import GridTable, MotionTable

BLOCK_S = 0.2e-6
"""Signals are averaged over this time before their differences are taken, s: 0.3 mm of water, a band about 2 MHz."""
NEIGHBOURS = 6
LEAST_TYPICAL = 0.2
"""Below this correlation, noise hides whether pulses are alike."""
GAUSSIAN = 1.4826
"""Standard deviation over median absolute deviation, for Gaussian numbers."""


@dataclass(frozen=True, eq=False)
class Motion:
    """How well each pulse fits to those beside it, and which ones do not."""

    wavelengths_nm: tuple[float, ...]
    compared: Literal["frames", "wavelengths", "nothing"]
    """What a pulse was compared with: the same wavelength of other frames, other wavelengths of its frame, nothing."""
    correlation: np.ndarray
    """Shape ``(frame, wavelength)``, -1 .. 1; NaN where there was nothing to compare with."""
    typical: np.ndarray
    """What a pulse at rest has: the median over the pulses it is judged with, shape ``(frame, wavelength)``."""
    limit: np.ndarray
    """A pulse below it is out of place, shape ``(frame, wavelength)``; NaN where nothing can be said."""
    shifts: tuple[tuple[int, int], ...] = ()
    """Lasting changes: after which frame, and at how many wavelengths. The body lay elsewhere from then on, or what
    absorbs in it had changed: signals alone do not tell."""

    def __post_init__(self) -> None:
        for name in ("correlation", "typical", "limit"):
            object.__setattr__(self, name, read_only(getattr(self, name), float))

    @property
    def moved(self) -> np.ndarray:
        """Which pulses are out of place: bool, shape ``(frame, wavelength)``."""
        return np.asarray(self.correlation < self.limit)

    @property
    def frames(self) -> tuple[int, ...]:
        """Frames with a pulse out of place."""
        return tuple(int(f) for f in np.flatnonzero(self.moved.any(axis=1)))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the curve says of the scan as a whole, and what it cannot say."""
        if self.compared == "nothing":
            return (f"motion: {self.correlation.size} pulses are too few to tell which of them moved",)
        notes = [
            f"motion: after frame {frame} the signals of {count} of {len(self.wavelengths_nm)} wavelengths changed for "
            "good: the body moved, or what absorbs in it changed; no pulse counts as out of place by that"
            for frame, count in self.shifts
        ]
        unknown = ~np.isfinite(self.limit - self.correlation)
        if unknown.any():
            notes.append(
                f"motion: nothing can be said of {unknown.sum()} of {unknown.size} pulses: too much noise, or no "
                "channel that can be trusted"
            )
        return tuple(notes)

    def of_frame(self, frame: int) -> tuple[str, ...]:
        """Return a sentence for each pulse of a frame that is out of place."""
        return tuple(
            f"frame {frame}: {self.wavelengths_nm[i]:g} nm moved, correlation {self.correlation[frame, i]:.2f} "
            f"against {self.typical[frame, i]:.2f}"
            for i in np.flatnonzero(self.moved[frame])
        )

    def table(self) -> dict[str, Any]:
        """Return all of it as plain values; None where nothing can be said."""
        arrays = {name: _plain(getattr(self, name)) for name in ("correlation", "typical", "limit")}
        return {
            "wavelengths_nm": list(self.wavelengths_nm),
            "compared": self.compared,
            "frames": list(self.frames),
            "moved": [{"frame": int(f), "wavelength_nm": self.wavelengths_nm[i]} for f, i in np.argwhere(self.moved)],
            "shifts": [{"after_frame": f, "wavelengths": count} for f, count in self.shifts],
            **arrays,
            "notes": list(self.notes),
        }


def find_motion(scan: Scan, settings: MotionTable | None = None, grid: Grid | None = None) -> Motion:
    r"""Return which pulses of a scan are out of place.

    Of each channel, the samples that a point of `grid` can reach (the field of view of a pipeline unless given) are
    averaged over blocks of 0.2 us, and the difference of each block to the one before is taken, so that neither the
    offset nor most of the noise counts. Two pulses a and b are compared by

    .. math:: c = \frac{\langle a, b \rangle}{|a| \, |b|}

    over the channels valid in both. A pulse gets the correlation that at least half of its neighbours reach: those of
    the same wavelength in the 6 nearest frames, or, in scans of less than three frames, those of the nearest
    wavelengths of the same frame. So a neighbour out of place does it no harm, and neither does a change that lasts,
    be it slow or sudden. It is out of place where that is below

    .. math:: m - \max(k \cdot 1.4826 \cdot \mathrm{MAD}, d \cdot m)

    with the median m of its wavelength over all frames (of its frame over all wavelengths), the median absolute
    deviation MAD from it, and k and d as in `settings`. Over frames, MAD is that of the values above m, which pulses
    out of place do not widen; over wavelengths, whose spectra differ, that of all. Nothing is said where m is below
    0.2 or the limit below 0, since noise hides there whether pulses are alike, nor of a pulse without valid channels
    or in a frame that cannot be read.

    Frames are read one after another, and seven of them held, averaged.
    """
    settings = MotionTable() if settings is None else settings
    grid = GridTable().grid() if grid is None else grid
    frames, wavelengths = scan.signals.shape[:2]
    pulses = (_signature(scan, f, grid) for f in range(frames))
    if frames >= 3:
        pairs = _between_frames(pulses, frames)
        scores = _scores(pairs)
        typical, limit = _judge(scores, 0, settings)
        shifts = _shifts(pairs, scores, limit)
        return Motion(scan.wavelengths_nm, "frames", scores, typical, limit, shifts)
    if wavelengths >= 3:
        scores = np.concatenate([_scores(_between_wavelengths(pulse)).T for pulse in pulses])
        return Motion(scan.wavelengths_nm, "wavelengths", scores, *_judge(scores, 1, settings))
    unknown = np.full((frames, wavelengths), np.nan)
    return Motion(scan.wavelengths_nm, "nothing", unknown, unknown, unknown)


def _signature(scan: Scan, frame: int, grid: Grid) -> np.ndarray:
    """Return what is compared of a frame: shape ``(wavelength, detector, block)``, zero for channels not to trust."""
    block = max(1, round(BLOCK_S * scan.geometry.sampling_rate_hz))
    reached = _reached(scan.geometry, grid, block)
    try:
        samples = scan.frame(frame).signals[0]
    except ReadError:  # whoever runs the frame says so
        return np.zeros((len(scan.wavelengths_nm), *reached.shape), np.float32)
    blocks = samples[..., : samples.shape[-1] // block * block].reshape(*samples.shape[:-1], -1, block)
    change = np.diff(blocks.mean(axis=-1, dtype=float), axis=-1) * reached
    trusted = scan.valid[frame] & np.isfinite(change).all(axis=-1)
    return np.where(trusted[..., None], change, 0).astype(np.float32)


def _reached(geometry: Geometry, grid: Grid, block: int) -> np.ndarray:
    """Return which differences of blocks a point of the grid can reach: bool, shape ``(detector, block - 1)``."""
    near, far = geometry.reach(grid)
    starts = geometry.times_s[::block][: geometry.n_samples // block] * geometry.speed_of_sound_m_s
    return (starts[:-1] >= near[:, None]) & (starts[1:] <= far[:, None])


def _alike(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the correlation of pulses, shape ``(n,)``, over the channels that neither lacks; NaN where none is."""
    both = np.any(a, axis=-1, keepdims=True) & np.any(b, axis=-1, keepdims=True)
    a, b = (np.where(both, x, 0).reshape(len(x), -1).astype(float) for x in (a, b))
    product = np.einsum("ij,ij->i", a, b)
    size = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return np.divide(product, size, out=np.full_like(product, np.nan), where=size > 0)


def _between_frames(pulses: Iterator[np.ndarray], count: int) -> np.ndarray:
    """Return how alike the pulses of each wavelength are: [d - 1, f] compares frame f with f + d, else it is NaN."""
    near: deque[np.ndarray] = deque(maxlen=NEIGHBOURS)
    pairs: np.ndarray | None = None
    for frame, pulse in enumerate(pulses):
        if pairs is None:
            pairs = np.full((NEIGHBOURS, count, len(pulse)), np.nan)
        for distance, other in enumerate(near, start=1):
            pairs[distance - 1, frame - distance] = _alike(other, pulse)
        near.appendleft(pulse)
    assert pairs is not None
    return pairs


def _between_wavelengths(pulse: np.ndarray) -> np.ndarray:
    """Return how alike the wavelengths of one frame are, as `_between_frames` does for one wavelength."""
    count = len(pulse)
    pairs = np.full((NEIGHBOURS, count, 1), np.nan)
    for distance in range(1, min(NEIGHBOURS, count - 1) + 1):
        pairs[distance - 1, : count - distance, 0] = _alike(pulse[:-distance], pulse[distance:])
    return pairs


def _scores(pairs: np.ndarray) -> np.ndarray:
    """Return, for each pulse, the correlation that half of its (up to `NEIGHBOURS`) nearest neighbours reach."""
    count = pairs.shape[1]
    width = min(NEIGHBOURS, count - 1)
    scores = np.empty(pairs.shape[1:])
    for here in range(count):
        first = min(max(here - width // 2, 0), count - 1 - width)
        others = [there for there in range(first, first + width + 1) if there != here]
        alike = np.stack([pairs[abs(here - there) - 1, min(here, there)] for there in others])
        scores[here] = _reached_by_half(alike)
    return scores


def _reached_by_half(alike: np.ndarray) -> np.ndarray:
    """Return the value that half of those of each column reach, NaN not counted."""
    rank = np.maximum(np.isfinite(alike).sum(axis=0) // 2, 1) - 1
    falling = -np.sort(-alike, axis=0)  # NaN last
    return np.take_along_axis(falling, rank[None], axis=0)[0]


def _judge(scores: np.ndarray, axis: int, settings: MotionTable) -> tuple[np.ndarray, np.ndarray]:
    """Return what is typical along `axis`, and below what a pulse is out of place, both of the shape of `scores`."""
    typical = _median(scores, axis)
    away = scores - typical
    if axis == 0:
        away = np.where(away >= 0, away, np.nan)
    spread = GAUSSIAN * _median(abs(away), axis)
    limit = typical - np.maximum(settings.threshold * spread, settings.least_drop * typical)
    limit = np.where((typical >= LEAST_TYPICAL) & (limit > 0), limit, np.nan)
    return np.broadcast_to(typical, scores.shape), np.broadcast_to(limit, scores.shape)


def _median(values: np.ndarray, axis: int) -> np.ndarray:
    """Return the median of what is no NaN, NaN where that is nothing; the axis stays, of length one."""
    found = np.ma.median(np.ma.masked_invalid(values), axis=axis, keepdims=True)
    return np.asarray(np.ma.filled(found, np.nan))


def _shifts(pairs: np.ndarray, scores: np.ndarray, limit: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Return between which frames, both at rest, how many wavelengths are not alike."""
    resting = [f for f in range(len(scores)) if not (scores[f] < limit[f]).any()]
    unlike = {a: int((pairs[b - a - 1, a] < limit[a]).sum()) for a, b in pairwise(resting) if b - a <= NEIGHBOURS}
    return tuple((frame, count) for frame, count in unlike.items() if count)


def _plain(values: np.ndarray) -> list[list[float | None]]:
    return [[float(v) if np.isfinite(v) else None for v in row] for row in values]
