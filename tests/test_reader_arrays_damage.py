"""Slips in the description of plain arrays, damaged and hostile files: refused, with what is wrong."""

import os
import struct

import h5py
import numpy as np
import pytest
import tifffile

from array_files import ARC, POSITIONS, describe, numbers, refuses, saved, write_mat, write_plain, write_scattered
from oatkit.builtin.readers.plain_array import PlainArray
from oatkit.errors import ReadError

# Descriptions with slips ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"sampling_rate_mhz": "40e6"}, ("[signals].sampling_rate_mhz", "at most 10000 MHz", "40000000")),
        ({"sampling_rate_mhz": "nan"}, ("[signals].sampling_rate_mhz", "nan")),
        ({"sampling_rate_mhz": "true"}, ("[signals].sampling_rate_mhz: must be a number",)),
        ({"sampling_rate_mhz": None}, ("[signals].sampling_rate_mhz: is missing",)),
        ({"sampling_rate": "40"}, ("has no parameter 'sampling_rate'; did you mean 'sampling_rate_mhz'?",)),
        ({"wavelengths_nm": "[7e-7, 8e-7]"}, ("[signals].wavelengths_nm", "at least 100 nm")),
        ({"wavelengths_nm": "[700]"}, ("axis 'wavelength' has length 2, by the description it is 1",)),
        ({"speed_of_sound_m_s": "1.5"}, ("[signals].speed_of_sound_m_s", "at least 300 m/s")),
        ({"start_time_us": "1e5"}, ("[signals].start_time_us", "at most 10000 us")),
        ({"axes": ["frame", "wavelenth", "detector", "sample"]}, ("[signals].axes: 'wavelenth' is no axis",)),
        ({"axes": ["frame", "frame", "detector", "sample"]}, ("[signals].axes: must name each axis",)),
        ({"axes": []}, ("[signals].axes: must name each axis",)),
        ({"axes": ["detector", "sample"]}, ("has 4 axes (4, 2, 5, 7), 'axes' names 2",)),
        (
            {"axes": ["frame", "wavelength", "sample", "detector"]},
            ("axis 'detector' has length 7, by the description it is 5", "axis 'sample' has that length"),
        ),
        ({"file": "scan.wav"}, ("expected signals in a file .npy, .tif or .tiff, found '.wav'",)),
        ({"file": "other.npy"}, ("other.npy: there is no such file",)),
        ({"rest": ""}, ("must have one of the tables [detectors] and [arc], got none",)),
        ({"rest": ARC.format(count=5) + POSITIONS.format(file="a")}, ("got both",)),
        ({"rest": ARC.format(count=5) + "[detector]"}, ("has no table 'detector'; did you mean 'detectors'?",)),
        ({"rest": ARC.format(count=4)}, ("axis 'detector' has length 5, by the description it is 4",)),
        ({"rest": ARC.format(count=5).replace("40.5", "0.0405")}, ("[arc].radius_mm", "at least 1 mm")),
        ({"rest": "[arc]\nradius_mm = [}"}, ("scan.toml: not valid TOML", "line 7")),
        ({"rest": "a = " + 3000 * "["}, ("scan.toml: not valid TOML",)),
    ],
)
def test_a_slip_in_the_description_is_named(tmp_path, keys, words):
    """The message says which key of which table, what was expected and what was meant; the file is still claimed."""
    toml = saved(tmp_path, **keys)
    assert PlainArray().can_read(toml)
    refuses(toml, str(tmp_path), *words)


def test_all_slips_are_named_at_once(tmp_path):
    """Four slips in three tables are four lines."""
    rest = "[arc]\nradius_mm = 0\ncoverage_degrees = 400\ncount = 5\n[pulses]\nenergy = 1\n"
    with pytest.raises(ReadError) as caught:
        PlainArray().read(saved(tmp_path, sampling_rate_mhz="'fast'", rest=rest))
    lines = str(caught.value).splitlines()
    assert len(lines) == 4
    for key in ("[signals].sampling_rate_mhz", "[arc].radius_mm", "[arc].coverage_degrees", "'energy'"):
        assert any(key in line for line in lines)


