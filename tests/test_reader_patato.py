"""The reader of PATATO's HDF5 files, on files written as PATATO writes them."""

import os
import pickle
from datetime import UTC, datetime

import h5py
import numpy as np
import pytest

import oatkit
from oatkit.builtin.readers.ithera import IThera
from oatkit.builtin.readers.patato import Patato
from oatkit.builtin.readers.speed_of_sound import water_speed_of_sound_m_s
from oatkit.data import Grid
from oatkit.describe import look_beside, scan_table
from oatkit.errors import ReadError
from oatkit.hostile import printable
from oatkit.scanfile import write_scan
from patato_files import (
    FRAMES,
    HAND_DRAWN,
    RESULT_ATTRIBUTES,
    RING,
    SHAPE,
    WAVELENGTHS,
    add_result,
    add_roi,
    per_pulse,
    planes,
    raw_data,
    response,
    write_patato,
)


@pytest.fixture
def whole(tmp_path):
    """A file with everything in it."""
    return write_patato(tmp_path / "Scan_1.hdf5")


def changed(path, change):
    """The same file after a change by h5py."""
    with h5py.File(path, "r+") as file:
        change(file)
    return path


def replaced(name, values):
    """A change that puts other values in the place of a dataset; None takes it away."""

    def change(file):
        if name in file:
            del file[name]
        if values is not None:
            file[name] = values

    return change


# Raw data -----------------------------------------------------------------------------------------------------------


def test_raw_data_are_the_files_bit_for_bit(whole):
    """The same uint16 numbers, whole or in parts, and again after pickling."""
    scan, expected = oatkit.read(whole), raw_data()
    assert scan.reader == "patato"
    assert scan.signals.dtype == np.uint16
    assert np.array_equal(scan.signals[...], expected)
    assert np.array_equal(scan.signals[1, :, 3, 5:9], expected[1, :, 3, 5:9])
    assert np.array_equal(pickle.loads(pickle.dumps(scan)).signals[2], expected[2])


def test_a_scan_has_what_the_file_says_of_it(whole):
    """Detectors (x, y, z) become (y, x); ticks, mm and degrees become s, m and degrees Celsius."""
    scan = Patato().read(whole)
    assert scan.name == "201001_05"
    assert scan.wavelengths_nm == (700, 850)
    assert scan.geometry.sampling_rate_hz == 40e6
    assert np.array_equal(scan.geometry.detectors.positions_m, RING[:, [1, 0]])
    assert np.array_equal(scan.pulse_energy, per_pulse(1193.8, 7.0))
    assert np.array_equal(scan.temperature_c, per_pulse(33.0, 0.01))
    assert np.allclose(scan.position_m, per_pulse(0.05965, 0.0005), rtol=1e-15)
    taken = [datetime.fromtimestamp(t, UTC).replace(tzinfo=None) for t in scan.timestamps_s.flat]
    assert taken[0].replace(microsecond=0) == datetime(2020, 10, 1, 12, 32, 36)
    assert np.allclose(np.diff(scan.timestamps_s.ravel()), 0.1, atol=1e-5)


def test_the_impulse_response_has_its_peak_in_the_middle(tmp_path):
    """Stored about the middle or about index 0, it comes out the same, its spectrum at most 1."""
    stored = write_patato(tmp_path / "a.hdf5")
    rolled = changed(write_patato(tmp_path / "b.hdf5"), replaced("irf", np.fft.ifftshift(response())))
    expected = response() / abs(np.fft.rfft(response())).max()
    for path in (stored, rolled):
        assert np.allclose(Patato().read(path).geometry.impulse_response, expected, rtol=0, atol=1e-15)
    assert Patato(impulse_response=False).read(stored).geometry.impulse_response is None


