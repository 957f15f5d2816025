"""The IPASC file, read and written, by ourselves, by the consortium's package and by MATLAB."""

import pickle
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pacfish
import pytest
from pacfish import MetadataAcquisitionTags as Tags
from pacfish.qualitycontrol import ConsistencyChecker

import oatkit
from ipasc_files import ARC, SHAPE, as_scan, samples, write, write_as_matlab_does
from oatkit.builtin.readers.ipasc import Ipasc
from oatkit.builtin.readers.ipasc_axes import by_pulse, find_axes
from oatkit.convert import convert
from oatkit.data import Detectors, Geometry, Scan
from oatkit.errors import ReadError, ResultError, ValidationError
from oatkit.ipasc import write_ipasc
from test_reader_hdf5 import a_scan, in_memory

WRITTEN = "kept in /meta_data/"
CORNERS = 1e-3 * np.array([[0, 0, 20], [4, 0, 20], [4, 2, 20], [1, 3, 20]])
"""Of a region of interest, each (x, y, z), m."""
BOX = np.array([-0.001, 0.003, 0.002, 0.004, 0.01, 0.03])
"""Another one: x, y and z from and to, m."""


def bare_scan(frames=3, wavelengths=2) -> Scan:
    """A scan of which the layout can hold everything but the pulse energies' unit."""
    rng = np.random.default_rng(1)
    geometry = Geometry(Detectors(rng.uniform(-0.04, 0.04, (5, 2))), 40e6, 40, 0.0, 1483.7)
    energy, temperature, times = (rng.uniform(1, 2, (frames, wavelengths)) for _ in range(3))
    signals = rng.integers(0, 60000, (frames, wavelengths, 5, 40)).astype("u2")
    position = np.repeat(rng.uniform(0, 0.1, (frames, 1)), wavelengths, axis=1)
    return Scan(signals, geometry, (700.0, 813.5, 900.1)[:wavelengths], None, energy, temperature, times, position)


def same_but_rounded(found: Scan, expected: Scan) -> bool:
    """Whether two scans are equal, with temperatures that agree to 1e-11 K: the file holds them in K."""
    assert np.allclose(found.temperature_c, expected.temperature_c, rtol=0, atol=1e-11)
    return replace(in_memory(found), temperature_c=None) == replace(in_memory(expected), temperature_c=None)


# Our own files ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", ["u2", "i2", ">i4", "u1", "f4", "f8"])
def test_a_scan_comes_back_as_it_was(tmp_path, dtype):
    """Signals bit for bit, geometry, response, valid channels, pulses and texts; the reader has nothing to add."""
    scan, path = a_scan(dtype), tmp_path / "scan.hdf5"
    write_ipasc(scan, path)
    back = oatkit.read(path)
    assert back.signals.dtype == scan.signals.dtype.newbyteorder("<")
    assert same_but_rounded(back, replace(scan, signals=scan.signals.astype(back.signals.dtype)))
    assert (back.name, back.speed_of_sound_source, back.notes) == (scan.name, "by hand", scan.notes)
    assert (back.source, back.reader) == (str(path), "ipasc")


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (3, 1), (3, 2), (2, 2)])
def test_what_the_layout_can_hold_comes_back(tmp_path, shape):
    """Whatever the numbers of frames and wavelengths, where no field of our own is needed and where one is."""
    scan = bare_scan(*shape)
    losses = write_ipasc(scan, tmp_path / "scan.hdf5")
    assert same_but_rounded(oatkit.read(tmp_path / "scan.hdf5"), scan)
    assert [WRITTEN in loss for loss in losses].count(True) == (shape[0] == 1)


def test_optional_fields_stay_absent(tmp_path):
    """None comes back as None."""
    bare = Scan(a_scan().signals, replace(a_scan().geometry, impulse_response=None), (700, 800))
    write_ipasc(bare, tmp_path / "scan.hdf5")
    assert in_memory(oatkit.read(tmp_path / "scan.hdf5")) == bare


