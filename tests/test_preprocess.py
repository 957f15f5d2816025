"""The steps between raw and clean signals, against exact identities and independent filters."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from oatkit.builtin.forward.arc import Arc
from oatkit.builtin.preprocess.band_pass import BandPass
from oatkit.builtin.preprocess.channels import Channels
from oatkit.builtin.preprocess.energy import Energy
from oatkit.builtin.preprocess.invert import Invert
from oatkit.builtin.preprocess.offset import Offset
from oatkit.builtin.preprocess.transient import Transient
from oatkit.builtin.readers.ithera import IThera
from oatkit.data import Detectors, Geometry, Grid, Scan
from oatkit.errors import ReadError, ValidationError

RATE_HZ = 40e6
STEPS = [Channels(), Offset(), Transient(), Energy(), BandPass()]


def scan_of(signals, energy=None, **geometry) -> Scan:
    """A scan of one frame from signals ``(wavelength, detector, sample)``."""
    signals = np.asarray(signals)
    angles = np.linspace(0, 4, signals.shape[1])
    detectors = Detectors(0.04 * np.stack([np.sin(angles), np.cos(angles)], axis=1))
    energies = None if energy is None else np.array([energy], float)
    wavelengths = 700 + 10 * np.arange(len(signals))
    return Scan(signals[None], Geometry(detectors, RATE_HZ, signals.shape[2], **geometry), wavelengths, None, energies)


def noise(shape=(2, 6, 400), seed=0) -> np.ndarray:
    """Signals about zero."""
    return np.random.default_rng(seed).standard_normal(shape)


def raw(shape=(2, 6, 400)) -> np.ndarray:
    """Whole numbers about an offset of each channel, as an instrument gives them."""
    offsets = 35_000 + 300 * np.arange(shape[1])[:, None]
    return (offsets + 500 * noise(shape)).astype("u2")


# All steps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_the_geometry_never_depends_on_the_signals(step):
    """The operator is built once for a scan: two frames with other signals get the same geometry."""
    first, second = scan_of(noise(), [1, 2]), scan_of(7 * noise(seed=1), [3, 4])
    assert step.process(first).geometry == step.process(second).geometry


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.name)
def test_every_step_leaves_a_note_or_nothing_to_say(step):
    """What was done stands in the notes, after those that were there."""
    before = replace(scan_of(noise(), [1, 2]), notes=("read",))
    after = step.process(before)
    assert after.notes[0] == "read"
    assert after.notes[1].startswith(f"{step.name}: ")


@pytest.mark.parametrize("step", STEPS[1:], ids=lambda step: step.name)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_samples_that_are_not_finite_are_refused(step, bad):
    """One NaN would spread over the image; the sentence names the step that finds such channels."""
    signals = noise()
    signals[1, 2, 300] = bad
    with pytest.raises(ValidationError, match="1 channels hold samples that are not finite; put 'channels' before"):
        step.process(scan_of(signals, [1, 2]))


@pytest.mark.parametrize("step", STEPS[2:], ids=lambda step: step.name)
def test_the_offset_has_to_go_first(step):
    """Zeros, divisions and filters mean something else about an offset of 35 000."""
    with pytest.raises(ValidationError, match=f"{step.name}: the signals lie about .* put the step 'offset' before it"):
        step.process(scan_of(raw(), [1, 2]))
    step.process(Offset().process(scan_of(raw(), [1, 2])))


def test_the_mouse_goes_through_all_steps(mouse_scan):
    """All channels stay, and what is left is float32, without energies, about zero, and below 9 MHz to 1e-3."""
    scan = IThera().read(mouse_scan).frame(0)
    for step in STEPS:
        scan = step.process(scan)
    clean = scan.signals[0, 0]
    power = (abs(np.fft.rfft(clean, axis=1)) ** 2).sum(axis=0)
    frequency = np.fft.rfftfreq(2030 - 150, 1 / RATE_HZ)
    assert scan.valid.all()
    assert clean.dtype == np.float32
    assert power[frequency > 9e6].sum() < 1e-3 * power.sum()
    assert abs(clean.mean(axis=1)).max() < 0.06 * clean.std()
    assert scan.pulse_energy is None


# Offset -------------------------------------------------------------------------------------------------------------


@given(st.lists(st.integers(0, 65535), min_size=2, max_size=50), st.sampled_from(["median", "mean"]))
def test_unsigned_numbers_never_wrap(values, statistic):
    """The result is the exact difference, whatever the values: 100 - 200 is -100, not 65436."""
    scan = Offset(statistic=statistic).process(scan_of(np.array([[values]], "u2")))
    level = np.median(values) if statistic == "median" else np.mean(values)
    # A float32 resolves 2^-8 at 65535.
    assert scan.signals.dtype == np.float32
    assert np.allclose(scan.signals[0, 0, 0], np.array(values) - level, rtol=0, atol=2**-8)


@pytest.mark.parametrize(("dtype", "expected"), [("u1", "f4"), ("i2", "f4"), ("f4", "f4"), ("i4", "f8"), ("f8", "f8")])
def test_the_offset_step_gives_floats_wide_enough(dtype, expected):
    """Single precision where it holds every value of the type, else double."""
    signals = np.round(20 * noise() + 100).astype(dtype)
    assert Offset().process(scan_of(signals)).signals.dtype == expected


def test_the_window_decides_what_the_offset_is():
    """Only samples from start up to stop, after the light pulse, count; sample k is at start_time_s + k / rate."""
    signals = np.full((1, 1, 400), 5.0)
    signals[..., 100:200] = 7.0
    scan = scan_of(signals, start_time_s=1e-6)
    after = Offset(start=1 + 100 / 40, stop=1 + 200 / 40, statistic="mean").process(scan)
    assert after.signals[0, 0, 0, 150] == 0
    assert after.signals[0, 0, 0, 50] == -2


def test_the_median_is_not_moved_by_the_transient():
    """A burst of 10 % of the record shifts the mean by thousands and the median by noise."""
    signals = raw((1, 4, 2000)).astype(float)
    clean = Offset().process(scan_of(signals)).signals
    signals[..., :200] = 65_535
    assert abs(Offset().process(scan_of(signals)).signals - clean)[..., 200:].max() < 100
    assert abs(Offset(statistic="mean").process(scan_of(signals)).signals - clean)[..., 200:].max() > 2500


def test_a_window_outside_the_record_is_refused():
    """With the times that the record covers."""
    with pytest.raises(ValidationError, match=r"no sample lies in 50 .. 60 us; the record covers 0 .. 9\.975 us"):
        Offset(start=50.0, stop=60.0).process(scan_of(noise()))


# Transient ----------------------------------------------------------------------------------------------------------


@given(st.floats(0, 9.9))
def test_the_transient_is_cut_off_and_the_rest_untouched(until):
    """Samples from the time on are the old ones, each at its old time; those before it are gone."""
    before = scan_of(noise())
    after = Transient(until=until).process(before)
    late = before.geometry.times_s >= 1e-6 * until
    assert np.array_equal(after.signals, before.signals[..., late])
    assert np.allclose(after.geometry.times_s, before.geometry.times_s[late], rtol=0, atol=1e-20)
    same = {"start_time_s": 0, "n_samples": 400}
    assert replace(after.geometry, **same) == before.geometry


def test_the_default_is_150_samples_at_40_mhz():
    """5.6 mm of water, as the notes say; a record that starts later loses less."""
    after = Transient().process(scan_of(noise()))
    assert after.geometry.n_samples == 400 - 150
    assert after.notes[-1].startswith("transient: 150 samples before 3.75 us were cut off")
    assert "nearer than 5.62 mm" in after.notes[-1]
    assert Transient().process(scan_of(noise(), start_time_s=2e-6)).geometry.n_samples == 400 - 70


def small_ring(n_samples: int = 500) -> tuple[Scan, Grid, np.ndarray]:
    """A scan of 32 detectors at 6.5 mm about a view of 8 mm, which the transient reaches, its grid and the image."""
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    detectors = Detectors(6.5e-3 * np.stack([np.sin(angles), np.cos(angles)], axis=1))
    geometry, grid = Geometry(detectors, RATE_HZ, n_samples), Grid((40, 40), 2e-4)
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    image = np.exp(-((y - 2e-3) ** 2 + x**2) / (2 * 0.6e-3**2)) + (np.hypot(y, x) < 3e-3)
    signals = predicted_by_arc(geometry, grid, image)
    return Scan(signals[None, None], geometry, (700,)), grid, image


def predicted_by_arc(geometry: Geometry, grid: Grid, image: np.ndarray) -> np.ndarray:
    """Signals of an image, shape ``(detector, sample)``, in double precision."""
    return Arc(precision="double").operator(geometry, grid).matvec(image.ravel()).reshape(geometry.shape)


@pytest.mark.parametrize("n_samples", [500, 250])
def test_the_model_predicts_what_the_transient_has_left(n_samples):
    """Of any image the residual is that of the whole record in the samples kept, also where the grid reaches beyond."""
    scan, grid, image = small_ring(n_samples)
    kept = Transient().process(scan)
    other = np.random.default_rng(1).standard_normal(image.shape)
    whole = predicted_by_arc(scan.geometry, grid, other) - scan.signals[0, 0]
    residual = predicted_by_arc(kept.geometry, grid, other) - kept.signals[0, 0]
    assert np.linalg.norm(whole[:, :150]) > 0.3 * np.linalg.norm(whole)
    assert np.linalg.norm(residual - whole[:, 150:]) < 1e-14 * np.linalg.norm(whole)


def test_a_filter_after_the_transient_errs_next_to_the_cut_only():
    """Where the grid reaches into what was cut off, a low-pass of 7 MHz misfits in the first 16 samples, not after."""
    scan, grid, image = small_ring()
    filtered = BandPass(low=0.0).process(Transient().process(scan))
    misfit = predicted_by_arc(filtered.geometry, grid, image) - filtered.signals[0, 0]
    assert np.linalg.norm(misfit[:, 16:]) < 4e-4 * np.linalg.norm(filtered.signals)
    assert np.linalg.norm(misfit[:, :16]) > 1e-2 * np.linalg.norm(filtered.signals)


def test_a_transient_longer_than_the_record_is_refused():
    """Nothing would be left."""
    with pytest.raises(ValidationError, match="no sample lies in"):
        Transient(until=10.0).process(scan_of(noise()))


# Channels -----------------------------------------------------------------------------------------------------------


def test_every_kind_of_bad_channel_is_found_and_named():
    """Not finite, dead, noisy: marked at its wavelength alone, zeroed, and listed in the notes."""
    signals = noise()
    signals[0, 1, 300] = np.nan
    signals[0, 3] = 35_000
    signals[1, 4, 200:] *= 50
    signals[1, 5, 5] = -np.inf
    scan = Channels(noisy=10.0).process(scan_of(signals))
    expected = np.ones((1, 2, 6), bool)
    expected[0, 0, [1, 3]] = expected[0, 1, [4, 5]] = False
    assert np.array_equal(scan.valid, expected)
    assert (scan.signals[~expected] == 0).all()
    assert np.array_equal(scan.signals[expected], signals[None][expected])
    assert "channels: not used at 700 nm: 1 not finite; 3 dead." in scan.notes
    assert "channels: not used at 710 nm: 5 not finite; 4 noisy." in scan.notes


@pytest.mark.parametrize("limit", [0, 65_535])
def test_saturation_is_seen_at_either_limit_of_the_type(limit):
    """One sample in 250 at a limit is too many, unless it is in the transient."""
    signals = raw()
    signals[1, 2, 399] = limit
    signals[0, :, :100] = limit
    scan = Channels().process(scan_of(signals))
    assert np.argwhere(~scan.valid).tolist() == [[0, 1, 2]]
    assert "2 saturated" in scan.notes[-1]
    assert Channels(saturated=0.004).process(scan_of(signals)).valid.all()


def test_saturation_of_floats_is_not_guessed():
    """Limits are known for whole numbers only; the notes say that this was not judged."""
    scan = Channels().process(scan_of(noise()))
    assert scan.valid.all()
    assert "saturation cannot be seen" in scan.notes[0]


def test_the_mouse_saturates_in_its_transient_only(mouse_scan):
    """202 + 304 samples at the limits, all of them among the first 100, so that no channel is lost."""
    scan = IThera().read(mouse_scan).frame(0)
    limits = (scan.signals == 0) | (scan.signals == 65_535)
    assert ((scan.signals == 0).sum(), (scan.signals == 65_535).sum()) == (202, 304)
    assert not limits[..., 100:].any()
    assert Channels().process(scan).valid.all()
    assert not Channels(after=0.0).process(scan).valid.all()


def test_zeros_are_dead_though_they_lie_at_a_limit():
    """A channel of zeros in whole numbers without a sign is called dead; one that often touches a limit, saturated."""
    signals = np.random.default_rng(0).integers(100, 900, (1, 4, 400)).astype("u2")
    signals[0, 1] = 0
    signals[0, 2, 200:300] = 65_535
    signals[0, 3, 200:300] = 0
    scan = Channels().process(scan_of(signals))
    assert scan.notes[-1] == "channels: not used at 700 nm: 1 dead; 2, 3 saturated."


def test_channels_invalid_before_stay_so():
    """The step only ever takes away, and does not judge others by them."""
    signals = noise()
    signals[0, :4] *= 1e-6
    before = scan_of(signals)
    valid = before.valid.copy()
    valid[0, 0, :4] = False
    after = Channels().process(replace(before, valid=valid))
    assert np.array_equal(after.valid, valid)


@pytest.mark.parametrize("value", [0, 35_000, np.nan])
def test_a_scan_without_a_single_good_channel_is_refused(value):
    """All zero, constant, or not a number: a sentence with the wavelength, not an empty image."""
    signals = noise()
    signals[1] = value
    with pytest.raises(ReadError, match="no channel is left at 710 nm"):
        Channels().process(scan_of(signals))


# Band-pass ----------------------------------------------------------------------------------------------------------

bands = st.builds(
    BandPass, low=st.sampled_from([0.0, 0.05, 0.1, 0.5]), high=st.floats(1.0, 19.0), order=st.integers(1, 8)
)


@given(bands, st.integers(0, 399))
def test_a_filtered_pulse_is_the_response_of_the_model(band, k):
    """Data and model match: filtering a unit sample gives the geometry's impulse response, time zero at n // 2."""
    signals = np.zeros((1, 1, 400))
    signals[..., k] = 1
    scan = band.process(scan_of(signals))
    response = scan.geometry.impulse_response
    centre = len(response) // 2
    assert np.allclose(scan.signals[0, 0, 0], response[centre - k :][:400], rtol=0, atol=1e-14)


