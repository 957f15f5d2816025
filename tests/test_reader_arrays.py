"""Plain arrays with a TOML file beside them: whatever order, type and format, the numbers are the file's."""

import os
import pickle
import re
import tracemalloc
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import basic_indices

import oatkit
from array_files import (
    ARC,
    LENGTHS,
    LETTERS,
    POSITIONS,
    describe,
    numbers,
    refuses,
    saved,
    write_mat,
    write_plain,
    write_scattered,
)
from oatkit.builtin.readers.array_signals import AXES, array_signals
from oatkit.builtin.readers.ithera import IThera
from oatkit.builtin.readers.npy import npy_pages
from oatkit.builtin.readers.plain_array import PlainArray
from oatkit.data import Geometry
from oatkit.errors import ReadError
from oatkit.simulate import arc_detectors

# Any order of axes, any type -----------------------------------------------------------------------------------------


@given(
    axes=st.permutations(AXES).flatmap(lambda order: st.integers(1, 4).map(lambda n: tuple(order[:n]))),
    dtype=st.sampled_from(["u1", "<u2", ">u2", "<i2", ">i4", "<i8", "<f2", ">f4", "<f4", "<f8", ">f8"]),
    fortran=st.booleans(),
)
def test_any_order_of_axes_gives_the_same_signals(tmp_path_factory, axes, dtype, fortran):
    """Signals and their type are those of the file, bit for bit; an axis that it lacks has length one."""
    stored, whole = numbers(axes, dtype)
    folder = tmp_path_factory.mktemp("axes")
    toml = saved(folder, np.asfortranarray(stored) if fortran else stored, axes=axes)
    signals = PlainArray().read(toml).signals
    assert signals.shape == whole.shape
    assert signals.dtype == np.dtype(dtype)
    assert np.array_equal(signals[...], whole)


@pytest.mark.parametrize("write", [write_plain, write_scattered])
@pytest.mark.parametrize("axes", list(permutations(AXES)), ids=lambda axes: "".join(LETTERS[a] for a in axes))
def test_any_order_of_tiff_axes_gives_the_same_signals(tmp_path, axes, write):
    """Pages are counted by the axes before the last two; only a TIFF paged by frame and sample cannot be told."""
    stored, whole = numbers(axes, "<i2")
    write(tmp_path / "scan.tif", stored)
    toml = describe(tmp_path, "scan.tif", axes)
    if set(axes[:2]) == {"frame", "sample"}:
        refuses(toml, "does not say how its pages divide into")
        return
    signals = PlainArray().read(toml).signals
    assert np.array_equal(signals[...], whole)
    assert signals[1, :, 2].dtype == np.dtype("<i2" if write is write_plain else ">i2")


def test_pages_taken_for_colours_are_pages(tmp_path):
    """Four frames in one page of four colour planes are four frames."""
    axes = ("wavelength", "frame", "detector", "sample")
    stored, whole = numbers(axes)
    tifffile.imwrite(tmp_path / "scan.tif", stored, photometric="rgb", planarconfig="separate")
    with tifffile.TiffFile(tmp_path / "scan.tif") as file:
        assert len(file.pages) == 2
    assert np.array_equal(PlainArray().read(describe(tmp_path, "scan.tif", axes)).signals[...], whole)


def test_columns_taken_for_colours_are_columns(tmp_path):
    """An array whose last axis has length four is one of coloured pixels to some programs; it is read as it is."""
    axes = ("wavelength", "sample", "detector", "frame")
    stored, whole = numbers(axes)
    tifffile.imwrite(tmp_path / "scan.tif", stored, photometric="rgb", planarconfig="contig")
    assert np.array_equal(PlainArray().read(describe(tmp_path, "scan.tif", axes)).signals[...], whole)


def test_a_hyperstack_of_imagej_is_a_stack_of_pages(tmp_path):
    """Time and channel of ImageJ count the pages as frame and wavelength do."""
    stored, whole = numbers()
    tifffile.imwrite(tmp_path / "scan.tif", stored, imagej=True, metadata={"axes": "TCYX"})
    assert np.array_equal(PlainArray().read(describe(tmp_path, "scan.tif")).signals[...], whole)


def test_a_single_page_is_a_single_pulse(tmp_path):
    """Detectors by samples, one frame at one wavelength."""
    stored, whole = numbers(("detector", "sample"), "f4")
    tifffile.imwrite(tmp_path / "scan.tiff", stored)
    scan = PlainArray().read(describe(tmp_path, "scan.tiff", ("detector", "sample")))
    assert np.array_equal(scan.signals[...], whole)
    assert "The file has no axis frame and wavelength: length one assumed." in scan.notes