def test_what_others_will_not_find_is_said(tmp_path):
    """Each thing that IPASC has no field for is named; what is not there is not."""
    assert "".join(write_ipasc(a_scan(), tmp_path / "a.hdf5")).count(WRITTEN) == 4
    bare = Scan(a_scan().signals, replace(a_scan().geometry, impulse_response=None, start_time_s=0), (700, 800))
    (loss,) = write_ipasc(bare, tmp_path / "b.hdf5")
    assert "neither device, illumination nor field of view" in loss
    long = replace(a_scan(), notes=("x" * 70_000,))
    assert "Too long to be kept: the notes of the scan." in write_ipasc(long, tmp_path / "c.hdf5")


def test_the_same_scan_has_the_same_identifier(tmp_path):
    """The identifier comes from the content; nothing in a file tells when it was written."""
    for name, scan in (("a", a_scan()), ("b", a_scan()), ("c", a_scan("i2"))):
        write_ipasc(scan, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    with h5py.File(tmp_path / "a") as first, h5py.File(tmp_path / "c") as other:
        assert first["meta_data/uuid"][()] != other["meta_data/uuid"][()]


def test_one_pulse_is_one_chunk_with_a_checksum(tmp_path):
    """Reading a frame touches no other frame's bytes."""
    write_ipasc(a_scan(), tmp_path / "scan.hdf5")
    with h5py.File(tmp_path / "scan.hdf5") as file:
        assert file["binary_time_series_data"].chunks == (5, 40, 1, 1)
        assert file["binary_time_series_data"].fletcher32


def test_a_record_too_long_for_any_chunk_is_refused(tmp_path):
    """Rather than writing what cannot be read."""
    geometry = Geometry(Detectors(np.zeros((1, 2))), 40e6, 9_000_000)
    with pytest.raises(ValidationError, match="records of up to"):
        write_ipasc(Scan(np.ones((1, 1, 1, 9_000_000)), geometry, (700,)), tmp_path / "scan.hdf5")
    assert list(tmp_path.iterdir()) == []


def test_more_detectors_than_are_read_are_not_written(tmp_path):
    """The limit of the reader is the writer's."""
    geometry = Geometry(Detectors(np.full((65_537, 2), 0.04)), 40e6, 1)
    with pytest.raises(ValidationError, match="65536 detectors"):
        write_ipasc(Scan(np.ones((1, 1, 65_537, 1), "u1"), geometry, (700,)), tmp_path / "scan.hdf5")


def test_nothing_is_overwritten_or_left_half(tmp_path, monkeypatch):
    """An existing file is kept unless asked for, a scan is not written over itself, a full disk is seen before."""
    path = tmp_path / "scan.hdf5"
    write_ipasc(a_scan(), path)
    with pytest.raises(ResultError, match="exists already"):
        write_ipasc(a_scan("f4"), path)
    with pytest.raises(ResultError, match="is the input"):
        write_ipasc(oatkit.read(path), path, overwrite=True)
    write_ipasc(a_scan("f4"), path, overwrite=True)
    assert oatkit.read(path).signals.dtype == "f4"
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 1000}))
    with pytest.raises(ResultError, match="free"):
        write_ipasc(a_scan(), tmp_path / "other.hdf5")
    assert list(tmp_path.iterdir()) == [path]


def test_convert_goes_by_the_ending(tmp_path):
    """``.h5`` is our own file, ``.hdf5`` IPASC's, from one lazily to the other; the error lists both."""
    scan = bare_scan()
    assert convert(scan, tmp_path / "a.h5") == ()
    assert convert(oatkit.read(tmp_path / "a.h5"), tmp_path / "b.HDF5") == write_ipasc(scan, tmp_path / "c.hdf5")
    assert convert(oatkit.read(tmp_path / "b.HDF5"), tmp_path / "d.h5") == ()
    assert [oatkit.read(tmp_path / name).reader for name in ("a.h5", "b.HDF5", "d.h5")] == [
        "oatkit-hdf5",
        "ipasc",
        "oatkit-hdf5",
    ]
    assert same_but_rounded(oatkit.read(tmp_path / "d.h5"), scan)
    with pytest.raises(ValidationError, match=r"\.h5 \(oatkit's scan file\), \.hdf5 \(IPASC\)"):
        convert(scan, tmp_path / "a.csv")