def test_the_mouse_in_a_patato_file_is_the_mouse(mouse_scan, tmp_path):
    """Geometry, response, energy, temperature and signals equal those from the vendor's files, bit for bit.

    The file holds what PATATO's own converter puts there: coordinates as in the header, the response without its flag.
    """
    original = IThera().read(mouse_scan)
    flagged = np.fromfile(mouse_scan.with_suffix(".irf"))
    flagged[0] -= 1000
    y, x = original.geometry.detectors.positions_m.T
    with h5py.File(tmp_path / "mouse.hdf5", "w") as file:
        file["raw_data"] = original.signals[...]
        file["raw_data"].attrs.update({"fs": 40e6, "name": "mouse"})
        file["GEOMETRY"] = np.column_stack([x, y, 0 * x])
        file["irf"], file["wavelengths"] = flagged, [700.0]
        file["OverallCorrectionFactor"], file["TEMPERATURE"] = original.pulse_energy, original.temperature_c
        file["Z-POS"] = 1e3 * original.position_m
    scan = oatkit.read(tmp_path / "mouse.hdf5")
    assert np.array_equal(scan.signals[...], original.signals[...])
    assert scan.geometry.detectors == original.geometry.detectors
    assert np.array_equal(scan.geometry.impulse_response, original.geometry.impulse_response)
    assert np.array_equal(scan.pulse_energy, original.pulse_energy)
    assert np.allclose(scan.position_m, original.position_m, rtol=1e-15)


def test_a_preset_gives_the_same_image_from_a_patato_file(small_scan, tmp_path):
    """As from the scan that was written into it, at two wavelengths, the second one inverted."""
    signals = np.asarray(small_scan.signals[:1], "f4")
    geometry = small_scan.geometry
    with h5py.File(tmp_path / "s.hdf5", "w") as file:
        file["raw_data"] = np.concatenate([signals, -signals], axis=1)
        file["raw_data"].attrs.update({"fs": geometry.sampling_rate_hz, "speedofsound": geometry.speed_of_sound_m_s})
        file["GEOMETRY"] = np.pad(geometry.detectors.positions_m[:, ::-1], ((0, 0), (0, 1)))
        file["wavelengths"] = [700, 850]
    stored = oatkit.read(tmp_path / "s.hdf5").with_start_time(geometry.start_time_s)
    pipeline = oatkit.Pipeline.load(
        "lsqr", ("grid.pixels=40", "grid.field_of_view_mm=8", "reconstruct.n_iterations=5", "reconstruct.weight=0.01")
    )
    made = oatkit.run(pipeline, stored, frame=0)["initial_pressure"].values
    expected = oatkit.run(pipeline, small_scan, frame=0)["initial_pressure"].values[0]
    for image, sign in zip(made, (1, -1), strict=True):
        assert np.allclose(image, sign * expected, rtol=0, atol=1e-5 * abs(expected).max())


# What may be missing ------------------------------------------------------------------------------------------------


def test_a_file_needs_four_things_only(tmp_path):
    """Raw data with their sampling rate, GEOMETRY and wavelengths; what is missing is None."""
    with h5py.File(tmp_path / "bare.hdf5", "w") as file:
        file["raw_data"], file["GEOMETRY"], file["wavelengths"] = raw_data(), RING[:, :2], [700, 850]
        file.attrs["fs"] = 40_000_000
    scan = oatkit.read(tmp_path / "bare.hdf5")
    assert np.array_equal(scan.geometry.detectors.positions_m, RING[:, [1, 0]])
    assert scan.pulse_energy is scan.temperature_c is scan.timestamps_s is scan.position_m is None
    assert scan.geometry.impulse_response is None
    assert scan.name == "bare"
    assert oatkit.read_images(tmp_path / "bare.hdf5") == {}
    assert oatkit.read_regions(tmp_path / "bare.hdf5") == ()


NAN = np.full((FRAMES, WAVELENGTHS), np.nan)
ODD = {
    "all unknown": ("Z-POS", NAN, "position_m"),
    "one unknown": ("TEMPERATURE", np.where(np.arange(6).reshape(3, 2) == 3, np.nan, 33.0), "temperature_c"),
    "another shape": ("TEMPERATURE", np.ones(FRAMES), "temperature_c"),
    "texts": ("timestamp", np.full((FRAMES, WAVELENGTHS), b"noon"), "timestamps_s"),
    "an empty one": ("TEMPERATURE", np.ones((0, WAVELENGTHS)), "temperature_c"),
}


