"""Speed of sound by focus: the truth of simulated scans, invariances, warnings, and one real mouse."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.signal import convolve2d
from scipy.stats import kurtosis

import oatkit
from oatkit import Geometry, Memo, Pipeline, plugin
from oatkit.api import Detectors
from oatkit.drawing.page import png
from oatkit.errors import ValidationError
from oatkit.focus import focus
from oatkit.focus.figure import focus_figure
from oatkit.focus.metrics import METRICS, TRUSTED
from oatkit.simulate import arc_detectors, msot_geometry, simulate_scan, star

TRUE_M_S = 1507.3
RADIUS_M = 0.015
SMALL = ("grid.pixels=64", "grid.field_of_view_mm=9.5")


@pytest.fixture(scope="module")
def pipeline():
    """Sixty-four pixels a side: 15 m/s shift a wave front of the small scan by a pixel."""
    return Pipeline.load("maxent", SMALL)


@pytest.fixture(scope="module")
def scan():
    """A star among 64 detectors at 15 mm, in water of `TRUE_M_S`."""
    geometry = Geometry(arc_detectors(64, RADIUS_M, 270), 20e6, 400, start_time_s=2e-6, speed_of_sound_m_s=TRUE_M_S)
    return simulated(lambda grid: star(grid, radius_m=4e-3), geometry, field_of_view_m=10e-3, pixels=131)


@pytest.fixture(scope="module")
def found(pipeline, scan):
    """What focus says of the small scan."""
    return focus(pipeline, scan)


def simulated(phantom, geometry, **settings):
    """A scan by the arc model at 10 dB."""
    return simulate_scan(phantom, plugin("forward_model", "arc")(), geometry=geometry, snr_db=10.0, **settings)


def with_geometry(scan, **changes):
    """The same signals, said to be taken by another geometry."""
    return replace(scan, geometry=replace(scan.geometry, **changes))


@pytest.mark.parametrize("phantom", ["breast", "vessel", "star"])
def test_the_true_speed_of_sound_is_found(phantom):
    """At 10 dB and with the presets' grid, each trusted metric is within 1 m/s of the truth, whatever the file says."""
    true = replace(msot_geometry(), speed_of_sound_m_s=1503.7)
    scan = simulated(phantom, true).with_speed_of_sound(1540.0, "somebody")
    found = focus(Pipeline.load("maxent"), scan)
    assert {name: found.picks[name] for name in TRUSTED} == pytest.approx(dict.fromkeys(TRUSTED, 1503.7), abs=1.0)


def test_the_header_does_not_move_the_pick(pipeline, scan, found):
    """The speed of sound that the file says is reported as it stands, and has no part in the pick."""
    other = focus(pipeline, scan.with_speed_of_sound(1450.0, "somebody"))
    assert (other.header_m_s, other.header_source) == (1450.0, "somebody")
    assert other.speed_m_s == pytest.approx(found.speed_m_s, abs=1.0)
    assert any("the scan says 1450.0 m/s (somebody)" in note for note in other.notes)


def test_scan_and_pipeline_stay_as_they_are(pipeline, scan, found):
    """Only `apply` makes a pipeline with the pick, which a run then uses."""
    assert scan.geometry.speed_of_sound_m_s == TRUE_M_S == found.header_m_s
    assert pipeline == Pipeline.load("maxent", SMALL)
    quick = Pipeline.load("backprojection", SMALL)
    used = oatkit.run(found.apply(quick), scan).scan["speed_of_sound_m_s"]
    assert used == found.speed_m_s == found.picks["variance"]


def test_a_larger_array_looks_like_faster_sound(pipeline, scan, found):
    """Only R / c is measured: said to be 1 % larger, the array needs a speed of sound 1 % higher."""
    larger = Detectors(1.01 * scan.geometry.detectors.positions_m)
    pick = focus(pipeline, with_geometry(scan, detectors=larger)).speed_m_s
    assert pick - found.speed_m_s == pytest.approx(0.01 * TRUE_M_S, abs=2.0)


