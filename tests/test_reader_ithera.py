"""The iThera reader, on the real scan and on hand-written ones of every version."""

import os
import pickle
import tracemalloc
from datetime import UTC, datetime

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import basic_indices

from msot_files import RING, equal, header, projections, write
from oatkit.builtin.readers.ithera import IThera
from oatkit.builtin.readers.ithera_signals import raw_signals
from oatkit.builtin.readers.speed_of_sound import water_speed_of_sound_m_s
from oatkit.errors import ReadError

RESPONSE = np.array([0.0, 0.1, -0.5, 1.0, 2.5, -1.5, 0.3, 0.1])


# The real scan ------------------------------------------------------------------------------------------------------


def test_the_mouse_holds_what_is_known_of_it(mouse_scan):
    """One frame at 700 nm of 256 detectors on an arc of 40.5 mm and 268.95 degrees, 2030 samples at 40 MHz."""
    scan = IThera().read(mouse_scan)
    y, x = scan.geometry.detectors.positions_m.T
    angles = np.degrees(np.unwrap(np.arctan2(y, x)))
    assert scan.signals.shape == (1, 1, 256, 2030)
    assert scan.signals.dtype == np.uint16
    assert scan.wavelengths_nm == (700.0,)
    assert scan.geometry.sampling_rate_hz == 40e6
    assert np.allclose(np.hypot(x, y), 0.0405, atol=1e-6)
    assert abs(angles[-1] - angles[0]) == pytest.approx(268.95, abs=0.01)
    assert scan.pulse_energy[0, 0] == 1193.8654300273377
    assert scan.position_m[0, 0] == pytest.approx(0.05965, abs=1e-12)
    assert scan.temperature_c[0, 0] == pytest.approx(33.27, abs=1e-9)
    assert scan.name == "201001_05_GC_SS"


def test_the_mouse_was_taken_when_its_header_says(mouse_scan):
    """The pulse came 4 s after the header's CreationTime by the clock on the wall, 12:32:32."""
    scan = IThera().read(mouse_scan)
    taken = datetime.fromtimestamp(scan.timestamps_s[0, 0], UTC)
    assert taken.replace(microsecond=0, tzinfo=None) == datetime(2020, 10, 1, 12, 32, 36)


def test_the_mouse_gets_its_speed_of_sound_from_the_header(mouse_scan):
    """1469.3 m/s, with the three numbers it is the sum of."""
    scan = IThera().read(mouse_scan)
    assert scan.geometry.speed_of_sound_m_s == pytest.approx(1469.34, abs=0.005)
    for part in ("33.27 C", "1516.34", "-90", "+43", "1469.3"):
        assert part in scan.speed_of_sound_source


def test_the_mouse_equals_its_ipasc_copy(mouse_scan, shared_data):
    """Another program's copy of the same scan holds the same raw data and geometry, bit for bit."""
    scan = IThera().read(mouse_scan)
    with h5py.File(shared_data / "mouse_scan9_ipasc.hdf5") as file:
        raw = file["binary_time_series_data"][:, :, 0, 0]
        elements = file["meta_data_device/detectors"]
        points = np.array([elements[key]["detector_position"][()] for key in sorted(elements)])
    assert np.array_equal(scan.signals[0, 0], raw)
    assert np.array_equal(scan.geometry.detectors.positions_m, points[:, [1, 0]])


def test_the_mouse_has_its_impulse_response_without_the_flag(mouse_scan):
    """It is the file's, less 1000 in the first value, scaled to a spectral peak of 1; that lies at 4.55 MHz."""
    response = IThera().read(mouse_scan).geometry.impulse_response
    stored = np.fromfile(mouse_scan.with_suffix(".irf"), "<f8")
    spectrum = abs(np.fft.rfft(response))
    assert len(response) == 2030
    assert np.argmax(abs(response)) == 1014
    assert np.allclose(response[1:] / response[1014], stored[1:] / stored[1014], rtol=1e-12)
    assert abs(response[0]) < 1e-6
    assert spectrum.max() == pytest.approx(1, abs=1e-12)
    assert np.fft.rfftfreq(2030, 1 / 40e6)[spectrum.argmax()] == pytest.approx(4.55e6, abs=2e4)


def test_the_impulse_response_can_be_left_out(mouse_scan):
    """Then the geometry has none, and the notes say so; nothing else changes."""
    without, given_ = IThera(impulse_response=False).read(mouse_scan), IThera().read(mouse_scan)
    assert without.geometry.impulse_response is None
    assert "not asked for" in " ".join(without.notes)
    assert without.signals == given_.signals