# The consortium's package -------------------------------------------------------------------------------------------


class Adapter(pacfish.BaseAdapter):
    """A converter as the consortium's package asks for it."""

    def __init__(self, scan: Scan) -> None:
        self.scan = scan
        super().__init__()

    def generate_binary_data(self) -> np.ndarray:
        return self.scan.signals.transpose(2, 3, 1, 0)

    def generate_device_meta_data(self) -> dict:
        device = pacfish.DeviceMetaDataCreator()
        device.set_general_information("device", np.array([-0.01, 0.01, -0.01, 0.01, 0, 0]))
        for y, x in self.scan.geometry.detectors.positions_m:
            element = pacfish.DetectionElementCreator()
            element.set_detector_position(np.array([x, y, 0.02]))
            element.set_frequency_response(np.array([[1e6, 2e6], [1.0, 0.5]]))
            device.add_detection_element(element.get_dictionary())
        return device.finalize_device_meta_data()

    def set_metadata_value(self, metadatum: pacfish.MetaDatum) -> object:
        scan = self.scan
        return {
            Tags.UUID: "an identifier",
            Tags.AD_SAMPLING_RATE: scan.geometry.sampling_rate_hz,
            Tags.SPEED_OF_SOUND: scan.geometry.speed_of_sound_m_s,
            Tags.ACQUISITION_WAVELENGTHS: np.array(scan.wavelengths_nm) * 1e-9,
            Tags.PULSE_ENERGY: scan.pulse_energy.T,
            Tags.TEMPERATURE_CONTROL: scan.temperature_c.T + 273.15,
            Tags.MEASUREMENT_TIMESTAMPS: scan.timestamps_s.T,
            Tags.MEASUREMENT_SPATIAL_POSES: np.pad(scan.position_m[:, :1], ((0, 0), (2, 3))),
            Tags.SIZES: np.array(scan.signals.shape)[[2, 3, 1, 0]],
            Tags.OVERALL_GAIN: 1.0,
            Tags.FREQUENCY_DOMAIN_FILTER: np.array([5e4, 7e6]),
            Tags.REGIONS_OF_INTEREST: {"a": {"outline": CORNERS}, "b": {"box": BOX}},
        }.get(metadatum)


@pytest.mark.parametrize("shape", [(1, 1), (1, 3), (4, 1), (3, 2), (2, 2)])
def test_we_read_what_pacfish_writes(tmp_path, shape):
    """A file of the consortium's own package gives the scan that it was made of, and notes on what it lacks."""
    scan, path = bare_scan(*shape), tmp_path / "scan.hdf5"
    pacfish.write_data(str(path), Adapter(scan).generate_pa_data())
    found = oatkit.read(path)
    assert same_but_rounded(found, scan)
    assert (found.reader, found.name) == ("ipasc", "scan")
    for words in ("first sample", "impulse response", "frequency_domain_filter", "responses"):
        assert any(words in note for note in found.notes), words
    assert not any("overall_gain" in note or "sizes" in note for note in found.notes)
    outline, box = oatkit.read_regions(path)
    assert (outline.name, box.name) == ("a/outline", "b/box")
    assert np.array_equal(outline.vertices_m, CORNERS[:, [1, 0]])
    assert np.array_equal(box.outline_m, [[0.002, -0.001], [0.002, 0.003], [0.004, 0.003], [0.004, -0.001]])


@pytest.mark.parametrize("scan", [a_scan(), a_scan("f4", 1), bare_scan(1, 1), bare_scan(2, 2)])
def test_pacfish_reads_what_we_write(tmp_path, scan):
    """Positions, sampling, data and wavelengths are the scan's, and its check of consistency finds nothing."""
    write_ipasc(scan, tmp_path / "scan.hdf5")
    found = pacfish.load_data(str(tmp_path / "scan.hdf5"))
    positions = np.array(found.get_detector_position())
    assert np.array_equal(positions[:, [1, 0]], scan.geometry.detectors.positions_m)
    assert found.get_sampling_rate() == scan.geometry.sampling_rate_hz
    assert found.get_speed_of_sound() == scan.geometry.speed_of_sound_m_s
    assert np.array_equal(found.binary_time_series_data, scan.signals.transpose(2, 3, 1, 0))
    assert found.binary_time_series_data.dtype == scan.signals.dtype
    assert np.allclose(found.get_acquisition_wavelengths(), np.squeeze(scan.wavelengths_nm) * 1e-9, rtol=1e-15)
    assert found.get_number_of_detectors() == 5
    assert tuple(found.get_sizes()) == found.binary_time_series_data.shape
    checker = ConsistencyChecker()
    assert checker.check_acquisition_meta_data(found.meta_data_acquisition)
    assert checker.check_device_meta_data(found.meta_data_device)
    assert checker.check_binary_data(found.binary_time_series_data)