def test_a_newer_version_is_refused(tmp_path):
    """What a later format means is not guessed."""
    toml = saved(tmp_path)
    toml.write_text("version = 2\n" + toml.read_text())
    refuses(toml, "version: must be 1, got 2")


def test_pulses_of_another_shape_are_refused(tmp_path):
    """A number for each frame and wavelength, not for each frame."""
    np.save(tmp_path / "e.npy", np.ones(4))
    toml = saved(tmp_path, rest=ARC.format(count=5) + '[pulses]\npulse_energy = "e.npy"\n')
    refuses(toml, "e.npy: expected the shape (frame, wavelength) (4, 2), found (4,)")


# Damaged and hostile files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["../scan.npy", "/etc/passwd", "a\\u0000b.npy", ".", "", "sub/../../scan.npy", "out.npy"]
)
@pytest.mark.parametrize("key", ["signals", "detectors", "response", "pulses"])
def test_names_that_lead_out_of_the_folder_are_refused(tmp_path, name, key):
    """By parent folders, absolute paths, NUL bytes or symbolic links, in every key that names a file."""
    folder = tmp_path / "inside"
    toml = saved(folder)
    np.save(tmp_path / "scan.npy", numbers()[0])
    (folder / "out.npy").symlink_to(tmp_path / "scan.npy")
    rest = {
        "detectors": POSITIONS.format(file=name),
        "response": ARC.format(count=5) + f'[impulse_response]\nfile = "{name}"\n',
        "pulses": ARC.format(count=5) + f'[pulses]\npulse_energy = "{name}"\n',
    }
    toml = describe(folder, name) if key == "signals" else describe(folder, rest=rest[key])
    if key == "pulses" and not name:
        assert PlainArray().read(toml).pulse_energy is None
        return
    with pytest.raises(ReadError, match=r"leads out of the folder|is no file name"):
        PlainArray().read(toml)


def header(text: str, version=b"\x01\x00") -> bytes:
    """A .npy file with this header and 560 bytes of data."""
    size = len(text).to_bytes(2 if version == b"\x01\x00" else 4, "little")
    return b"\x93NUMPY" + version + size + text.encode() + bytes(560)


DICT = "{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "damaged header"),
        (b"some text, not an array", "damaged header"),
        (header("{'descr': '<u2'}"), "damaged header"),
        (header("(" * 5000), "damaged header"),
        (header(DICT.format(descr="'<u2'", shape="(4, 2, 5, 7)"), b"\x09\x00"), "damaged header"),
        (header(DICT.format(descr="'<u2'", shape="(4, 2, 5, 7)") + " " * 20_000), "damaged header"),
        (header(DICT.format(descr="'|O'", shape="(4, 2, 5, 7)")), "expected real numbers of at most 8 bytes"),
        (header(DICT.format(descr="'<c8'", shape="(4, 2, 5, 7)")), "expected real numbers of at most 8 bytes"),
        (header(DICT.format(descr="'|b1'", shape="(4, 2, 5, 7)")), "expected real numbers of at most 8 bytes"),
        (header(DICT.format(descr="'<f16'", shape="(4, 2, 5, 7)")), "expected real numbers of at most 8 bytes"),
        (header(DICT.format(descr="[('a', '<u2')]", shape="(4, 2, 5, 7)")), "expected real numbers of at most 8 bytes"),
        (header(DICT.format(descr="'<u2'", shape="(4, 2, 5, 10**6)")), "damaged header"),
        (header(DICT.format(descr="'<u2'", shape=f"(4, 2, 5, {10**18})")), "the file holds 560"),
        (header(DICT.format(descr="'<u2'", shape=f"({2**32}, {2**32}, 5, 7)")), "the file holds 560"),
        (header(DICT.format(descr="'<u2'", shape="(4, 2, 5, 6)")), "declares 480 bytes (shape (4, 2, 5, 6), uint16)"),
        (header(DICT.format(descr="'<u2'", shape="(4, 2, 5, 0)")), "none of them empty"),
        (header(DICT.format(descr="'<u2'", shape="(-4, -2, 5, 7)")), "none of them empty"),
        (header(DICT.format(descr="'<u2'", shape="()")), "one axis or more"),
    ],
)  # fmt: skip
def test_a_damaged_npy_file_is_refused(tmp_path, content, words):
    """Whatever its header says, nothing is unpickled, allocated or mapped before it fits the file."""
    toml = describe(tmp_path)
    (tmp_path / "scan.npy").write_bytes(content)
    refuses(toml, str(tmp_path / "scan.npy"), words)