def test_not_finite_signals_are_left_to_the_steps_that_follow(tmp_path):
    """NaN and infinity come through as they are."""
    stored, whole = numbers(dtype="f4")
    stored, whole = stored.copy(), whole.copy()
    for array in (stored, whole):
        array[1, 0, 2, :2] = np.nan, np.inf
    signals = PlainArray().read(saved(tmp_path, stored)).signals
    assert np.array_equal(signals[...], whole, equal_nan=True)


# The whole scan ------------------------------------------------------------------------------------------------------


def test_a_scan_taken_apart_is_the_same_scan(small_scan, tmp_path):
    """A simulated scan, saved as plain arrays with a description, comes back equal in every field that is data."""
    pulses = np.arange(2.0).reshape(2, 1)
    scan = replace(
        small_scan, pulse_energy=pulses + 1, temperature_c=pulses + 30, timestamps_s=pulses, position_m=pulses
    )
    np.save(tmp_path / "scan.npy", np.asarray(scan.signals).transpose(3, 0, 2, 1))
    np.save(tmp_path / "detectors.npy", scan.geometry.detectors.positions_m)
    for name in ("pulse_energy", "temperature_c", "timestamps_s", "position_m"):
        np.save(tmp_path / f"{name}.npy", getattr(scan, name))
    rest = '[detectors]\npositions = "detectors.npy"\naxes = ["y", "x"]\nunit = "m"\n[pulses]\n'
    rest += "".join(
        f'{name} = "{name}.npy"\n' for name in ("pulse_energy", "temperature_c", "timestamps_s", "position_m")
    )
    toml = describe(
        tmp_path,
        axes=("sample", "frame", "detector", "wavelength"),
        wavelengths_nm=list(scan.wavelengths_nm),
        sampling_rate_mhz=20,
        start_time_us=2,
        speed_of_sound_m_s=1500,
        rest=rest,
    )
    back = oatkit.read(toml)
    assert replace(back, signals=back.signals[...]) == scan
    assert (back.source, back.reader, back.name) == (str(toml), "array", "scan")
    assert back.speed_of_sound_source == "scan.toml: 1500 m/s"
    assert back.notes == ("There is no impulse response: signals are taken as the ideal ones.",)


def test_a_description_reads_as_its_signals_do(tmp_path):
    """Either path of a pair gives the scan; signals that another file describes are not theirs."""
    toml = saved(tmp_path)
    assert PlainArray().can_read(tmp_path / "scan.npy")
    assert PlainArray().read(tmp_path / "scan.npy") == PlainArray().read(toml)
    np.save(tmp_path / "other.npy", numbers()[0])
    describe(tmp_path, "other.npy")
    with pytest.raises(ReadError, match=r"describes 'other.npy', not scan.npy"):
        PlainArray().read(tmp_path / "scan.npy")


def test_every_assumption_is_noted(tmp_path):
    """What the description leaves open stands in the notes with the value that was taken."""
    np.save(tmp_path / "xyz.npy", arc_detectors(5).positions_m[:, [1, 0]])
    np.save(tmp_path / "irf.npy", np.ones(4))
    rest = '[detectors]\npositions = "xyz.npy"\n[impulse_response]\nfile = "irf.npy"'
    scan = PlainArray().read(saved(tmp_path, rest=rest))
    text = " ".join(scan.notes)
    for assumed in ("start time is not stated", "1500 m/s assumed", "m assumed", "x, y assumed", "index 2, the middle"):
        assert assumed in text
    assert scan.speed_of_sound_source == "default"
    assert scan.geometry.speed_of_sound_m_s == Geometry.speed_of_sound_m_s


def test_pulses_of_a_matlab_file_are_as_in_matlab(tmp_path):
    """Rows are frames there; the file holds them the other way round."""
    temperature_c = np.arange(8.0).reshape(4, 2)
    write_mat(tmp_path / "t.mat", T=temperature_c.T)
    toml = saved(tmp_path, rest=ARC.format(count=5) + '[pulses]\ntemperature_c = "t.mat"\ndataset = "T"\n')
    assert np.array_equal(PlainArray().read(toml).temperature_c, temperature_c)