@pytest.mark.parametrize("case", ODD)
def test_an_optional_item_that_makes_no_sense_is_left_out_with_a_note(whole, case):
    """The scan is read; the note names the dataset."""
    name, values, field = ODD[case]
    scan = Patato().read(changed(whole, replaced(name, values)))
    assert getattr(scan, field) is None
    assert any(note.startswith(name) for note in scan.notes)


def test_a_dataset_in_the_place_of_a_group_is_passed_over(whole, caplog):
    """With a warning; scan and other results are read."""
    changed(whole, replaced("recons/stray", np.ones(3)))
    assert Patato().read(whole).frames == FRAMES
    assert "recons/stray" in caplog.text
    assert "recons/Model Based/0" in oatkit.read_images(whole)


def test_old_files_have_the_correction_factor_in_power(whole):
    """Where OverallCorrectionFactor is all NaN, as PATATO itself reads them."""
    changed(whole, replaced("OverallCorrectionFactor", NAN))
    scan = Patato().read(changed(whole, replaced("POWER", per_pulse(900.0, 1.0))))
    assert np.array_equal(scan.pulse_energy, per_pulse(900.0, 1.0))


def test_timestamps_that_count_from_elsewhere_are_kept_as_seconds(whole):
    """Ticks of 100 ns, with a note that their start is unknown."""
    scan = Patato().read(changed(whole, replaced("timestamp", per_pulse(0, 10**7, "u8"))))
    assert np.allclose(scan.timestamps_s, per_pulse(0, 1))
    assert any("unknown start" in note for note in scan.notes)


def test_attributes_of_odd_types_are_read(whole):
    """Bytes, arrays of one, booleans and missing values do for texts and numbers."""

    def change(file):
        file["raw_data"].attrs["name"] = np.array([b"M\xc3\xa4use"])
        file["raw_data"].attrs["fs"] = np.array([40_000_000], "i4")
        file["raw_data"].attrs["speedofsound"] = h5py.Empty("f8")
        file.attrs["speedofsound"] = np.nan
        file.attrs["more"] = [True, False]

    scan = Patato().read(changed(whole, change))
    assert scan.name == "M\xe4use"
    assert scan.geometry.sampling_rate_hz == 40e6
    assert scan.geometry.speed_of_sound_m_s == 1469


def speeds(raw=None, root=None, recon=None, temperature=True):
    """A change of where the speed of sound stands."""

    def change(file):
        for item, value in ((file["raw_data"], raw), (file, root), (file["recons/Model Based/1"], recon)):
            item.attrs.pop("speedofsound", None)
            if value is not None:
                item.attrs["speedofsound"] = value
        del file["recons/Model Based/0"]
        if not temperature:
            del file["TEMPERATURE"]

    return change


MEAN_TEMPERATURE = float(per_pulse(33.0, 0.01).mean())
SPEEDS = {
    "raw data": (speeds(1480, 1490, 1469), 1480, "attribute speedofsound of raw_data"),
    "file": (speeds(None, 1490, 1469), 1490, "attribute speedofsound of /"),
    "reconstruction": (speeds(recon=1468.5), 1468.5, "attribute speedofsound of recons/Model Based/1"),
    "trim": (speeds(recon=43), water_speed_of_sound_m_s(MEAN_TEMPERATURE), "water at 33.02"),
    "water": (speeds(), water_speed_of_sound_m_s(MEAN_TEMPERATURE), "water at 33.02"),
    "nothing": (speeds(temperature=False), 1500, "default"),
}


@pytest.mark.parametrize("case", SPEEDS)
def test_the_speed_of_sound_says_where_it_comes_from(whole, case):
    """Raw data, file, reconstruction, water, in this order; a trim added to the speed in water is no speed."""
    change, expected, source = SPEEDS[case]
    scan = Patato().read(changed(whole, change))
    assert scan.geometry.speed_of_sound_m_s == pytest.approx(expected, abs=1e-9)
    assert source in scan.speed_of_sound_source
    assert ("assumed" in " ".join(scan.notes)) == (case in ("trim", "water", "nothing"))


