"""Data and numbers at the limits of what can be: a finite image and a reason, or one sentence."""

from dataclasses import replace

import numpy as np
import pytest

import oatkit
from oatkit import Pipeline, Scan
from oatkit.errors import OatkitError

QUICK = ("grid.pixels=24", "grid.field_of_view_mm=9", "reconstruct.n_iterations=5")
WEIGHTED = ("maxent", "l1", "tv", "lsqr")


def check_run(pipeline: Pipeline, scan: Scan) -> str:
    """Return why it is refused, in one line; or nothing, all pixels being finite, with a reason where not converged."""
    try:
        image = oatkit.run(pipeline, scan)["initial_pressure"]
    except OatkitError as error:
        assert "\n" not in str(error)  # noqa: PT017  a run may also end well
        return str(error)
    assert np.isfinite(image.values).all()
    for converged, reason in zip(image.diagnostics["converged"], image.diagnostics["reason"], strict=True):
        assert converged or reason
    return ""


@pytest.mark.parametrize("weight", ["1e-250", "1e-12", "1e12", "1e250"])
@pytest.mark.parametrize("preset", WEIGHTED[:3])
def test_any_weight_gives_a_finite_image_or_a_sentence(small_scan, preset, weight):
    """Far beyond any that makes sense, on either side."""
    check_run(Pipeline.load(preset, [*QUICK, f"reconstruct.weight={weight}"]), small_scan)


@pytest.mark.parametrize(
    "change", ["reconstruct.n_iterations=0", "reconstruct.weight=0", "reconstruct.prior=0", "reconstruct.prior=-1"]
)
def test_steps_and_starts_that_cannot_be_are_refused(change):
    """No steps, no weight, and a start at 0, where the logarithm has no value."""
    with pytest.raises(oatkit.ValidationError, match=r"must be .*(at least|above)"):
        Pipeline.load("maxent", [change])


def _spoiled(scan: Scan, how: str) -> Scan:
    signals = np.array(scan.signals, dtype=float)
    if how in ("zero", "constant"):
        signals[:] = 0.0 if how == "zero" else 7.0
    elif how in ("nan", "inf"):
        signals[0, 0, 3, 100] = np.nan if how == "nan" else np.inf
    elif how == "dead":
        signals[:, :, 3] = 0.0
    elif how == "huge":
        signals *= 1e200
    elif how == "tiny":
        signals *= 1e-200
    elif how == "unsigned":
        signals = np.round(3e4 + 1e4 * signals / abs(signals).max()).astype("u2")
    return replace(scan, signals=signals)


@pytest.mark.parametrize("preset", WEIGHTED)
@pytest.mark.parametrize("how", ["zero", "constant", "nan", "inf", "dead", "huge", "tiny", "unsigned"])
def test_any_signals_give_a_finite_image_or_a_sentence(small_scan, preset, how):
    """All zero, constant, with a sample that is no number, with a dead channel, of any size and type."""
    refusal = check_run(Pipeline.load(preset, QUICK), _spoiled(small_scan, how))
    assert not refusal or how not in ("dead", "unsigned")


def test_unsigned_signals_give_the_image_of_signed_ones(small_scan):
    """Nothing wraps around: 100 - 200 is -100, not 65436."""
    unsigned = _spoiled(small_scan, "unsigned")
    signed = replace(unsigned, signals=np.asarray(unsigned.signals, dtype=float))
    one, other = (
        oatkit.run(Pipeline.load("lsqr", QUICK), scan)["initial_pressure"].values for scan in (unsigned, signed)
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-4 * abs(other).max())


@pytest.mark.parametrize("wavelengths", [(700.0,), (700.0, 700.0), (800.0, 700.0)])
def test_wavelengths_keep_their_place(small_scan, wavelengths):
    """One alone, the same twice, in falling order: each plane is that of its own signals."""
    one = np.asarray(small_scan.signals)[:1, :1]
    factors = np.arange(1.0, len(wavelengths) + 1)[:, None, None]
    scan = Scan(one * factors, small_scan.geometry, wavelengths)
    image = oatkit.run(Pipeline.load("lsqr", QUICK), scan)["initial_pressure"]
    assert image.wavelengths_nm == wavelengths
    for plane, factor in zip(image.values, factors.ravel(), strict=True):
        np.testing.assert_allclose(plane, factor * image.values[0], atol=1e-3 * abs(plane).max())
