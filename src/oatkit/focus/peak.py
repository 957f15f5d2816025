"""The maximum of a curve of sharpness over speed of sound, and the reasons to doubt it."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from oatkit.focus.metrics import TRUSTED

DISAGREEMENT_M_S = 10.0
"""Difference from the pick that is worth a note."""

FLAT = 0.05
"""A maximum less than this share above the median of its curve is worth a note.

By variance and over 1400 .. 1600 m/s, `benchmarks/focus.py` finds 0.006 for noise, 0.10 for a real mouse and 0.30
and more for phantoms at 10 dB."""

RIVAL = 0.8
"""Another maximum that rises at least this far from the median to the pick is worth a note."""


def peak_of(speeds: Sequence[float], curve: Sequence[float]) -> float:
    """Return where the parabola through the best point and its neighbours is highest; the end of the range as it is.

    >>> peak_of([0.0, 1.0, 3.0], [0.0, 8.0, 0.0])
    1.5
    """
    best = int(np.argmax(curve))
    if best in (0, len(curve) - 1):
        return speeds[best]
    before, after = speeds[best] - speeds[best - 1], speeds[best + 1] - speeds[best]
    rise, fall = (curve[best] - curve[best - 1]) / before, (curve[best] - curve[best + 1]) / after
    if not rise + fall > 0:
        return speeds[best]
    return speeds[best] + (rise * after - fall * before) / (2 * (rise + fall))


def doubts(speeds: Sequence[float], curve: Sequence[float]) -> Iterator[str]:
    """Yield a sentence for each reason in the curve to doubt its maximum."""
    best, median = int(np.argmax(curve)), float(np.median(curve))
    if best in (0, len(curve) - 1):
        yield f"the end of the range {speeds[0]:g} .. {speeds[-1]:g} m/s that was tried; a better one may lie beyond"
    if not curve[best] > (1 + FLAT) * median:
        yield "the curve is flat; noise, a smooth body or too narrow a range decides where its maximum is"
    rivals = _rivals(speeds, curve, median)
    if rivals:
        yield f"the image is nearly as sharp at {', '.join(f'{speed:.0f}' for speed in rivals[:5])} m/s"


def disagreements(picks: Mapping[str, float], metric: str, header: float, source: str) -> Iterator[str]:
    """Yield a sentence on the metrics, and one on the scan, that say something else."""
    far = [
        f"{name} {pick:.1f}"
        for name, pick in picks.items()
        if name in TRUSTED and abs(pick - picks[metric]) > DISAGREEMENT_M_S
    ]
    if far:
        yield f"other metrics differ by more than {DISAGREEMENT_M_S:g} m/s ({', '.join(far)})"
    if abs(header - picks[metric]) > DISAGREEMENT_M_S:
        yield f"the scan says {header:.1f} m/s ({source}); a wrong start time or array radius has the same effect"


def _rivals(speeds: Sequence[float], curve: Sequence[float], median: float) -> list[float]:
    """Return where other maxima rise nearly as far above the median as the best one, the highest first."""
    best, step = int(np.argmax(curve)), float(np.max(np.diff(speeds)))
    level = median + RIVAL * (curve[best] - median)
    tops = [
        i
        for i in range(1, len(curve) - 1)
        if curve[i] > max(curve[i - 1], level) and curve[i] >= curve[i + 1] and abs(speeds[i] - speeds[best]) > 2 * step
    ]
    return [speeds[i] for i in sorted(tops, key=lambda i: -curve[i])]