@pytest.mark.parametrize("suffix", ["npy", "tif"])
@pytest.mark.parametrize("part", [0, 0.1, 0.5, 0.9])
def test_a_cut_file_is_refused(tmp_path, suffix, part):
    """At any length short of the whole."""
    stored, _ = numbers()
    np.save(tmp_path / "whole.npy", stored)
    write_scattered(tmp_path / "whole.tif", stored)
    content = (tmp_path / f"whole.{suffix}").read_bytes()
    (tmp_path / f"scan.{suffix}").write_bytes(content[: int(part * len(content))])
    refuses(describe(tmp_path, f"scan.{suffix}"), f"scan.{suffix}")


def test_a_device_is_no_file_of_signals(tmp_path):
    """A folder, or a pipe that would block for ever, in place of the signals."""
    os.mkfifo(tmp_path / "scan.npy")
    (tmp_path / "scan.tif").mkdir()
    for file in ("scan.npy", "scan.tif"):
        refuses(describe(tmp_path, file), "expected a file, found a folder or a device")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"compression": "zlib"}, "page 0: expected no compression, found ADOBE_DEFLATE; save it without"),
        ({"tile": (16, 16)}, "in one block"),
    ],
)
def test_a_tiff_that_cannot_be_mapped_is_refused(tmp_path, options, words):
    """Compression and tiles, with what to do."""
    tifffile.imwrite(tmp_path / "scan.tif", numbers()[0], photometric="minisblack", **options)
    refuses(describe(tmp_path, "scan.tif"), words)


def test_a_tiff_of_unlike_pages_is_refused(tmp_path):
    """A thumbnail among the pages is no signal."""
    with tifffile.TiffWriter(tmp_path / "scan.tif") as file:
        for shape in ((5, 7), (2, 3)):
            file.write(np.zeros(shape, "u2"))
    refuses(describe(tmp_path, "scan.tif"), "expected pages of one shape and type, found 2 kinds")


@pytest.mark.parametrize("axes", [("wavelength", "detector", "sample"), ("detector", "sample"), ("sample",)])
def test_a_number_of_pages_that_does_not_fit_is_refused(tmp_path, axes):
    """Eight pages are not two wavelengths, nor one page, and a page has two axes."""
    write_plain(tmp_path / "scan.tif", numbers()[0])
    refuses(
        describe(tmp_path, "scan.tif", axes, wavelengths_nm="[700, 730]"),
        "scan.tif: ",
        "axes" if len(axes) == 1 else "found 8 pages",
    )


def test_an_ome_tiff_reads_no_other_file(tmp_path):
    """Its XML may name files as its pages; only its own pages are read."""
    write_plain(tmp_path / "other.tif", np.full((8, 5, 7), 9, "u2"))
    stored, whole = numbers()
    xml = (
        '<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06"><Image ID="Image:0"><Pixels ID="Pixels:0" '
        'DimensionOrder="XYZCT" Type="uint16" SizeX="7" SizeY="5" SizeZ="8" SizeC="1" SizeT="1"><TiffData IFD="0">'
        '<UUID FileName="other.tif">urn:uuid:0</UUID></TiffData></Pixels></Image></OME>'
    )
    tifffile.imwrite(
        tmp_path / "scan.ome.tif", stored, photometric="minisblack", description=xml, metadata=None, ome=False
    )
    assert np.array_equal(PlainArray().read(describe(tmp_path, "scan.ome.tif")).signals[...], whole)


