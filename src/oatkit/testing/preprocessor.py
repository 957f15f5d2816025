"""What a preprocessor promises: signals that the forward model still predicts, in a scan of the same shape."""

import pickle
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.api import Geometry, Preprocessor, Scan
from oatkit.errors import OatkitError
from oatkit.testing.problems import PULSES_GEOMETRY, SOURCES_M, pulses, pulses_scan
from oatkit.testing.running import difference

PREDICTED = 0.03
"""Part of the processed signals that may differ from what the processed geometry predicts."""


def form_of_scan(plugin: Preprocessor) -> Iterator[str]:
    """Frames, wavelengths and detectors stay, notes are added to, and signals of valid channels are finite."""
    scan = pulses_scan()
    done = plugin.process(scan)
    if not isinstance(done, Scan):
        yield f"it returns {type(done).__name__}, no scan"
        return
    if done.signals.shape[:3] != scan.signals.shape[:3] or done.wavelengths_nm != scan.wavelengths_nm:
        yield f"(frame, wavelength, detector) is {done.signals.shape[:3]} at {done.wavelengths_nm} nm afterwards"
    if done.geometry.detectors != scan.geometry.detectors:
        yield "the detectors are others afterwards"
    if done.notes[: len(scan.notes)] != scan.notes:
        yield "the notes of the scan are lost; add to them"
    if not np.isfinite(np.asarray(done.signals)[done.valid]).all():
        yield "signals of valid channels are not finite afterwards"
    if plugin.process(scan) != done:
        yield "it returns something else the second time"


def untouched(plugin: Preprocessor) -> Iterator[str]:
    """The scan that goes in stays as it is."""
    scan = pulses_scan()
    kept = pickle.loads(pickle.dumps(scan))
    plugin.process(scan)
    if not np.array_equal(kept.signals, np.asarray(scan.signals)) or not np.array_equal(kept.valid, scan.valid):
        yield "it changes the scan that it is given; return a new one"


def validity(plugin: Preprocessor) -> Iterator[str]:
    """A channel that is not valid stays so."""
    scan = pulses_scan()
    valid = scan.valid.copy()
    valid[0, 1, 2] = False
    done = plugin.process(replace(scan, valid=valid))
    if (done.valid & ~valid).any():
        yield "a channel that was not valid is valid afterwards"
    if not done.valid[valid].any():
        yield "no channel of a good scan is valid afterwards"


def geometry(plugin: Preprocessor) -> Iterator[str]:
    """The geometry of what it returns depends on the geometry alone, not on the signals."""
    one = plugin.process(pulses_scan()).geometry
    other = plugin.process(pulses_scan(scale=7.0, sources=SOURCES_M[:2])).geometry
    if one != other:
        yield "the geometry depends on the signals; the operator is built once for a scan"


def predicted(plugin: Preprocessor) -> Iterator[str]:
    """What it makes of the signals is what the model predicts for the geometry that it returns, to a factor.

    A filter convolves its response into ``geometry.impulse_response``, a crop moves ``start_time_s`` and
    ``n_samples``. The factor may be another at each wavelength (pulse energies, a sign). With and without an impulse
    response before it.
    """
    response = np.array([0.2, -0.5, 1.0, 0.6, -0.1])
    for name, before in (("", PULSES_GEOMETRY), (" with an impulse response", _with(response))):
        done = plugin.process(pulses_scan(geometry=before))
        told = pulses(done.geometry)
        for index, wavelength in enumerate(done.wavelengths_nm):
            valid = done.valid[0, index]
            found, expected = np.asarray(done.signals, float)[0, index][valid], told[valid]
            factor = float((found * expected).sum()) / float((expected**2).sum())
            error = difference(found, factor * expected)
            if not (error <= PREDICTED and factor):
                yield f"signals at {wavelength:g} nm are off by {error:.1%} from what the new geometry predicts{name}"


def whole_numbers(plugin: Preprocessor) -> Iterator[str]:
    """Whole numbers of 16 bits, as instruments give them, are processed as the same numbers with a point."""
    scan = pulses_scan()
    signals = np.asarray(scan.signals)
    loud = np.round(20_000 * signals / np.abs(signals).max())
    kinds: tuple[type, ...] = (np.int16, np.float64)
    whole, pointed = (plugin.process(replace(scan, signals=np.asarray(loud, kind))) for kind in kinds)
    error = difference(whole.signals, pointed.signals)
    if not error <= 1e-3:
        yield f"int16 signals give something else than the same float64 ones, by {error:.1%}"


def broken_channels(plugin: Preprocessor) -> Iterator[str]:
    """A channel of NaN is an error of oatkit's or marked as not valid; it does not spread to others."""
    scan = pulses_scan()
    signals = np.array(scan.signals)
    signals[0, 0, 3] = np.nan
    try:
        done = plugin.process(replace(scan, signals=signals))
    except OatkitError:
        return
    if not np.isfinite(np.asarray(done.signals)[done.valid]).all():
        yield "a channel of NaN stays valid, or makes others NaN; mark it in valid, or raise ValidationError"


def _with(response: np.ndarray) -> Geometry:
    return replace(PULSES_GEOMETRY, impulse_response=response)


CHECKS = (form_of_scan, untouched, validity, geometry, predicted, whole_numbers, broken_channels)
