"""IPASC files that are damaged or mean harm: one sentence each, and no other file is touched."""

import os

import h5py
import numpy as np
import pytest

import oatkit
from ipasc_files import ARC, SHAPE, write
from oatkit import hostile
from oatkit.builtin.readers.ipasc import Ipasc
from oatkit.errors import ReadError
from oatkit.hostile import hdf5_text, open_hdf5
from oatkit.ipasc import MAX_DETECTORS, write_ipasc
from oatkit.scanfile import write_scan
from test_hostile_files import cycle, dangling, external_link, one_sentence
from test_reader_hdf5 import a_scan, in_memory

POSITION = "meta_data_device/detectors/0000000002/detector_position"
LINKED = [
    "binary_time_series_data",
    "meta_data",
    "meta_data/ad_sampling_rate",
    "meta_data/speed_of_sound",
    "meta_data/acquisition_wavelengths",
    "meta_data/oatkit_name",
    "meta_data_device/detectors",
    "meta_data_device/detectors/0000000002",
    POSITION,
]


@pytest.fixture
def good(tmp_path):
    """A good file, to be spoiled."""
    return write(tmp_path / "scan.hdf5", oatkit_name="name")


def spoil(path, name, way=None):
    """Take something out of a file, and put something else in its place."""
    with h5py.File(path, "r+") as file:
        del file[name]
        if way is not None:
            way(file, name)
    return path


def refused(path) -> str:
    """The sentence with which the reader refuses a file, be it when opening or when reading the signals."""
    with pytest.raises(ReadError) as error:
        Ipasc().read(path).signals[...]
    assert path.name in one_sentence(error)
    return str(error.value)


@pytest.mark.parametrize("way", [external_link, dangling, cycle])
@pytest.mark.parametrize("name", LINKED)
def test_links_are_refused(good, way, name):
    """Wherever they stand, and wherever they lead."""
    assert "links are refused" in refused(spoil(good, name, way))


@pytest.mark.parametrize("name", ["binary_time_series_data", POSITION, "meta_data/speed_of_sound"])
def test_data_in_other_files_are_refused(good, name):
    """External storage and virtual datasets may lead to any file of the user."""
    shape = {"binary_time_series_data": SHAPE, POSITION: (3,)}.get(name, (1,))

    def external(file, name):
        file.create_dataset(name, shape, "u1", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])

    def virtual(file, name):
        layout = h5py.VirtualLayout(shape, "f8")
        layout[...] = h5py.VirtualSource("/tmp/other.h5", "x", shape)
        file.create_virtual_dataset(name, layout)

    assert "other files" in refused(spoil(good, name, external))
    assert "other files" in refused(spoil(good, name, virtual))


SIZES = {
    "shape": ("binary_time_series_data", {"shape": (5, 10**9, 2, 10**6), "dtype": "u2"}, "declares"),
    "chunk": (
        "binary_time_series_data",
        {"shape": (5, 2**25, 2, 1), "dtype": "f8", "chunks": (1, 2**25, 1, 1)},
        "chunk",
    ),
    "never written": ("binary_time_series_data", {"shape": SHAPE, "dtype": "u2", "chunks": SHAPE}, "the file holds 0"),
    "complex": ("binary_time_series_data", {"shape": SHAPE, "dtype": "c16"}, "expected a type"),
    "objects": ("binary_time_series_data", {"shape": SHAPE, "dtype": h5py.string_dtype()}, "expected a type"),
    "map": ("meta_data/speed_of_sound", {"shape": (1000, 1000, 1000), "dtype": "f8", "chunks": (9, 9, 9)}, "declares"),
    "position": (POSITION, {"shape": (10**6,), "dtype": "f8"}, "declares"),
}


@pytest.mark.parametrize("case", SIZES)
def test_impossible_sizes_and_types_are_refused(good, case):
    """By what is declared, before anything is read."""
    name, options, word = SIZES[case]
    assert word in refused(spoil(good, name, lambda file, name: file.create_dataset(name, **options)))


def test_masses_of_detectors_are_refused(good):
    """More than the stated limit, without looking at one of them."""
    with h5py.File(good, "r+") as file:
        group = file["meta_data_device/detectors"]
        for number in range(MAX_DETECTORS + 1 - len(ARC)):
            group[f"x{number}"] = group["0000000002"]
    assert f"at most {MAX_DETECTORS} are read" in refused(good)


def test_a_group_that_holds_itself_is_no_detector(good):
    """Hard links can make a circle, which is not followed."""
    with h5py.File(good, "r+") as file:
        file["meta_data_device/detectors/again"] = file["meta_data_device/detectors"]
    assert "again/detector_position': expected a dataset, found nothing" in refused(good)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_file_cut_short_is_refused(good, share):
    """At any place."""
    content = good.read_bytes()
    good.write_bytes(content[: int(share * len(content))])
    refused(good)


REQUIRED = [name for name in LINKED if name not in ("meta_data/speed_of_sound", "meta_data/oatkit_name")]


@pytest.mark.parametrize("name", [n for n in REQUIRED if n != "meta_data_device/detectors/0000000002"])
def test_a_missing_item_is_named(good, name):
    """And so is a dataset of six axes in its place, be it that of a group or of a number."""
    word = name.split("/")[-1]
    assert word in refused(spoil(good, name))
    with h5py.File(good, "r+") as file:
        file[name] = np.zeros((1,) * 6)
    assert word in refused(good)