def test_only_descriptions_of_signals_are_claimed(tmp_path):
    """Not a pipeline, nor another TOML file, nor signals without a description, nor what cannot be opened."""
    (tmp_path / "pipeline.toml").write_text("[signals]\n[reconstruct]\nuse = 'lsqr'\n")
    (tmp_path / "project.toml").write_text("[project]\nname = 'x'\n")
    (tmp_path / "binary.toml").write_bytes(b"\xff[signals]")
    (tmp_path / "folder.toml").mkdir()
    np.save(tmp_path / "lone.npy", numbers()[0])
    os.mkfifo(tmp_path / "pipe.toml")
    names = ("pipeline.toml", "project.toml", "binary.toml", "folder.toml", "lone.npy", "pipe.toml", "none.toml", "")
    assert not any(PlainArray().can_read(tmp_path / name) for name in (*names, "a\0.toml", "x" * 5000 + ".toml"))


# Detectors -----------------------------------------------------------------------------------------------------------


def detectors_of(folder: Path, count: int, rest: str):
    """The detectors of a scan with `count` of them, described by `rest`."""
    array = np.zeros((1, 1, count, 3), "f4")
    return PlainArray().read(saved(folder, array, wavelengths_nm="[700]", rest=rest)).geometry.detectors


def test_the_real_ring_is_the_files(shared_data, tmp_path):
    """512 detectors on a circle of 40.73 mm, in the order and the plane of MATLAB's file."""
    (tmp_path / "ring.mat").write_bytes((shared_data / "geometry" / "ringCup.mat").read_bytes())
    positions = detectors_of(tmp_path, 512, POSITIONS.format(file="ring.mat")).positions_m
    with h5py.File(tmp_path / "ring.mat") as file:
        x, y, _ = file["transducerPos"][()]
    assert np.array_equal(positions, np.stack([y, x], axis=1))
    assert np.allclose(np.hypot(x, y), 40.73e-3, atol=1e-9)


def test_the_real_array_with_straight_parts_is_the_files(shared_data, tmp_path):
    """256 detectors at 35.4 to 40.6 mm, as MATLAB's file has them, though they lie on no circle."""
    (tmp_path / "multi.mat").write_bytes((shared_data / "geometry" / "multisegmentCup.mat").read_bytes())
    positions = detectors_of(tmp_path, 256, POSITIONS.format(file="multi.mat")).positions_m
    with h5py.File(tmp_path / "multi.mat") as file:
        x, y, _ = file["transducerPos"][()]
    assert np.array_equal(positions, np.stack([y, x], axis=1))
    radius = np.hypot(x, y)
    assert 35.4e-3 < radius.min() < 35.6e-3
    assert 40.4e-3 < radius.max() < 40.6e-3


def test_the_arc_is_the_mouse_scanners(mouse_scan, tmp_path):
    """256 detectors on 270 degrees at 40.5 mm are those of the real header, detector by detector, within 10 um."""
    positions = detectors_of(tmp_path, 256, ARC.format(count=256)).positions_m
    assert np.allclose(positions, IThera().read(mouse_scan).geometry.detectors.positions_m, atol=1e-5)


@pytest.mark.parametrize(("count", "coverage"), [(1, 10), (5, 270), (64, 360)])
def test_an_arc_is_that_of_the_simulation(tmp_path, count, coverage):
    """Two implementations of one convention agree to rounding."""
    rest = f"[arc]\nradius_mm = 20\ncoverage_degrees = {coverage}\ncount = {count}\n"
    expected = arc_detectors(count, 0.02, coverage).positions_m
    assert np.allclose(detectors_of(tmp_path, count, rest).positions_m, expected, rtol=0, atol=1e-17)


def test_an_arc_turns_anticlockwise(tmp_path):
    """A rotation multiplies x + iy by exp(i angle); counting clockwise reverses the order of a symmetric arc."""
    base = detectors_of(tmp_path, 5, ARC.format(count=5)).positions_m @ [1j, 1]
    turned = detectors_of(tmp_path, 5, ARC.format(count=5) + "rotation_degrees = 35\n").positions_m @ [1j, 1]
    clockwise = detectors_of(tmp_path, 5, ARC.format(count=5) + 'order = "clockwise"\n').positions_m @ [1j, 1]
    assert np.allclose(turned, base * np.exp(1j * np.deg2rad(35)), rtol=0, atol=1e-16)
    assert np.allclose(clockwise, base[::-1], rtol=0, atol=1e-16)