def test_a_wrong_start_time_moves_the_pick(pipeline, scan, found):
    """A start time that is late by dt lowers the pick by c^2 dt / R, to first order."""
    late_s = 1e-7
    pick = focus(pipeline, with_geometry(scan, start_time_s=2e-6 + late_s)).speed_m_s
    assert found.speed_m_s - pick == pytest.approx(TRUE_M_S**2 * late_s / RADIUS_M, abs=2.0)


def test_the_same_for_any_number_of_threads(pipeline, scan, found, monkeypatch):
    """Scores, picks and notes are equal to the last bit on one thread and on three."""
    for threads in ("1", "3"):
        monkeypatch.setenv("OATKIT_THREADS", threads)
        assert focus(pipeline, scan) == found


def test_the_sweep_covers_its_range_and_is_finer_about_the_pick(found):
    """Speeds rise from one end to the other, in steps of a quarter of the largest one next to the pick."""
    steps = np.diff(found.speeds_m_s)
    assert (found.speeds_m_s[0], found.speeds_m_s[-1]) == (1400.0, 1600.0)
    assert steps.min() > 0
    best = int(np.argmax(found.scores["variance"]))
    assert steps[best - 1 : best + 1] == pytest.approx(steps.max() / 4)
    assert abs(found.speed_m_s - found.speeds_m_s[best]) <= steps.max() / 8 + 0.05


@pytest.mark.parametrize("range_m_s", [(1400.0, 1502.0), (1513.0, 1600.0)])
def test_a_maximum_at_the_end_of_the_range_is_flagged(pipeline, scan, range_m_s):
    """Where the truth lies beyond an end of the range, that end is picked, and a note says so."""
    found = focus(pipeline, scan, speeds_m_s=range_m_s)
    assert found.speed_m_s in range_m_s
    assert any("end of the range" in note for note in found.notes)


def test_noise_is_flagged_as_flat(pipeline, scan, found):
    """No speed of sound focuses noise: the curve of a scan of noise alone is flagged as flat, that of a body is not."""
    noise = np.random.default_rng(0).standard_normal(scan.signals.shape)
    assert any("flat" in note for note in focus(pipeline, replace(scan, signals=noise)).notes)
    assert not any("flat" in note for note in found.notes)


def test_a_sound_pick_has_no_notes(found):
    """Nothing is said against a pick on which the trusted metrics and the file agree."""
    assert found.notes == ()


def test_the_strongest_wavelength_decides(pipeline, scan, found):
    """A wavelength of weak noise and a broken channel, which is marked, change nothing to speak of."""
    noise = 0.1 * np.random.default_rng(0).standard_normal(scan.signals.shape) * np.std(scan.signals)
    signals = np.concatenate([noise, scan.signals], axis=1)
    signals[:, 0, 5] = 1e6
    valid = np.ones(signals.shape[:3], bool)
    valid[:, :, 5] = False
    both = replace(scan, signals=signals, wavelengths_nm=(700.0, 800.0), valid=valid)
    assert focus(pipeline, both).speed_m_s == pytest.approx(found.speed_m_s, abs=1.0)


def test_a_file_that_is_far_from_tissue_is_taken_at_its_word(pipeline, scan):
    """A medium slower or faster than soft tissue is searched about what the file says."""
    found = focus(pipeline, scan.with_speed_of_sound(1700.0, "a salt solution"))
    assert (found.speeds_m_s[0], found.speeds_m_s[-1]) == (1600.0, 1800.0)


def test_every_speed_is_told_and_none_tried_twice(pipeline, scan, found):
    """There is an event for each speed that is tried, and none where the memo knows the answer."""
    memo, heard = Memo(), []
    first = focus(pipeline, scan, memo=memo, on_event=heard.append)
    assert len(heard) == len(found.speeds_m_s)
    assert focus(pipeline, scan, memo=memo, on_event=heard.append) == first == found
    assert len(heard) == len(found.speeds_m_s)


def test_the_record_is_plain(found):
    """The table for a result's record is JSON as it stands, with every curve."""
    import json

    table = json.loads(json.dumps(found.table()))
    assert table["picks"] == dict(found.picks)
    assert {len(curve) for curve in table["scores"].values()} == {len(table["speeds_m_s"])}