WRONG = {
    "a text": ("ad_sampling_rate", "fast", "expected a type"),
    "two numbers": ("ad_sampling_rate", [40e6, 40e6], "one finite number"),
    "nan": ("ad_sampling_rate", np.nan, "one finite number"),
    "MHz": ("ad_sampling_rate", 40.0, "40 MHz is 40e6"),
    "mm/us": ("speed_of_sound", 1.5, "the unit is m/s"),
    "nan in a map": ("speed_of_sound", [1500.0, np.nan], "speed_of_sound"),
    "several texts": ("oatkit_name", ["a", "b"], "expected one text"),
    "a number for a text": ("oatkit_name", 1.5, "expected a type"),
    "numbers for a text": ("oatkit_name", np.array([65, 66], "u4"), "found numbers of type uint32"),
    "latin-1": ("oatkit_name", np.bytes_(b"\xff\xe4"), "UTF-8"),
    "valid": ("oatkit_valid", np.ones(7), "oatkit_valid"),
    "response": ("oatkit_impulse_response", np.zeros(7), "impulse_response"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_field_of_the_wrong_kind_is_refused(tmp_path, case):
    """The sentence names the field, or its unit."""
    name, value, word = WRONG[case]
    assert word in refused(write(tmp_path / "scan.hdf5", **{name: value}))


POINTS = {
    "two numbers": (ARC[:, :2], "x, y and z in m"),
    "mm": (1e3 * ARC, "the unit is m"),
    "nan": (np.where(ARC == 0, np.nan, ARC), "one plane|plane of constant"),
    "a volume": (ARC + np.array([[0, 0, 0.01 * i] for i in range(5)]), "3-D arrays are not supported"),
}


@pytest.mark.parametrize("case", POINTS)
def test_impossible_positions_are_refused(tmp_path, case):
    """Too few coordinates, another unit, nan, detectors all over a volume."""
    points, words = POINTS[case]
    text = refused(write(tmp_path / "scan.hdf5", points=points))
    assert any(word in text for word in words.split("|"))


def test_a_file_without_detectors_is_refused(tmp_path):
    """An empty group."""
    path = write(tmp_path / "scan.hdf5", points=[])
    with h5py.File(path, "r+") as file:
        file.create_group("meta_data_device/detectors")
    assert "a group for each detector" in refused(path)


@pytest.mark.parametrize("user_block", [0, 512])
def test_the_length_of_a_text_is_seen_before_it_is_read(tmp_path, user_block):
    """A text of variable length that declares 2 GiB would take as much memory before it fails."""
    path = tmp_path / "scan.hdf5"
    with h5py.File(path, "w", userblock_size=user_block) as file:
        file["text"] = "short"
        offset = file["text"].id.get_offset()
    with open_hdf5(path) as file:
        assert hdf5_text(file, "text") == "short"
    content = bytearray(path.read_bytes())
    assert content[offset] == len("short")
    content[offset : offset + 4] = (2**31 - 1).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.raises(ReadError, match="a text of 2147483647 bytes"), open_hdf5(path) as file:
        hdf5_text(file, "text")


def test_a_long_text_of_fixed_length_is_refused(tmp_path):
    """By the same limit."""
    path = write(tmp_path / "scan.hdf5", oatkit_notes=np.bytes_(b"x" * (hostile.MAX_TEXT_BYTES + 1)))
    assert "declares 65537 bytes" in refused(path)


def test_control_characters_do_not_reach_the_terminal(tmp_path):
    """Names and notes of a file are shown without them."""
    scan = Ipasc().read(write(tmp_path / "scan.hdf5", oatkit_name="a\x1b[2Jb", oatkit_notes="one\x07\ntwo"))
    assert scan.name == "a?[2Jb"
    assert scan.notes[:2] == ("one?", "two")


def test_flipped_bits_never_crash(tmp_path):
    """Of 200 files of ours with a wrong bit, each reads or is refused; wrong signals are always refused."""
    path, broken = tmp_path / "scan.hdf5", tmp_path / "broken.hdf5"
    write_ipasc(a_scan(), path)
    content, rng, refusals = path.read_bytes(), np.random.default_rng(3), 0
    for _ in range(200):
        damaged = bytearray(content)
        damaged[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        broken.write_bytes(damaged)
        try:
            assert np.array_equal(in_memory(Ipasc().read(broken)).signals, a_scan().signals)
        except ReadError:
            refusals += 1
    assert refusals > 30


def test_only_its_own_files_are_claimed(tmp_path):
    """Not oatkit's scan file, other roots, a text, a pipe, a folder, nothing; and never with an error."""
    write_scan(a_scan(), tmp_path / "scan.h5")
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        file.update({"binary_time_series_data": 1, "meta_data": 2, "something": 3})
    with h5py.File(tmp_path / "many.hdf5", "w") as file:
        file.update({f"root{i}": i for i in range(50)})
    (tmp_path / "text.hdf5").write_text("binary_time_series_data")
    (tmp_path / "cut.hdf5").write_bytes(write(tmp_path / "good.hdf5").read_bytes()[:600])
    os.mkfifo(tmp_path / "pipe.hdf5")
    names = [
        "scan.h5",
        "other.hdf5",
        "many.hdf5",
        "text.hdf5",
        "cut.hdf5",
        "pipe.hdf5",
        "",
        "missing",
        "a\0b",
        "x" * 5000,
    ]
    assert [Ipasc().can_read(tmp_path / name) for name in names] == [False] * len(names)
    assert Ipasc().can_read(tmp_path / "good.hdf5")
    assert oatkit.read(tmp_path / "scan.h5").reader == "oatkit-hdf5"