def test_the_mandatory_fields_are_all_there(tmp_path):
    """Every field that the consortium calls minimal is in our file."""
    write_ipasc(bare_scan(), tmp_path / "scan.hdf5")
    found = pacfish.load_data(str(tmp_path / "scan.hdf5"))
    assert {tag.tag for tag in Tags.TAGS if tag.mandatory} <= set(found.meta_data_acquisition)
    assert {"unique_identifier", "field_of_view"} <= set(found.meta_data_device["general"])


# The real scan ------------------------------------------------------------------------------------------------------


@pytest.fixture
def twins(mouse_scan, shared_data):
    """One frame of a mouse in iThera's file and in IPASC's."""
    return oatkit.read(mouse_scan), oatkit.read(shared_data / "mouse_scan9_ipasc.hdf5")


def test_both_files_of_the_mouse_hold_the_same(twins):
    """Raw data, positions in their order, sampling and wavelength bit for bit; temperature and position too."""
    ithera, ipasc = twins
    assert ipasc.signals.dtype == ithera.signals.dtype
    assert np.array_equal(ipasc.signals[...], ithera.signals[...])
    assert ipasc.geometry.detectors == ithera.geometry.detectors
    keys = ("sampling_rate_hz", "n_samples", "start_time_s")
    assert [getattr(ipasc.geometry, k) for k in keys] == [getattr(ithera.geometry, k) for k in keys]
    assert ipasc.wavelengths_nm == ithera.wavelengths_nm
    assert np.allclose(ipasc.temperature_c, ithera.temperature_c, rtol=0, atol=1e-11)
    assert np.allclose(ipasc.position_m, ithera.position_m, rtol=1e-15, atol=0)
    assert ipasc.geometry.speed_of_sound_m_s == 1520


def test_both_files_of_the_mouse_give_the_same_image(twins):
    """Once speed of sound, impulse response and energy factor are set equal, to rounding."""
    ithera, ipasc = twins
    ipasc = replace(ipasc, geometry=ithera.geometry, pulse_energy=ithera.pulse_energy)
    small = ["grid.pixels=32", "preprocess.band-pass.high=1.2", "reconstruct.n_iterations=5"]
    pipeline = oatkit.Pipeline.load("lsqr", small)
    first, second = (oatkit.run(pipeline, scan)["initial_pressure"].values for scan in (ithera, ipasc))
    assert first.any()
    assert np.abs(first - second).max() <= 1e-12 * np.abs(first).max()


def test_the_mouse_survives_the_way_through_our_file(twins, tmp_path):
    """From iThera's file to IPASC's and back, with response and offset, and nothing is lost."""
    ithera, _ = twins
    convert(ithera, tmp_path / "mouse.hdf5")
    back = oatkit.read(tmp_path / "mouse.hdf5")
    assert same_but_rounded(back, ithera)
    assert back.notes == ithera.notes
    assert back.speed_of_sound_source == ithera.speed_of_sound_source