def test_all_formats_of_positions_agree(tmp_path):
    """The same numbers in .npy, .csv and .mat, either way round, in m or mm, are the same detectors."""
    xyz = np.column_stack([np.linspace(-0.02, 0.02, 5), np.full(5, 0.03), np.full(5, 0.25)])
    np.save(tmp_path / "a.npy", xyz)
    np.save(tmp_path / "b.npy", np.asfortranarray(xyz.T))
    rows = "\n".join(",".join(map(repr, row)) for row in xyz.tolist())
    (tmp_path / "c.csv").write_text(f"# x, y, z\n{rows}\n")
    write_mat(tmp_path / "d.mat", transducerPos=xyz.T)
    write_mat(tmp_path / "e.mat", transducerPos=xyz)
    expected = xyz[:, [1, 0]]
    for name in ("a.npy", "b.npy", "c.csv", "d.mat", "e.mat"):
        positions = detectors_of(tmp_path, 5, POSITIONS.format(file=name)).positions_m
        assert np.array_equal(positions, expected), name
    np.save(tmp_path / "mm.npy", 1e3 * xyz)
    in_mm = detectors_of(tmp_path, 5, '[detectors]\npositions = "mm.npy"\nunit = "mm"\n').positions_m
    assert np.allclose(in_mm, expected, rtol=1e-15)


@pytest.mark.parametrize("across", ["x", "y", "z"])
def test_the_plane_of_the_detectors_is_found(tmp_path, across):
    """The constant coordinate is left out; of the others, the first in the alphabet points to the right."""
    right, up = (axis for axis in "xyz" if axis != across)
    columns = {right: np.arange(5) * 1e-2, up: np.arange(5) ** 2 * 1e-3, across: np.full(5, 0.7)}
    for order in permutations("xyz"):
        np.save(tmp_path / "p.npy", np.column_stack([columns[axis] for axis in order]))
        rest = f'[detectors]\npositions = "p.npy"\naxes = {list(order)}\nunit = "m"\n'
        positions = detectors_of(tmp_path, 5, rest).positions_m
        assert np.array_equal(positions, np.column_stack([columns[up], columns[right]]))


def test_an_array_that_fills_space_is_refused(tmp_path):
    """Points on a sphere lie in no plane; the message gives their extent."""
    np.save(tmp_path / "p.npy", 0.04 * np.vstack([np.eye(3), -np.eye(3)]))
    refuses(saved(tmp_path, rest=POSITIONS.format(file="p.npy")), "80 x 80 x 80 mm", "3-D arrays are not supported")


@pytest.mark.parametrize(
    ("values", "keys", "words"),
    [
        (40.5, 'unit = "m"', ("outside -2 .. 2", "the unit is m, so 40 mm is 0.04")),
        (0.0405, 'unit = "mm"', ("within 0.0405 mm", "is their unit 'mm'?")),
        (0.0405, 'unit = "cm"', ('[detectors].unit: must be "m" or "mm"',)),
        (np.nan, "", ("expected finite numbers, found 10 that are not",)),
        (0.0405, 'axes = ["x", "z"]', ("expected [detectors].axes to name x, y",)),
        (0.0405, 'axes = ["x", "x"]', ("expected [detectors].axes to name x, y",)),
    ],
)
def test_positions_out_of_range_are_refused(tmp_path, values, keys, words):
    """A slip of the unit, a missing value or a wrong axis is an error that says so."""
    np.save(tmp_path / "p.npy", np.full((5, 2), values))
    refuses(saved(tmp_path, rest=f'[detectors]\npositions = "p.npy"\n{keys}\n'), *words)


@pytest.mark.parametrize("shape", [(5,), (5, 4), (2, 3), (3, 3), (5, 2, 1), (1, 1)])
def test_positions_of_another_shape_are_refused(tmp_path, shape):
    """Neither axis has two or three entries, or both have."""
    np.save(tmp_path / "p.npy", np.full(shape, 0.01))
    refuses(saved(tmp_path, rest=POSITIONS.format(file="p.npy")), "expected (n, 2) or (n, 3)", str(shape))