@given(bands, st.integers(1, 30), st.integers(0, 2**32 - 1))
def test_the_filter_joins_the_response_of_the_instrument(band, length, seed):
    """What the filtered model predicts is the filter of what the raw model predicts, where the record holds it all."""
    rng = np.random.default_rng(seed)
    instrument, ideal = rng.standard_normal(length), np.zeros(400)
    ideal[60:300] = rng.standard_normal(240)
    before = scan_of(predicted(instrument, ideal)[None, None], impulse_response=instrument)
    after = band.process(before)
    again = predicted(after.geometry.impulse_response, ideal)
    assert np.allclose(after.signals[0, 0, 0], again, rtol=0, atol=1e-12 * max(1, abs(again).max()))


def predicted(response: np.ndarray, ideal: np.ndarray) -> np.ndarray:
    """Convolve a record with a response whose time zero is at index n // 2, by its definition."""
    start = len(response) // 2
    return np.convolve(ideal, response)[start : start + len(ideal)]


@given(bands)
def test_the_gain_is_that_of_two_butterworth_filters(band):
    """SciPy's analog low-pass and high-pass, squared."""
    frequency = np.linspace(0, 20e6, 300)
    expected = butterworth(frequency, band.high, band.order, "low")
    if band.low:
        expected *= butterworth(frequency, band.low, band.order, "high")
    assert np.allclose(band.gain(frequency), expected, rtol=0, atol=1e-9)