# Files of others ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(5, 8, 2, 3), (5, 8, 2, 1), (5, 8, 1, 3), (5, 8, 1, 1), (5, 5, 2, 3)])
def test_matlab_files_are_turned_around(tmp_path, shape):
    """Signals, matrices and texts as the consortium's MATLAB program writes them."""
    _, _, wavelengths, frames = shape
    values = samples(shape)
    energy = np.arange(1.0, 1 + wavelengths * frames).reshape(wavelengths, frames)
    path = write_as_matlab_does(
        tmp_path / "scan.hdf5",
        values,
        acquisition_wavelengths=np.array([700e-9, 800e-9])[:wavelengths],
        pulse_energy=energy,
        oatkit_name="of MATLAB",
        scanning_method="None",
    )
    scan = oatkit.read(path)
    assert np.array_equal(scan.signals[...], as_scan(values))
    assert np.array_equal(scan.pulse_energy, energy.T)
    assert np.array_equal(scan.geometry.detectors.positions_m, ARC[:, [1, 0]])
    assert scan.geometry.sampling_rate_hz == 40e6
    assert scan.name == "of MATLAB"


def test_regions_of_matlab_are_turned_around(tmp_path):
    """Points that MATLAB has written as (3, n), and a box as a column, are the regions of Python's file."""
    path = write_as_matlab_does(tmp_path / "scan.hdf5", samples())
    with h5py.File(path, "r+") as file:
        file["meta_data/regions_of_interest/outline"] = CORNERS.T
        file["meta_data/regions_of_interest/box"] = BOX[:, None]
    box, outline = oatkit.read_regions(path)
    assert np.array_equal(outline.vertices_m, CORNERS[:, [1, 0]])
    assert box.centre_m == (0.003, 0.001)


@pytest.mark.parametrize("across", range(3))
def test_regions_lie_in_the_plane_of_the_detectors(tmp_path, across):
    """Whatever the axis across it: a region on the detectors' arc has their coordinates."""
    points = np.insert(ARC[:, :2], across, 0.0, axis=1)
    path = write(tmp_path / "scan.hdf5", points=points, **{"regions_of_interest/arc": points})
    (region,) = oatkit.read_regions(path)
    assert np.array_equal(region.vertices_m, oatkit.read(path).geometry.detectors.positions_m)


ODD_REGIONS = {
    "two points": np.zeros((2, 3)),
    "a box or a triangle": np.zeros((3, 2)),
    "a number": np.array(3.0),
    "in mm": 1e3 * CORNERS,
    "no number": CORNERS * np.nan,
    "a box without width": np.array([0.001, 0.001, 0.0, 0.002, 0.0, 0.0]),
    "nothing": b"None",
}


@pytest.mark.parametrize("case", ODD_REGIONS)
def test_a_region_that_makes_no_sense_leaves_the_others(tmp_path, caplog, case):
    """It is named in the log, and all others are read."""
    regions = {"regions_of_interest/a": CORNERS, "regions_of_interest/odd": ODD_REGIONS[case]}
    path = write(tmp_path / "scan.hdf5", **regions)
    assert [region.name for region in oatkit.read_regions(path)] == ["a"]
    (record,) = caplog.records
    assert "region 'odd'" in record.getMessage()


def test_regions_are_read_through_no_link(tmp_path):
    """Neither a region nor the group of them may lead into another file."""
    for name in ("regions_of_interest", "regions_of_interest/a", "regions_of_interest/group/a"):
        path = write(tmp_path / "scan.hdf5")
        with h5py.File(path, "r+") as file:
            file[f"meta_data/{name}"] = h5py.ExternalLink("/etc/passwd", "/x")
        with pytest.raises(ReadError, match="links are refused"):
            oatkit.read_regions(path)


def test_texts_as_character_codes_are_read(tmp_path):
    """MATLAB's older files hold texts as numbers of 16 bits."""
    codes = np.array([[ord(c)] for c in "µ-phantom"], "u2")
    assert oatkit.read(write(tmp_path / "scan.hdf5", oatkit_name=codes)).name == "µ-phantom"


@pytest.mark.parametrize("across", [0, 1, 2])
def test_the_plane_may_lie_in_any_two_axes(tmp_path, across):
    """The earlier of the two axes points right, the later one up."""
    points = np.insert(ARC[:, :2], across, 0.02, axis=1)
    scan = oatkit.read(write(tmp_path / "scan.hdf5", points=points))
    assert np.array_equal(scan.geometry.detectors.positions_m, ARC[:, [1, 0]])