BROKEN = {
    "no wavelengths": (replaced("wavelengths", None), "'wavelengths'"),
    "too few wavelengths": (replaced("wavelengths", [700.0]), "2 wavelengths in the data"),
    "wavelengths in m": (replaced("wavelengths", [700e-9, 850e-9]), "the unit is nm"),
    "no detectors": (replaced("GEOMETRY", None), "'GEOMETRY'"),
    "one detector less": (replaced("GEOMETRY", RING[1:]), "the geometry says"),
    "detectors in mm": (replaced("GEOMETRY", 1e3 * RING), "the unit is m"),
    "a cup of detectors": (replaced("GEOMETRY", RING + np.arange(16)[:, None] * [0, 0, 1e-3]), "a plane"),
    "three axes": (replaced("raw_data", raw_data()[0]), "4 axes"),
    "complex signals": (replaced("raw_data", raw_data().astype("c8")), "type"),
    "no frame": (replaced("raw_data", raw_data()[:0]), "'fs'|shape"),
    "a response that is not finite": (replaced("irf", np.where(np.arange(40) == 3, np.nan, 1.0)), "finite"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_file_that_cannot_be_a_scan_is_refused(whole, case):
    """With a sentence that names the file and what is wrong."""
    change, words = BROKEN[case]
    with pytest.raises(ReadError, match=words) as error:
        Patato().read(changed(whole, change))
    assert str(whole) in str(error.value)


# Results ------------------------------------------------------------------------------------------------------------


def test_results_are_the_files_bit_for_bit(whole):
    """By the names of their datasets, each with quantity, unit and wavelengths; NaN stays."""
    found = oatkit.read_images(whole)
    expected = {
        "recons/Model Based/0": (planes(2), "initial_pressure", "a.u."),
        "recons/Model Based/1": (planes(2, 2), "initial_pressure", "a.u."),
        "unmixed/Model Based/0/deoxyhaemoglobin": (planes(2, 3)[:, :1], "deoxyhaemoglobin", "a.u."),
        "unmixed/Model Based/0/oxyhaemoglobin": (planes(2, 3)[:, 1:], "oxyhaemoglobin", "a.u."),
        "so2/Model Based/0": (planes(1, 4), "so2", ""),
        "thb/Model Based/0": (planes(1, 5), "total_haemoglobin", "a.u."),
        "dso2/Model Based/0": (planes(1, 6)[:1], "so2_change", ""),
    }
    assert list(found) == list(expected)
    for name, (values, quantity, unit) in expected.items():
        assert len(found[name]) == len(values)
        for image, plane in zip(found[name], values[:, :, 0], strict=True):
            assert np.array_equal(image.values, plane, equal_nan=True)
            assert image.values.dtype == np.float32
            assert (image.quantity, image.unit) == (quantity, unit)
            assert image.wavelengths_nm == ((700, 850) if quantity == "initial_pressure" else ())
    assert found["so2/Model Based/0"][0].history[0]["algorithm"] == "Model Based"


def test_outermost_pixels_lie_on_the_edge_of_the_field_of_view(whole):
    """Pixel centres are numpy's linspace(-FOV/2, FOV/2, N), as PATATO's coordinates are; a pair is an interval."""
    grid = oatkit.read_images(whole)["recons/Model Based/0"][0].grid
    assert np.allclose(grid.y_m, np.linspace(-0.003, 0.003, 7), rtol=0, atol=1e-15)
    assert np.allclose(grid.x_m, np.linspace(-0.004, 0.004, 9), rtol=0, atol=1e-15)
    shifted = {"RECONSTRUCTION_FIELD_OF_VIEW_X": [0.001, 0.009]}
    changed(whole, lambda file: file["recons/Model Based/0"].attrs.update(shifted))
    grid = oatkit.read_images(whole)["recons/Model Based/0"][0].grid
    assert np.allclose(grid.x_m, np.linspace(0.001, 0.009, 9), rtol=0, atol=1e-15)


def test_rows_of_a_stored_reconstruction_point_up_as_ours_do(tmp_path):
    """A point off both axes shows at one place by PATATO's delay and sum, stored (z, y, x), and by ours."""
    source, n, speed, fs = np.array([0.002, -0.0035, 0.0]), 61, 1500.0, 40e6
    distance = np.hypot(*(RING - source)[:, :2].T)
    t = np.arange(2000) - (distance * fs / speed)[:, None]
    raw = np.exp(-0.5 * (t / 3) ** 2)[None, None].astype("f4")
    axis = np.linspace(-0.006, 0.006, n)
    z, y, x = np.meshgrid([0.0], axis, axis, indexing="ij")
    image = np.zeros((1, 1, 1, n, n))
    for detector, (dx, dy, dz) in enumerate(RING):
        delay = np.sqrt((dx - x) ** 2 + (dy - y) ** 2 + (dz - z) ** 2) / (speed / fs)
        image[0, 0] += raw[0, 0, detector, delay.astype(np.int32)]
    with h5py.File(tmp_path / "p.hdf5", "w") as file:
        file["raw_data"], file["GEOMETRY"], file["wavelengths"] = raw, RING, [800]
        file["raw_data"].attrs.update({"fs": fs, "speedofsound": speed})
        fov = {f"RECONSTRUCTION_FIELD_OF_VIEW_{axis}": 0.012 for axis in "XYZ"}
        add_result(file, "recons/Slow Backprojection/0", image, **fov)
    stored = oatkit.read_images(tmp_path / "p.hdf5")["recons/Slow Backprojection/0"][0]
    geometry = oatkit.read(tmp_path / "p.hdf5").geometry
    operator = oatkit.plugin("forward_model", "arc")().operator(geometry, stored.grid)
    ours = operator.rmatvec(np.gradient(raw[0, 0], axis=1).ravel()).reshape(n, n)
    places = [np.unravel_index(abs(v).argmax(), (n, n)) for v in (stored.values[0], ours)]
    for row, column in places:
        assert abs(stored.grid.y_m[row] + 0.0035) < 4e-4
        assert abs(stored.grid.x_m[column] - 0.002) < 4e-4


def test_an_image_plane_of_x_and_z_has_z_up(whole):
    """Where the y axis has one pixel, as the detectors of such files lie in the plane of x and z."""
    values = np.random.default_rng(1).random((FRAMES, 2, 7, 1, 9))
    fov = {"RECONSTRUCTION_FIELD_OF_VIEW_Y": 0.0, "RECONSTRUCTION_FIELD_OF_VIEW_Z": 0.006}
    changed(whole, lambda file: add_result(file, "recons/Clinical/0", values, **fov))
    image = oatkit.read_images(whole)["recons/Clinical/0"][1]
    assert np.array_equal(image.values, values[1, :, :, 0])
    changed(whole, replaced("GEOMETRY", RING[:, [0, 2, 1]]))
    assert np.array_equal(Patato().read(whole).geometry.detectors.positions_m, RING[:, [1, 0]])


def test_old_results_have_two_axes_of_space(whole):
    """(frame, wavelength, y, x) with one number for the field of view."""

    def change(file):
        file["recons/iThera/0"] = np.random.default_rng(1).random((FRAMES, 2, 5, 5))
        file["recons/iThera/0"].attrs["RECON_FOV"] = 0.004

    image = oatkit.read_images(changed(whole, change))["recons/iThera/0"][2]
    assert image.grid == Grid((5, 5), 1e-3)
    with h5py.File(whole) as file:
        assert np.array_equal(image.values, file["recons/iThera/0"][2])


REFUSED = {
    "volume": (np.ones((1, 2, 3, 7, 9)), {}, "volume"),
    "oblong": (planes(2), {"RECONSTRUCTION_FIELD_OF_VIEW_X": 0.009}, "square pixels"),
    "no size": (planes(2), dict.fromkeys((k for k in RESULT_ATTRIBUTES if "VIEW" in k), np.nan), "field of view"),
    "complex": (planes(2).astype("c8"), {}, "complex"),
    "two axes": (np.ones((7, 9)), {}, "expected the axes"),
    "wavelengths": (planes(3), {}, "wavelengths"),
    "mm": (planes(2), {f"RECONSTRUCTION_FIELD_OF_VIEW_{a}": v for a, v in zip("XY", (800, 600), strict=True)}, "unit"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_image_of_a_plane_says_so_when_it_is_read(whole, case):
    """It is listed beside the others, which stay readable."""
    values, attributes, words = REFUSED[case]
    changed(whole, lambda file: add_result(file, "recons/Odd/0", values, **attributes))
    found = oatkit.read_images(whole)
    with pytest.raises(ReadError, match=words):
        found["recons/Odd/0"][0]
    assert found["so2/Model Based/0"][0].quantity == "so2"


def test_images_take_indices_as_lists_do(whole):
    """Negative ones, slices, and an IndexError beyond the end; they pickle."""
    stored = pickle.loads(pickle.dumps(oatkit.read_images(whole)["recons/Model Based/0"]))
    assert stored[-1] == stored[2]
    assert stored[1:] == [stored[1], stored[2]]
    with pytest.raises(IndexError):
        stored[3]


def test_components_without_names_are_numbered(whole):
    """Where SPECTRA is missing or does not fit."""
    changed(whole, lambda file: file["unmixed/Model Based/0"].attrs.pop("SPECTRA"))
    assert "unmixed/Model Based/0/component 1" in oatkit.read_images(whole)


def test_results_without_raw_data_are_read_as_images_and_regions(whole):
    """There is no scan, and the error says what there is."""
    changed(whole, replaced("raw_data", None))
    assert len(oatkit.read_images(whole)) == 7
    assert len(oatkit.read_regions(whole)) == 3
    with pytest.raises(ReadError, match="read_images"):
        oatkit.read(whole)


# Regions ------------------------------------------------------------------------------------------------------------


def test_regions_are_the_files_bit_for_bit(whole):
    """Named <class>_<position>/<n>, each (x, y) of the file as (y, x), even where sides cross."""
    found = {region.name: region.vertices_m for region in oatkit.read_regions(whole)}
    assert list(found) == ["reference_/0", "tumour_left/0", "tumour_left/1"]
    assert np.array_equal(found["tumour_left/0"][:, ::-1], HAND_DRAWN)
    assert np.array_equal(found["tumour_left/1"][:, ::-1], HAND_DRAWN[:4] * [-1, 1])
    assert np.array_equal(
        found["reference_/0"][:, ::-1].astype("f4"), np.array([[0, 0], [1e-3, 0], [1e-3, 1e-3]], "f4")
    )


def test_a_crossing_outline_holds_what_an_odd_number_of_sides_surrounds(tmp_path):
    """A five-pointed star drawn in one line has its tips inside and its middle outside."""
    tips = np.array([[np.sin(a), np.cos(a)] for a in 4 * np.pi / 5 * np.arange(5)]) * 3e-3
    with h5py.File(tmp_path / "r.hdf5", "w") as file:
        add_roi(file, "star_", tips)
    (star,) = oatkit.read_regions(tmp_path / "r.hdf5")
    assert not star.mask(Grid((1, 1), 1e-6))[0, 0]
    assert star.mask(Grid((1, 1), 1e-6, (2.5e-3, 0.0)))[0, 0]


def test_outlines_without_area_are_left_out_with_a_word(whole, caplog):
    """Two points, none, numbers that are no points, texts, and what is no dataset."""
    texts = np.full((3, 2), b"0.01")
    odd = {"line_": HAND_DRAWN[:2], "none_": np.zeros((0, 2)), "odd_": np.ones(3), "text_": texts}
    for name, values in odd.items():
        changed(whole, lambda file, name=name, values=values: add_roi(file, name, values))
    changed(whole, lambda file: file.create_dataset("rois/words_/0", data=["a", "b", "c"]))
    changed(whole, lambda file: file.create_group("rois/zoo_/0"))
    assert len(oatkit.read_regions(whole)) == 3
    left_out = [record.args[1].removesuffix("_/0") for record in caplog.records]
    assert left_out == ["line", "none", "odd", "text", "words", "zoo"]


@pytest.mark.parametrize(("factor", "words"), [(1e3, "unit is m"), (np.nan, "nan is outside")])
def test_a_region_that_makes_no_sense_leaves_the_others(whole, caplog, factor, words):
    """Corners in mm, or NaN: the log names the region and what is wrong with it, and all others are read."""
    changed(whole, lambda file: add_roi(file, "bad_", factor * HAND_DRAWN))
    assert [r.name for r in oatkit.read_regions(whole)] == ["reference_/0", "tumour_left/0", "tumour_left/1"]
    (record,) = caplog.records
    assert "'bad_/0'" in record.getMessage()
    assert words in record.getMessage()


# Files that mean harm, and files of others --------------------------------------------------------------------------

PLACES = [
    "raw_data",
    "GEOMETRY",
    "wavelengths",
    "TEMPERATURE",
    "irf",
    "recons",
    "recons/Model Based/0",
    "rois/tumour_left/1",
]
TRAPS = ["external link", "soft link", "dangling link", "external storage", "virtual", "enormous"]


def trap(kind, name, secret):
    """A change that puts something hostile in the place of a dataset or group."""

    def change(file):
        shape = file[name].shape if isinstance(file[name], h5py.Dataset) else (4,)
        file["copy"] = file[name]
        del file[name]
        if kind == "external link":
            file[name] = h5py.ExternalLink(str(secret), "data")
        elif kind == "soft link":
            file[name] = h5py.SoftLink("/copy")
        elif kind == "dangling link":
            file[name] = h5py.SoftLink("/nowhere")
        elif kind == "external storage":
            file.create_dataset(name, shape, "u1", external=[(str(secret), 0, h5py.h5f.UNLIMITED)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout(shape, "u2")
            layout[...] = h5py.VirtualSource(str(secret), "data", shape)
            file.create_virtual_dataset(name, layout)
        else:
            file.create_dataset(name, (10**5,) * max(1, len(shape)), "f8", chunks=(64,) * len(shape))

    return change


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", TRAPS)
def test_nothing_outside_the_file_is_read(whole, tmp_path, kind, place):
    """Whatever leads out of the file or declares more than it holds is refused, wherever it stands."""
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["data"] = np.zeros((4, 4))
    changed(whole, trap(kind, place, secret))
    reader = Patato()
    assert reader.can_read(whole)
    read = reader.images if place.startswith("recons/") else reader.regions if place.startswith("rois") else reader.read
    with pytest.raises(ReadError) as error:
        read(whole)
    assert printable(str(whole)) in str(error.value)


def test_the_speed_of_sound_of_another_file_is_not_read(whole, tmp_path):
    """A reconstruction that is a link to another file gives no speed of sound either: the scan is refused."""
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["data"] = planes(2)
        file["data"].attrs["speedofsound"] = 1540.0
    changed(whole, trap("external link", "recons/Model Based/0", secret))
    with pytest.raises(ReadError, match="links are refused"):
        Patato().read(whole)


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_a_file_cut_short_is_an_error_and_no_crash(whole, share):
    """It is not claimed, or refused, at any place."""
    content = whole.read_bytes()
    whole.write_bytes(content[: int(share * len(content))])
    assert Patato().can_read(whole) in (True, False)
    with pytest.raises(ReadError):
        Patato().read(whole)


def test_files_of_other_programs_are_not_claimed(small_scan, tmp_path):
    """Nor folders, empty files, pipes and names that cannot be."""
    write_scan(small_scan, tmp_path / "ours.h5")
    with h5py.File(tmp_path / "ipasc.hdf5", "w") as file:
        file["binary_time_series_data"] = raw_data()
        file["meta_data/uuid"], file["meta_data_device/general/num_detectors"] = "x", 16
        file.create_group("rois")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["raw_data"] = raw_data()
    (tmp_path / "empty.h5").touch()
    os.mkfifo(tmp_path / "pipe.h5")
    names = ["ours.h5", "ipasc.hdf5", "other.h5", "empty.h5", "pipe.h5", "missing.h5", "x" * 5000, "a\0b"]
    assert not any(Patato().can_read(tmp_path / name) for name in [*names, "."])


def test_info_lists_images_and_regions(whole):
    """With the number of frames of each; what cannot be read becomes a note and hides neither scan nor regions."""
    table = scan_table(oatkit.read(whole), look_beside(whole))
    assert {"name": "recons/Model Based/0", "frames": FRAMES} in table["images"]
    assert table["regions"] == ["reference_/0", "tumour_left/0", "tumour_left/1"]
    changed(whole, replaced("so2", np.ones(3)))
    table = scan_table(oatkit.read(whole), look_beside(whole))
    assert table["images"] == []
    assert len(table["regions"]) == 3
    assert any(note.startswith("Images:") and "'so2'" in note for note in table["notes"])
    assert table["frames"] == SHAPE[0]