def test_a_scan_folder_reads_as_its_header_does(mouse_scan, tmp_path):
    """The folder may hold other headers as long as one is named as the folder."""
    reader = IThera()
    write(tmp_path / "Scan_1", header())
    assert reader.can_read(tmp_path / "Scan_1")
    assert reader.read(tmp_path / "Scan_1").source.endswith("Scan_1.msot")
    (tmp_path / "Scan_1" / "other.msot").write_text("")
    assert reader.read(tmp_path / "Scan_1").source.endswith("Scan_1.msot")
    assert reader.read(mouse_scan.parent) == reader.read(mouse_scan)


# The forms of the header --------------------------------------------------------------------------------------------


def test_both_forms_of_geometry_agree(tmp_path):
    """An arc by start, step and end is the same as the list of its points."""
    points = [(0.04 * np.cos(a), 0.04 * np.sin(a), 0.0) for a in 0.3 + 0.25 * np.arange(5)]
    listed = IThera().read(write(tmp_path / "a", header(geometry=projections(points))))
    arc = IThera().read(write(tmp_path / "b", header(geometry=equal(0.3, 0.25, 1.3, 0.04))))
    positions = arc.geometry.detectors.positions_m
    assert np.allclose(positions, listed.geometry.detectors.positions_m, atol=1e-15)
    assert np.allclose(positions, np.array(points)[:, [1, 0]], atol=1e-15)


def test_the_image_plane_is_found_in_version_2_3(tmp_path):
    """There z and y are swapped: the plane is the first and the third axis."""
    swapped = [(x, z, y) for x, y, z in RING]
    old = IThera().read(write(tmp_path / "a", header()))
    new = IThera().read(write(tmp_path / "b", header(version="2.3", geometry=projections(swapped))))
    assert new.geometry == old.geometry
    assert not any("version" in note for note in new.notes)


def test_a_straight_array_lies_in_the_plane_of_x_and_y(tmp_path):
    """Where two axes are constant, z is the one that is left out."""
    line = [(0.001 * i, 0.02, 0.07) for i in range(5)]
    positions = IThera().read(write(tmp_path, header(geometry=projections(line)))).geometry.detectors.positions_m
    assert positions.tolist() == [[y, x] for x, y, _ in line]


def test_an_unknown_version_is_noted(tmp_path):
    """It is read by what it holds, and the notes name it."""
    scan = IThera().read(write(tmp_path, header(version="3.1")))
    assert any("version is 3.1" in note for note in scan.notes)


def test_the_response_of_version_2_4_is_read_from_the_header(tmp_path):
    """Base64 in the header gives what the same numbers in a file give; the presets' "true" is passed over."""
    inside = IThera().read(write(tmp_path / "a", header(version="2.4", embedded=RESPONSE)))
    msot = write(tmp_path / "b", header())
    (RESPONSE + 1000 * (np.arange(8) == 0)).astype("<f8").tofile(msot.with_suffix(".irf"))
    assert inside.geometry == IThera().read(msot).geometry
    assert np.allclose(inside.geometry.impulse_response, RESPONSE / abs(np.fft.rfft(RESPONSE)).max(), rtol=1e-14)


def test_a_response_with_its_peak_at_the_start_is_centred(tmp_path):
    """Time zero is at index n // 2, and the notes say that it was moved there."""
    moved = IThera().read(write(tmp_path, header(embedded=np.fft.ifftshift(RESPONSE))))
    assert np.allclose(moved.geometry.impulse_response, RESPONSE / abs(np.fft.rfft(RESPONSE)).max(), rtol=1e-14)
    assert any("moved from index 0" in note for note in moved.notes)


def test_a_scan_without_a_response_says_so(tmp_path):
    """No file and no element: the signals are taken as the ideal ones, with a note."""
    scan = IThera().read(write(tmp_path, header()))
    assert scan.geometry.impulse_response is None
    assert any("no impulse response" in note for note in scan.notes)


def test_elements_of_unknown_effect_are_noted(tmp_path):
    """A trigger delay that is not zero is not applied, and that is said."""
    text = header().replace("<TRANSDUCER>", "<DAQTriggerDelay>7</DAQTriggerDelay><TRANSDUCER>")
    assert any("DAQTriggerDelay is 7" in n for n in IThera().read(write(tmp_path, text)).notes)


# Pulses, wavelengths, records ---------------------------------------------------------------------------------------


def first_samples(scan):
    """The number of the record that each pulse came from, as `write` puts it into the signals."""
    return scan.signals[:, :, 0, 0] // 1000


def test_records_are_found_by_their_offset(tmp_path):
    """IDOffset says where a pulse lies, whatever the order; what was measured stays with its pulse."""
    text = header(pulses=[700, 800] * 3, offsets=[5, 0, 4, 1, 3, 2])
    scan = IThera().read(write(tmp_path, text, records=6))
    assert first_samples(scan).tolist() == [[5, 0], [4, 1], [3, 2]]
    assert scan.pulse_energy.tolist() == [[100, 101], [102, 103], [104, 105]]
    assert scan.temperature_c.tolist() == [[30, 31], [32, 33], [34, 35]]
    assert np.allclose(np.diff(scan.timestamps_s.ravel()), 0.1, atol=1e-6)
    assert np.allclose(1e3 * scan.position_m, [[10, 11], [12, 13], [14, 15]], atol=1e-12)