@pytest.mark.parametrize(
    ("view", "expected"),
    [((0, 0, 0, 0.04, 0, 0.04), "x, as the field"), ((0, 0.04, 0, 0.04, 0, 0), "z, as the field"), (None, "z, since")],
)
def test_a_line_of_detectors_images_its_field_of_view(tmp_path, view, expected):
    """Positions on a line leave the plane open; the field of view says it, else z is across, with a note."""
    points = np.zeros((5, 3))
    points[:, 1] = np.arange(5) * 3e-4
    device = {} if view is None else {"field_of_view": np.array(view)}
    scan = oatkit.read(write(tmp_path / "scan.hdf5", points=points, device=device))
    assert any(f"of constant {expected}" in note for note in scan.notes)
    along, other = (1, 0) if expected[0] == "x" else (0, 1)
    assert np.array_equal(scan.geometry.detectors.positions_m[:, along], points[:, 1])
    assert not scan.geometry.detectors.positions_m[:, other].any()


def test_detectors_come_in_the_natural_order_of_their_names(tmp_path):
    """``element_10`` follows ``element_9``, whatever the zeros before the digits."""
    names = ["element_7", "element_8", "element_09", "element_10", "element_100"]
    scan = oatkit.read(write(tmp_path / "scan.hdf5", names=names))
    assert np.array_equal(scan.geometry.detectors.positions_m, ARC[:, [1, 0]])


def test_wavelengths_in_nanometres_are_taken_with_a_note(tmp_path):
    """No wavelength of light in nm could be one in m."""
    scan = oatkit.read(write(tmp_path / "scan.hdf5", acquisition_wavelengths=np.array([700, 813.5])))
    assert scan.wavelengths_nm == (700, 813.5)
    assert any("taken as nm" in note for note in scan.notes)


@pytest.mark.parametrize("values", [[0.7, 0.8], [700e-9, 813.5], [700e-9, np.nan], [-700e-9, 800e-9], []])
def test_impossible_wavelengths_are_refused(tmp_path, values):
    """Micrometres, mixed units, nan, negative, none: the field and its unit are named."""
    path = write(tmp_path / "scan.hdf5", acquisition_wavelengths=np.array(values, float))
    with pytest.raises(ReadError, match=r"acquisition_wavelengths'?: expected wavelengths .* m, found"):
        oatkit.read(path)


def test_a_lone_wavelength_without_a_name_is_assumed(tmp_path):
    """The scan says so, and the reader takes the right one as a parameter."""
    path = write(tmp_path / "scan.hdf5", samples((5, 8, 1, 3)), acquisition_wavelengths=None)
    scan = oatkit.read(path)
    assert scan.wavelengths_nm == (800,)
    assert any("does not name its wavelength" in note for note in scan.notes)
    assert oatkit.read(path, Ipasc(wavelength=532.0)).wavelengths_nm == (532,)


@pytest.mark.parametrize("shape", [(5, 8, 2, 3), (5, 8, 2), (5, 8, 2, 1)])
def test_several_wavelengths_without_names_are_refused(tmp_path, shape):
    """Also where a third axis may be either wavelengths or frames."""
    path = write(tmp_path / "scan.hdf5", samples(shape), acquisition_wavelengths=None)
    with pytest.raises(ReadError, match="acquisition_wavelengths is missing"):
        oatkit.read(path)


@pytest.mark.parametrize("shape", [(5, 8, 3, 3), (4, 8, 2, 3), (5,), (5, 8), (5, 8, 3), (1, 5, 8, 2, 3), (5, 8, 2, 0)])
def test_signals_that_do_not_fit_are_refused(tmp_path, shape):
    """Wavelengths, detectors, too few or too many axes, no frames."""
    path = write(tmp_path / "scan.hdf5", samples(shape))
    with pytest.raises(ReadError, match=r"binary_time_series_data|signals"):
        oatkit.read(path)


def test_a_missing_axis_has_length_one(tmp_path):
    """A record alone; a third axis holds the wavelengths where there are several, else the frames."""
    record = write(tmp_path / "a.hdf5", samples((5, 8)), acquisition_wavelengths=np.array([7e-7]))
    sweep = write(tmp_path / "b.hdf5", samples((5, 8, 2)))
    frames = write(tmp_path / "c.hdf5", samples((5, 8, 2)), acquisition_wavelengths=np.array([7e-7]))
    assert [oatkit.read(path).signals.shape[:2] for path in (record, sweep, frames)] == [(1, 1), (1, 2), (2, 1)]