def butterworth(frequency_hz, edge_mhz, order, kind) -> np.ndarray:
    """Squared magnitude of SciPy's filter, designed in MHz."""
    numerator, denominator = signal.butter(order, edge_mhz, kind, analog=True)
    return abs(signal.freqs(numerator, denominator, frequency_hz / 1e6)[1]) ** 2


@given(st.floats(0.5, 12), bands)
def test_a_tone_is_scaled_by_the_gain_and_not_moved(frequency_mhz, band):
    """Zero phase: in the middle of a long record, a cosine stays a cosine, G times as high."""
    times = np.arange(4000) / RATE_HZ
    tone = np.cos(2e6 * np.pi * frequency_mhz * times)
    after = band.process(scan_of(tone[None, None])).signals[0, 0, 0]
    middle = slice(1500, 2500)
    assert np.allclose(after[middle], band.gain(1e6 * frequency_mhz) * tone[middle], rtol=0, atol=2e-3)


def test_single_precision_stays_single():
    """Float32 goes in and comes out, within its rounding of the double result."""
    double = BandPass().process(scan_of(noise())).signals
    single = BandPass().process(scan_of(noise().astype("f4"))).signals
    assert single.dtype == np.float32
    assert abs(single - double).max() < 2e-6


def test_edges_in_the_wrong_order_are_refused():
    """When the filter is made, before any scan is read."""
    with pytest.raises(ValidationError, match=r"low must be below high, got 8\.0 and 7\.0 MHz"):
        BandPass(low=8.0)
    with pytest.raises(ValidationError, match=r"got 3\.0 and 3\.0"):
        BandPass(low=3.0, high=3.0)