def test_an_incomplete_last_sweep_is_dropped(tmp_path):
    """Its pulses are left out of everything, and counted in the notes; its records need not exist."""
    scan = IThera().read(write(tmp_path, header(pulses=[700, 800, 700, 800, 700]), records=4))
    assert first_samples(scan).tolist() == [[0, 1], [2, 3]]
    assert scan.temperature_c.mean() == 31.5
    assert any("1 of 2 pulses" in note for note in scan.notes)


def test_pulses_in_a_row_become_frames(tmp_path):
    """Three pulses at one wavelength, then three at the next, are three frames of both."""
    scan = IThera().read(write(tmp_path, header(pulses=[700] * 3 + [800] * 3 + [700] * 3 + [800] * 3), records=12))
    assert first_samples(scan).tolist() == [[0, 3], [1, 4], [2, 5], [6, 9], [7, 10], [8, 11]]
    assert any("3 pulses in a row" in note for note in scan.notes)


def test_a_wavelength_listed_twice_stays_twice(tmp_path):
    """The wavelength axis is the list of the header, repetitions and order included."""
    scan = IThera().read(write(tmp_path, header(wavelengths=(800, 700, 800)), records=3))
    assert scan.wavelengths_nm == (800, 700, 800)
    assert first_samples(scan).tolist() == [[0, 1, 2]]


def test_wavelengths_are_ordered_by_their_numbers(tmp_path):
    """The attribute ``number`` counts, not the order of the elements."""
    text = header(pulses=[800, 700])
    text = text.replace('number="1">700', 'number="2">700').replace('number="2">800', 'number="1">800')
    assert IThera().read(write(tmp_path, text)).wavelengths_nm == (800, 700)


@pytest.mark.parametrize("pulses", [[700, 800, 800, 700], [700, 700, 800, 700], [700, 900, 700, 900]])
def test_pulses_out_of_order_are_refused(tmp_path, pulses):
    """A pulse at another wavelength than its place says would go unseen into the wrong image."""
    with pytest.raises(ReadError, match=r"WAVELENGTH>: expected [78]00 nm"):
        IThera().read(write(tmp_path, header(pulses=pulses), records=4))


def test_less_than_a_sweep_is_refused(tmp_path):
    """One pulse of two wavelengths makes no frame."""
    with pytest.raises(ReadError, match="expected a sweep of 2 pulses, found 1"):
        IThera().read(write(tmp_path, header(pulses=[700])))


def test_one_record_for_two_pulses_is_refused(tmp_path):
    """Every pulse has its own record."""
    with pytest.raises(ReadError, match="expected a record for each pulse, found 1 more than once"):
        IThera().read(write(tmp_path, header(offsets=[1, 1])))


def test_the_factor_of_newer_files_stands_in_for_power(tmp_path):
    """OverallCorrectionFactor is read where there is no POWER, and nothing where there is neither."""
    renamed = header().replace("POWER>", "OverallCorrectionFactor>")
    assert IThera().read(write(tmp_path, renamed)).pulse_energy.tolist() == [[100, 101]]
    assert IThera().read(write(tmp_path, header().replace("POWER>", "OTHER>"))).pulse_energy is None


def test_what_only_some_pulses_have_is_left_out(tmp_path):
    """A half-filled table is no table; the notes say which."""
    scan = IThera().read(write(tmp_path, header().replace("<POWER>100</POWER>", "")))
    assert scan.pulse_energy is None
    assert any("POWER is missing for 1 of 2" in note for note in scan.notes)


def test_signals_upside_down_are_inverted_without_loss(tmp_path):
    """Polarity -1 gives 65535 minus the stored values, another fingerprint and a note."""
    msot = write(tmp_path, header())
    plain, inverted = IThera().read(msot), IThera(polarity=-1).read(msot)
    assert np.array_equal(inverted.signals[...], 65535 - plain.signals[...])
    assert inverted.signals != plain.signals
    assert any("inverted" in note for note in inverted.notes)


# Speed of sound -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("temperature_c", "speed"), [(20, 1482.36), (25, 1496.70), (74, 1555.15)])
def test_the_speed_of_sound_in_water_is_the_tabulated_one(temperature_c, speed):
    """Pure water has 1482.4 m/s at 20 C, 1496.7 at 25 C, and its maximum of 1555 m/s at 74 C."""
    assert water_speed_of_sound_m_s(temperature_c) == pytest.approx(speed, abs=0.05)