@pytest.mark.parametrize("absent", [None, "None", ""])
def test_a_missing_speed_of_sound_is_assumed_with_a_note(tmp_path, absent):
    """No field, the text that stands for Python's None, an empty text."""
    scan = oatkit.read(write(tmp_path / "scan.hdf5", speed_of_sound=absent))
    assert (scan.geometry.speed_of_sound_m_s, scan.speed_of_sound_source) == (1500, "default")
    assert any("no speed of sound" in note for note in scan.notes)


def test_a_map_of_the_speed_of_sound_becomes_one_number(tmp_path):
    """A constant map is its value; of another one the median is taken, and its range is said."""
    speed = np.full((4, 5, 6), 1490.0)
    scan = oatkit.read(write(tmp_path / "a.hdf5", speed_of_sound=speed))
    assert scan.geometry.speed_of_sound_m_s == 1490
    assert not any("map" in note for note in scan.notes)
    speed[:2, :2] = 1600
    scan = oatkit.read(write(tmp_path / "b.hdf5", speed_of_sound=speed))
    assert scan.geometry.speed_of_sound_m_s == 1490
    assert any("map of 1490 .. 1600 m/s" in note for note in scan.notes)


PULSES = np.arange(6.0).reshape(3, 2)
BY_PULSE = {
    "one": (np.array(7.0), 3, 2, np.full((3, 2), 7.0)),
    "as the signals": (PULSES.T, 3, 2, PULSES),
    "the other way": (PULSES, 3, 2, PULSES),
    "with a further axis": (PULSES.T[None], 3, 2, PULSES),
    "each frame": (np.arange(3.0), 3, 2, np.repeat(np.arange(3.0)[:, None], 2, 1)),
    "each wavelength": (np.arange(2.0), 3, 2, np.repeat(np.arange(2.0)[None], 3, 0)),
    "one frame": (np.arange(3.0), 1, 3, np.arange(3.0)[None]),
    "one wavelength": (np.arange(3.0)[None], 3, 1, np.arange(3.0)[:, None]),
    "a square as the signals": (PULSES[:2].T, 2, 2, PULSES[:2]),
    "flat": (np.arange(6.0), 3, 2, None),
    "flat, a square": (np.arange(2.0), 2, 2, None),
    "too many": (np.arange(7.0), 3, 2, None),
    "none": (np.zeros(0), 3, 2, None),
}


@pytest.mark.parametrize("case", BY_PULSE)
def test_values_of_pulses_are_taken_where_their_order_is_clear(case):
    """An array of the two axes, one value for all, for each frame or wavelength; a flat list of all is not clear."""
    values, frames, wavelengths, expected = BY_PULSE[case]
    found = by_pulse(values, frames, wavelengths)
    assert found is expected if expected is None else np.array_equal(found, expected)


