"""What several steps of preprocessing ask of a scan."""

import numpy as np

from oatkit.api import Geometry, Scan, ValidationError


def finite_samples(scan: Scan, step: str) -> np.ndarray:
    """Return the signals as float32, or as float64 where they are wider than that can hold.

    Raises `ValidationError`, naming the step, where a sample is not finite.
    """
    signals = np.asarray(scan.signals)
    samples = signals.astype(np.result_type(signals.dtype, np.float32))
    broken = int((~np.isfinite(samples)).any(axis=3).sum())
    if broken:
        raise ValidationError(f"{step}: {broken} channels hold samples that are not finite; put 'channels' before it")
    return samples


def check_offset_removed(samples: np.ndarray, valid: np.ndarray, step: str) -> None:
    """Raise `ValidationError`, naming the step, where the signals still lie about a level that is not zero.

    That is: in most of the valid channels the median is further from zero than the standard deviation.
    """
    level = abs(np.median(samples, axis=3))[valid]
    spread = samples.std(axis=3, dtype=float)[valid]
    if level.size and (level > spread).mean() > 0.5:
        raise ValidationError(
            f"{step}: the signals lie about {np.median(level):.4g}, not about zero; put the step 'offset' before it"
        )


def window(geometry: Geometry, start_us: float, stop_us: float, step: str) -> slice:
    """Return the samples taken from `start_us` up to, not including, `stop_us` after the light pulse.

    Raises `ValidationError`, naming the step, where there are none.
    """
    first, last = np.searchsorted(geometry.times_s, [1e-6 * start_us, 1e-6 * stop_us])
    if first >= last:
        begin, end = 1e6 * geometry.times_s[[0, -1]]
        raise ValidationError(
            f"{step}: no sample lies in {start_us:g} .. {stop_us:g} us; the record covers {begin:.4g} .. {end:.4g} us"
        )
    return slice(int(first), int(last))