def test_an_edge_above_half_the_sampling_rate_is_refused():
    """It would pass everything while saying that it does not."""
    with pytest.raises(ValidationError, match="high must be below 20 MHz, got 20 MHz"):
        BandPass(high=20.0).process(scan_of(noise()))


def test_the_edges_of_the_record_do_not_reach_the_mouse(mouse_scan):
    """Records count as zero outside; continuing them smoothly instead changes samples 694 .. 1438 by 0.5 %."""
    scan = IThera().read(mouse_scan).frame(0)
    for step in STEPS[:3]:
        scan = step.process(scan)
    ours = BandPass().process(scan).signals[0, 0]
    extended = np.pad(scan.signals[0, 0].astype(float), ((0, 0), (1500, 1500)), "reflect", reflect_type="odd")
    gain = BandPass().gain(np.fft.rfftfreq(extended.shape[1], 1 / RATE_HZ))
    smooth = np.fft.irfft(np.fft.rfft(extended) * gain, extended.shape[1])[:, 1500:]
    there = slice(694 - 150, 1438 - 150)
    assert np.linalg.norm(ours[:, there] - smooth[:, there]) < 0.01 * np.linalg.norm(smooth[:, there])


# Energy -------------------------------------------------------------------------------------------------------------


def test_each_wavelength_is_divided_by_its_energy():
    """And the energies leave the scan, so that a second time does nothing."""
    once = Energy().process(scan_of(noise(), [2.0, 5.0]))
    assert np.allclose(once.signals[0], noise() / np.array([2, 5])[:, None, None], rtol=1e-15)
    twice = Energy().process(once)
    assert np.array_equal(twice.signals, once.signals)
    assert "nothing was divided" in twice.notes[-1]


@pytest.mark.parametrize("energy", [0, -1, np.nan, np.inf])
def test_an_energy_that_is_not_positive_is_refused(energy):
    """With the wavelength at which it was found."""
    with pytest.raises(ReadError, match="expected a positive pulse energy at 710 nm"):
        Energy().process(scan_of(noise(), [1, energy]))


def test_inverting_twice_changes_nothing(small_scan):
    """`invert` gives the negative signals, of whole numbers too, without wrapping; twice gives the signals back."""
    invert = Invert()
    whole = replace(small_scan, signals=np.arange(2 * 48 * 400, dtype=np.uint16).reshape(2, 1, 48, 400))
    for scan in (small_scan, whole):
        once = invert.process(scan)
        assert (once.signals == -np.asarray(scan.signals, float)).all()
        assert (invert.process(once).signals == scan.signals).all()
        assert "multiplied by -1" in once.notes[-1]