def test_unclear_and_impossible_values_are_left_out_with_a_note(tmp_path):
    """The scan is read all the same."""
    scan = oatkit.read(
        write(
            tmp_path / "scan.hdf5",
            measurement_timestamps=np.arange(6.0),
            pulse_energy=np.array([[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]),
            measurement_spatial_poses=np.zeros((7, 6)),
        )
    )
    assert (scan.timestamps_s, scan.pulse_energy, scan.position_m) == (None, None, None)
    for words in ("measurement_timestamps", "not all positive", "measurement_spatial_poses"):
        assert any(words in note for note in scan.notes), words


def test_gains_and_wrong_sizes_are_noted(tmp_path):
    """What is not applied is said, and what contradicts the signals."""
    changes = {"overall_gain": 3.0, "time_gain_compensation": np.arange(8.0), "sizes": np.array([5, 9, 2, 3])}
    notes = oatkit.read(write(tmp_path / "scan.hdf5", **changes)).notes
    for words in ("holds overall_gain", "holds time_gain_compensation", "sizes says 5 x 9 x 2 x 3"):
        assert any(words in note for note in notes), words


# Signals ------------------------------------------------------------------------------------------------------------

INDICES = [
    (..., 1),
    1,
    -1,
    (slice(1, 2),),
    (0, 1, 2, 3),
    (slice(None), 0),
    (..., slice(2, 7, 3)),
    (slice(2, 0), slice(None), 1),
    (-1, ..., slice(-3, None)),
    np.int64(2),
]


@pytest.mark.parametrize("shape", [(5, 8, 2, 3), (5, 8, 2), (5, 8)])
@pytest.mark.parametrize("matlab", [False, True])
def test_lazy_signals_index_as_an_array(tmp_path, shape, matlab):
    """In every order of the file's axes, and where some are missing."""
    values = samples(shape)
    full = as_scan(values.reshape(*shape, *(1,) * (4 - len(shape))))
    named = np.array([7e-7, 8e-7])[: full.shape[1]]
    signals = oatkit.read(
        write(tmp_path / "scan.hdf5", values.T if matlab else values, acquisition_wavelengths=named)
    ).signals
    assert signals.shape == full.shape
    for index in INDICES:
        try:
            expected = full[index]
        except IndexError:
            with pytest.raises(IndexError):
                signals[index]
            continue
        found = signals[index]
        assert np.array_equal(found, expected)
        assert found.shape == expected.shape
        assert found.flags.c_contiguous
    with pytest.raises(IndexError):
        signals[::-1]


def test_axes_are_found_for_every_shape():
    """The layout's order is preferred; MATLAB's is taken where only that fits."""
    assert find_axes((5, 5, 1, 1), 5, 1) == ((3, 2, 0, 1), False)
    assert find_axes((3, 2, 8, 5), 5, 2) == ((0, 1, 3, 2), True)
    assert find_axes((5, 8, 2, 5), 5, 2) == ((3, 2, 0, 1), False)
    assert find_axes((5, 2, 8, 5), 5, 2) == ((0, 1, 3, 2), True)
    assert find_axes((8, 5), 5, 1) == ((None, None, 1, 0), True)
    assert find_axes((6, 8, 2, 3), 5, 2) is None


def test_signals_pickle_as_their_path_and_notice_a_change(tmp_path):
    """They pickle small, equal their copy, and refuse a file that was replaced."""
    path = write(tmp_path / "scan.hdf5")
    signals = oatkit.read(path).signals
    packed = pickle.dumps(signals)
    assert len(packed) < 1000
    assert pickle.loads(packed) == signals
    assert np.array_equal(pickle.loads(packed)[1], as_scan(samples())[1])
    write(path, samples() + 1)
    with pytest.raises(ReadError, match="has changed"):
        signals[0]


MEASURED = """
import sys
from pathlib import Path
import numpy as np
import oatkit
from oatkit.ipasc import write_ipasc

def peak():
    return int(next(l for l in open("/proc/self/status") if l.startswith("VmHWM")).split()[1]) * 1024

scan = oatkit.read(sys.argv[1])
scan.signals[0, 0, 0, 0]
before = peak()
scan.frame(scan.frames // 2)
print(peak() - before)
write_ipasc(scan, sys.argv[1] + ".copy.hdf5")
print(peak() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads the peak of memory where Linux shows it")
def test_memory_holds_a_frame_not_the_file(tmp_path):
    """Of 32 MB in one piece, in which a frame lies scattered, a frame of 0.8 MB is read in 8 MB, all copied in 16."""
    path, shape = tmp_path / "scan.hdf5", (5, 40_000, 2, 40)
    write(path, np.ones(shape, "u2"))
    done = subprocess.run([sys.executable, "-c", MEASURED, path], capture_output=True, text=True, check=True)
    reading, copying = map(int, done.stdout.split())
    assert reading < 8e6
    assert copying < 16e6


def test_the_layout_of_the_helper_is_the_layout(tmp_path):
    """What these tests write by hand is what the consortium's package reads."""
    found = pacfish.load_data(str(write(tmp_path / "scan.hdf5")))
    assert found.binary_time_series_data.shape == SHAPE
    assert np.array_equal(np.array(found.get_detector_position()), ARC)
