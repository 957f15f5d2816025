"""Which pulses of a scan are out of place: those unlike the pulses that were taken beside them."""

from itertools import pairwise

import numpy as np

from oatkit.data import Grid, Scan
from oatkit.motion.likeness import NEIGHBOURS, between_frames, between_wavelengths, signature
from oatkit.motion.record import Motion
from oatkit.tables import GridTable, MotionTable

LEAST_TYPICAL = 0.2
"""Below this correlation, noise hides whether pulses are alike."""
GAUSSIAN = 1.4826
"""Standard deviation over median absolute deviation, for Gaussian numbers."""


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
    pulses = (signature(scan, f, grid) for f in range(frames))
    if frames >= 3:
        pairs = between_frames(pulses, frames)
        scores = _scores(pairs)
        typical, limit = _judge(scores, 0, settings)
        shifts = _shifts(pairs, scores, limit)
        return Motion(scan.wavelengths_nm, "frames", scores, typical, limit, shifts)
    if wavelengths >= 3:
        scores = np.concatenate([_scores(between_wavelengths(pulse)).T for pulse in pulses])
        return Motion(scan.wavelengths_nm, "wavelengths", scores, *_judge(scores, 1, settings))
    unknown = np.full((frames, wavelengths), np.nan)
    return Motion(scan.wavelengths_nm, "nothing", unknown, unknown, unknown)


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