# Impulse response ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 2, 5, 6])
def test_time_zero_of_the_response_is_where_the_file_says(tmp_path, size):
    """Whatever the centre, it comes to lie at n // 2 with the other samples in their order about it."""
    values = np.arange(1.0, size + 1)
    np.save(tmp_path / "irf.npy", values)
    for centre in range(size):
        rest = ARC.format(count=5) + f'[impulse_response]\nfile = "irf.npy"\ncentre = {centre}\n'
        response = PlainArray().read(saved(tmp_path, rest=rest)).geometry.impulse_response
        assert response[len(response) // 2] == values[centre] / values.sum()
        assert np.array_equal(np.trim_zeros(response), values / values.sum())


def test_the_real_response_is_the_files(shared_data, tmp_path):
    """The 201 samples of MATLAB's file with a spectrum of at most one; the responses of all elements are refused."""
    (tmp_path / "irf.mat").write_bytes((shared_data / "example_impulse_response.mat").read_bytes())
    rest = ARC.format(count=5) + '[impulse_response]\nfile = "irf.mat"\n'
    response = PlainArray().read(saved(tmp_path, rest=rest)).geometry.impulse_response
    with h5py.File(tmp_path / "irf.mat") as file:
        assert np.allclose(response * abs(np.fft.rfft(file["EIR"][0])).max(), file["EIR"][0], rtol=1e-14, atol=0)
    assert np.argmax(abs(response)) == 100
    rest += 'dataset = "EIR_indiv_mat"\n'
    refuses(saved(tmp_path, rest=rest), "expected one impulse response for all detectors", "(201, 256)")


@pytest.mark.parametrize("gain", [1e-6, 1.0, 1e4])
def test_the_scale_of_a_response_does_not_scale_images(tmp_path, gain):
    """Whatever its unit, the largest magnitude of its spectrum becomes one, as it does for iThera's files."""
    np.save(tmp_path / "irf.npy", gain * np.hanning(6))
    rest = ARC.format(count=5) + '[impulse_response]\nfile = "irf.npy"\n'
    scan = PlainArray().read(saved(tmp_path, rest=rest))
    assert abs(np.fft.rfft(scan.geometry.impulse_response)).max() == pytest.approx(1, abs=1e-15)
    assert f"divided by {gain * np.hanning(6).sum():.4g}" in scan.notes[-1]


@pytest.mark.parametrize(
    ("values", "keys", "words"),
    [
        (np.zeros(5), "", ("expected an impulse response, found only zeros",)),
        (np.ones(5), "centre = 5", ("the centre 5 lies beyond the 5 samples",)),
        (np.ones(5), "centre = -1", ("[impulse_response].centre: must be a whole number at least 0",)),
        (np.array([1, np.inf]), "", ("expected finite numbers",)),
        (np.full(5, 1e308), "", ("numbers out of range",)),
    ],
)
def test_an_unusable_response_is_refused(tmp_path, values, keys, words):
    """Zeros, numbers that are not finite, and a centre outside it."""
    np.save(tmp_path / "irf.npy", values)
    refuses(saved(tmp_path, rest=ARC.format(count=5) + f'[impulse_response]\nfile = "irf.npy"\n{keys}\n'), *words)


# Lazy signals --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["npy", "tif"])
def lazy(request, tmp_path_factory):
    """Signals in a file with its axes in disorder, and the array that they are."""
    axes = ("sample", "frame", "detector", "wavelength") if request.param == "npy" else (*AXES[1::-1], *AXES[:1:-1])
    folder = tmp_path_factory.mktemp("lazy")
    stored, whole = numbers(axes, ">i2")
    np.save(folder / "scan.npy", stored)
    write_scattered(folder / "scan.tif", stored)
    return PlainArray().read(describe(folder, f"scan.{request.param}", axes)).signals, whole


@given(index=basic_indices(tuple(LENGTHS.values()), allow_newaxis=False))
def test_lazy_signals_index_as_an_array_does(lazy, index):
    """Whole numbers, slices and ``...`` give what numpy gives, in its shape."""
    signals, whole = lazy
    assert signals[index].shape == whole[index].shape
    assert np.array_equal(signals[index], whole[index])


@pytest.mark.parametrize("index", [True, [0, 1], (0, 0, 0, 0, 0), (..., ...), None, 1.0, 4, (0, 0, -6), (0, 2)])
def test_other_indices_are_refused(lazy, index):
    """A list or a mask would silently mean something else than in numpy; beyond the end there is nothing."""
    with pytest.raises(IndexError):
        lazy[0][index]


def test_lazy_signals_pickle_as_their_path(lazy):
    """Less than two kilobytes here, and the copy reads the same."""
    packed = pickle.dumps(lazy[0])
    assert len(packed) < 2000
    assert np.array_equal(pickle.loads(packed)[...], lazy[1])
    assert pickle.loads(packed) == lazy[0]


def test_a_moved_folder_is_the_same_scan(tmp_path):
    """Fingerprints come from what the files hold: not their path, not their times."""
    saved(tmp_path / "here")
    before = PlainArray().read(tmp_path / "here" / "scan.toml")
    (tmp_path / "here").rename(tmp_path / "there")
    os.utime(tmp_path / "there" / "scan.npy", (0, 0))
    assert PlainArray().read(tmp_path / "there" / "scan.toml") == before
    stored = numbers()[0].copy()
    stored[2, 1, 3, 5] += 1
    assert PlainArray().read(saved(tmp_path / "there", stored)) != before


def test_the_order_of_axes_is_part_of_the_identity(tmp_path):
    """The same bytes, read in another order, are other signals."""
    np.save(tmp_path / "scan.npy", np.arange(100).reshape(2, 2, 5, 5))
    orders = [("frame", "wavelength", "detector", "sample"), ("wavelength", "frame", "detector", "sample")]
    first, second = (PlainArray().read(describe(tmp_path, axes=axes)).signals for axes in orders)
    assert first != second


def test_a_changed_file_is_noticed(tmp_path):
    """Signals of a file that was replaced or cut after it was read are an error, not other numbers."""
    scan = PlainArray().read(saved(tmp_path))
    raw = bytearray((tmp_path / "scan.npy").read_bytes())
    for changed in (raw[:-1] + b"x", raw[:140]):
        (tmp_path / "scan.npy").write_bytes(changed)
        with pytest.raises(ReadError, match="has changed"):
            scan.signals[0]
    (tmp_path / "scan.npy").unlink()
    with pytest.raises(ReadError, match="cannot be read"):
        scan.signals[0]


def test_reading_one_frame_costs_one_frame(tmp_path):
    """Of a file of 2 GB, a frame of 2 MB takes 2 MB of memory."""
    path = tmp_path / "large.npy"
    np.lib.format.open_memmap(path, "w+", "u2", (1024, 1, 256, 4096)).flush()
    large = array_signals(path, npy_pages(path, AXES))
    tracemalloc.start()
    assert large[1000:1001].nbytes == 2 * 2**20
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5 * 2**20


def test_the_users_file_cannot_be_written(tmp_path):
    """What is returned is a copy: changing it changes nothing else."""
    signals = PlainArray().read(saved(tmp_path)).signals
    before = (tmp_path / "scan.npy").read_bytes()
    signals[0, 0][:] = 7
    assert np.array_equal(signals[...], numbers()[1])
    assert (tmp_path / "scan.npy").read_bytes() == before


# The page on formats -------------------------------------------------------------------------------------------------

PAGE = (Path(__file__).parents[1] / "docs" / "guides" / "formats.md").read_text()
EXAMPLE, ARC_EXAMPLE = re.findall(r"```toml\n(.*?)```", PAGE[PAGE.index("## Plain arrays") :], re.DOTALL)[:2]


def test_the_example_of_the_page_is_read(tmp_path):
    """The description that docs/guides/formats.md shows opens a scan with all that it names."""
    stored, whole = numbers()
    np.save(tmp_path / "scan.npy", stored)
    write_mat(tmp_path / "ringCup.mat", transducerPos=arc_detectors(5).positions_m.T[[1, 0, 0]] * [[1], [1], [0]])
    np.save(tmp_path / "irf.npy", np.hanning(201))
    np.save(tmp_path / "energy.npy", np.ones((4, 2)))
    (tmp_path / "scan.toml").write_text(EXAMPLE)
    scan = PlainArray().read(tmp_path / "scan.toml")
    assert np.array_equal(scan.signals[...], whole)
    assert np.array_equal(scan.geometry.detectors.positions_m, arc_detectors(5).positions_m)
    assert np.array_equal(scan.geometry.impulse_response, np.hanning(201) / np.abs(np.fft.rfft(np.hanning(201))).max())
    assert np.array_equal(scan.pulse_energy, np.ones((4, 2)))
    assert len(scan.notes) == 2


def test_the_arc_of_the_page_is_the_default_array(tmp_path):
    """The table that docs/guides/formats.md shows is an MSOT256-TF."""
    assert detectors_of(tmp_path, 256, ARC_EXAMPLE) == arc_detectors()


@pytest.mark.parametrize("name", ["signals.npy", "signals.TIF"])
def test_an_array_alone_asks_for_its_description(tmp_path, name):
    """Who opens the array itself is told of the description that is missing."""
    np.save(tmp_path / "a.npy", np.ones((2, 3)))
    (tmp_path / "a.npy").rename(tmp_path / name)
    with pytest.raises(ReadError, match=r"write a small \.toml beside it"):
        oatkit.read(tmp_path / name)