def links_of(content: bytes) -> list[int]:
    """Where a little-endian TIFF holds the offset of each page after the first, and the zero that ends them."""
    (page,) = struct.unpack_from("<I", content, 4)
    links = []
    while page:
        (n_tags,) = struct.unpack_from("<H", content, page)
        links.append(page + 2 + 12 * n_tags)
        (page,) = struct.unpack_from("<I", content, links[-1])
    return links


@pytest.mark.parametrize(("where", "to"), [(-1, 8), (3, 8), (3, 10**9), (3, 2**32 - 1), (0, 3)])
def test_a_broken_chain_of_pages_is_refused(tmp_path, where, to):
    """One that leads in a circle, out of the file or into other bytes: not an endless loop, and not fewer frames."""
    write_plain(tmp_path / "scan.tif", numbers()[0])
    toml, content = describe(tmp_path, "scan.tif"), bytearray((tmp_path / "scan.tif").read_bytes())
    assert PlainArray().read(toml).frames == 4
    struct.pack_into("<I", content, links_of(content)[where], to)
    (tmp_path / "scan.tif").write_bytes(content)
    refuses(toml, "scan.tif: ", "damaged" if to != 3 else "pages")


@pytest.mark.parametrize("suffix", ["npy", "tif"])
def test_flipped_bytes_are_refused_or_harmless(tmp_path, suffix):
    """A damaged header is a `ReadError`, or still describes signals of the right shape that lie in the file."""
    stored, whole = numbers()
    toml = saved(tmp_path, file=f"scan.{suffix}")
    write_scattered(tmp_path / "scan.tif", stored)
    path = tmp_path / f"scan.{suffix}"
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(300):
        damaged = bytearray(content)
        damaged[rng.integers(min(len(content), 420))] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        try:
            scan = PlainArray().read(toml)
        except ReadError:
            refused += 1
        else:
            assert scan.signals[...].shape[:3] == whole.shape[:3]
    assert refused > 30


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("p.mat", b"MATLAB 5.0 MAT-file, written by", "expected a MATLAB file of version 7.3, found an older one"),
        ("p.mat", b"text", "not a complete HDF5 file"),
        ("p.csv", b"x,y\n1,2\n", "line 1: expected numbers between commas, found 'x,y'; a line of names"),
        ("p.csv", b"1,2\n1,2,3\n", "expected rows of one length, found lengths [2, 3]"),
        ("p.csv", b"", "expected rows of one length"),
        ("p.csv", b"\xff\xfe", "expected text"),
        ("p.csv", b"1,nan\n" * 5, "expected finite numbers, found 5"),
        ("p.txt", b"1,2\n", "expected a file .npy, .csv or .mat, found '.txt'"),
        ("p.npy", b"\x93NUMPY", "damaged header"),
    ],
)
def test_a_damaged_file_of_positions_is_refused(tmp_path, name, content, words):
    """In any of the formats, with the line where there is one."""
    (tmp_path / name).write_bytes(content)
    refuses(saved(tmp_path, rest=POSITIONS.format(file=name)), str(tmp_path / name), words)


def test_a_matlab_file_reads_no_other_file(tmp_path):
    """External links are refused, and the missing array is named."""
    write_mat(tmp_path / "secret.mat", transducerPos=np.ones((3, 5)))
    with h5py.File(tmp_path / "p.mat", "w") as file:
        file["transducerPos"] = h5py.ExternalLink(str(tmp_path / "secret.mat"), "transducerPos")
    refuses(saved(tmp_path, rest=POSITIONS.format(file="p.mat")), "'transducerPos': links are refused")
    rest = POSITIONS.format(file="secret.mat") + 'dataset = "positions"\n'
    refuses(saved(tmp_path, rest=rest), "'positions': expected a dataset, found nothing")


def test_a_large_file_in_place_of_a_small_array_is_refused(tmp_path):
    """More than 16 MiB of positions are not read."""
    np.lib.format.open_memmap(tmp_path / "p.npy", "w+", "f8", (2**20, 3)).flush()
    refuses(saved(tmp_path, rest=POSITIONS.format(file="p.npy")), "declares 25165824 bytes; at most 16777216 are read")