@pytest.mark.parametrize("range_m_s", [(1500.0, 1400.0), (1500.0, np.nan), (0.0, 1500.0), (1.4, 1.6), (1500.0,)])
def test_a_range_that_is_none_is_refused(pipeline, scan, range_m_s):
    """The lowest speed comes first, both are possible speeds in m/s, and NaN is none."""
    with pytest.raises(ValidationError, match="m/s"):
        focus(pipeline, scan, speeds_m_s=range_m_s)


def test_bad_requests_get_their_sentence(pipeline, scan):
    """An unknown metric is answered with the nearest name, data that are zero with what that means."""
    with pytest.raises(ValidationError, match="no metric named 'varience'; did you mean 'variance'"):
        focus(pipeline, scan, metric="varience")
    raw = pipeline.model_copy(update={"preprocess": ()})
    with pytest.raises(ValidationError, match="the data are zero"):
        focus(raw, replace(scan, signals=np.zeros(scan.signals.shape)))


@pytest.fixture(scope="module")
def plane():
    """A small square and a bar on nothing, far from the edge."""
    image = np.zeros((40, 50))
    image[12:18, 14:20] = 1.0
    image[20:22, 12:30] = -0.5
    return image


@pytest.mark.parametrize("name", METRICS)
def test_metrics_do_not_depend_on_scale_or_place(name, plane):
    """Any factor, of either sign, and any shift over a background of zeros leave a score as it is."""
    score = METRICS[name](plane)
    for other in (1e-12 * plane, -3 * plane, 1e9 * plane, np.roll(plane, (9, 13), (0, 1))):
        assert METRICS[name](other) == pytest.approx(score, rel=1e-12)


@pytest.mark.parametrize("name", METRICS)
def test_metrics_fall_with_blur(name, plane):
    """The wider a Gaussian of a pixel or more blurs an image, the lower is its score; an image of zeros has 0."""
    scores = [METRICS[name](gaussian_filter(abs(plane), width)) for width in (1.0, 2.0, 3.0, 4.0)]
    assert (np.diff(scores) < 0).all()
    assert METRICS[name](np.zeros((5, 5))) == 0


def test_metrics_agree_with_others(plane):
    """Kurtosis is scipy's, the Sobel gradient a convolution, and of two waves the faster holds its share of energy."""
    image = plane + np.random.default_rng(0).standard_normal(plane.shape)
    assert METRICS["kurtosis"](image) == pytest.approx(kurtosis(image, axis=None, fisher=False), rel=1e-12)
    mask = np.outer([1, 2, 1], [-1, 0, 1])
    gradients = [convolve2d(np.pad(image, 1, "symmetric"), kernel, "valid") for kernel in (mask, mask.T)]
    steep = sum((gradient**2).mean() for gradient in gradients)
    assert METRICS["tenengrad"](image) == pytest.approx(steep / abs(image).mean() ** 2, rel=1e-12)
    wave = np.cos(2 * np.pi * np.arange(50) / 25) + 0.5 * np.cos(2 * np.pi * np.arange(50) / 5)
    assert METRICS["spectral-energy"](np.tile(wave, (40, 1))) == pytest.approx(0.25 / 1.25, rel=1e-12)


def test_the_figure_shows_every_curve(found):
    """All metrics are drawn once, each from 0 to 1 with its best speed in the legend, and the figure prints."""
    figure = focus_figure(found)
    curves = {line.get_label(): line.get_ydata() for axes in figure.axes for line in axes.lines}
    for name, pick in found.picks.items():
        drawn = curves[f"{name}, best at {pick:.1f}"]
        assert (min(drawn), max(drawn)) == (0.0, 1.0)
    assert png(figure).startswith(b"\x89PNG")


def test_a_real_mouse(mouse_scan):
    """The pick for the real mouse lies in 1465 .. 1485 m/s, next to the 1469.3 m/s that its header adds up to."""
    found = focus(Pipeline.load("maxent"), oatkit.read(mouse_scan))
    assert found.header_m_s == pytest.approx(1469.3, abs=0.05)
    assert 1465 <= found.speed_m_s <= 1485