def test_without_temperatures_the_default_is_taken_and_noted(tmp_path):
    """1500 m/s, with the source "default"."""
    scan = IThera().read(write(tmp_path, header().replace("TEMPERATURE>", "OTHER>")))
    assert scan.geometry.speed_of_sound_m_s == 1500
    assert scan.speed_of_sound_source == "default"
    assert any("1500 m/s" in note for note in scan.notes)


def test_an_implausible_temperature_is_not_used(tmp_path):
    """0 C is what a scanner without a thermometer writes."""
    text = header().replace("<TEMPERATURE>30", "<TEMPERATURE>0").replace("<TEMPERATURE>31", "<TEMPERATURE>0")
    assert IThera().read(write(tmp_path, text)).speed_of_sound_source == "default"


def test_a_missing_trim_is_noted(tmp_path):
    """Then the speed is that of water and base alone."""
    scan = IThera().read(write(tmp_path, header().replace("TrimSpeedOfSound", "Other")))
    assert scan.geometry.speed_of_sound_m_s == water_speed_of_sound_m_s(30.5) - 90
    assert any("no trim" in note for note in scan.notes)


# Lazy signals -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def signals(tmp_path_factory):
    """Signals of shape (3, 2, 5, 8) with their records in disorder."""
    text = header(pulses=[700, 800] * 3, offsets=[5, 0, 4, 1, 3, 2])
    return IThera().read(write(tmp_path_factory.mktemp("lazy"), text, records=6)).signals


def test_a_moved_folder_is_the_same_scan(tmp_path):
    """Fingerprints come from header and signals alone: not from the path nor from the times of the files."""
    before = IThera().read(write(tmp_path / "here", header()))
    (tmp_path / "here").rename(tmp_path / "there")
    for file in (tmp_path / "there").iterdir():
        os.utime(file, (0, 0))
    after = IThera().read(tmp_path / "there")
    assert after.signals == before.signals
    assert after.fingerprint == before.fingerprint
    with open(tmp_path / "there" / "Scan_1.bin", "r+b") as file:
        file.write(b"x")
    assert IThera().read(tmp_path / "there").fingerprint != before.fingerprint


@given(index=basic_indices((3, 2, 5, 8), allow_newaxis=False))
def test_lazy_signals_index_as_an_array_does(signals, index):
    """Whole numbers, slices and ``...`` give what numpy gives."""
    record, detector, sample = np.ogrid[:6, :5, :8]
    whole = (1000 * record + 10 * detector + sample)[[[5, 0], [4, 1], [3, 2]]]
    assert np.array_equal(signals[index], whole[index])


@pytest.mark.parametrize("index", [True, [0, 1], (0, 0, 0, 0, 0), (..., ...), None, 1.0])
def test_other_indices_are_refused(signals, index):
    """A list or a mask would silently mean something else than in numpy."""
    with pytest.raises(IndexError):
        signals[index]


def test_lazy_signals_pickle_as_their_path(signals):
    """A few hundred bytes, whatever the size of the scan, and the copy reads the same."""
    packed = pickle.dumps(signals)
    assert len(packed) < 1500
    assert np.array_equal(pickle.loads(packed)[...], signals[...])
    assert pickle.loads(packed) == signals


def test_a_changed_file_is_noticed(tmp_path):
    """Signals of a file that was replaced after its header was read are an error, not other numbers."""
    msot = write(tmp_path, header())
    scan = IThera().read(msot)
    raw = bytearray(msot.with_suffix(".bin").read_bytes())
    raw[40] ^= 1
    msot.with_suffix(".bin").write_bytes(raw)
    with pytest.raises(ReadError, match="has changed"):
        scan.signals[0]
    msot.with_suffix(".bin").write_bytes(raw[:20])
    with pytest.raises(ReadError, match="has changed"):
        scan.signals[0]


def test_reading_one_frame_costs_one_frame(tmp_path):
    """Of a file of 2 GB, a frame of 2 MB takes 2 MB of memory."""
    path = tmp_path / "large.bin"
    with open(path, "wb") as file:
        file.truncate(2 * 2**30)
    large = raw_signals(path, np.arange(1024).reshape(-1, 1), (256, 4096), False, "")
    tracemalloc.start()
    assert large[1000:1001].nbytes == 2 * 2**20
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5 * 2**20


def test_the_users_file_cannot_be_written(tmp_path):
    """What is returned is a copy: changing it changes nothing else."""
    msot = write(tmp_path, header())
    scan = IThera().read(msot)
    before = msot.with_suffix(".bin").read_bytes()
    scan.signals[0, 0, 0][:] = 7
    assert scan.signals[0, 0, 0, 3] == 3
    assert msot.with_suffix(".bin").read_bytes() == before
