"""Files that are damaged or mean harm: one sentence each, and nothing outside the scan is touched."""

import json
import os

import h5py
import numpy as np
import pytest

from msot_files import RING, equal, header, projections, write
from oatkit import hostile
from oatkit.builtin.readers.ithera import IThera
from oatkit.builtin.readers.oatkit_hdf5 import OatkitHdf5
from oatkit.errors import ReadError
from oatkit.hostile import inside, parse_xml, printable
from oatkit.scanfile import MARKER, read_truth, read_truths, write_scan
from test_reader_hdf5 import a_scan, a_truth

SECRET = "root:x:0:0"
DEEP = "<a>" * 100_000 + "</a>" * 100_000
DOCTYPE = '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
BILLION = "<!DOCTYPE x [<!ENTITY a 'ha'>" + "".join(
    f"<!ENTITY {b} '{10 * f'&{a};'}'>" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)


def one_sentence(error: pytest.ExceptionInfo) -> str:
    """The message, which has to fit into one line."""
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 700
    return text


def without_declaration(text: str) -> str:
    """A header without its first line."""
    return text.split("\n", 1)[1]


# Headers ------------------------------------------------------------------------------------------------------------

BROKEN_XML = {
    "empty": (b"", "error"),
    "text": (b"this is no header", "error"),
    "binary": (bytes(range(256)), "error"),
    "another format": (b"<svg/>", "DataModelMsotProject"),
    "deep nesting": (f"<DataModelMsotProject>{DEEP}</DataModelMsotProject>".encode(), "nested deeper"),
    "document type": (f"<!DOCTYPE x>{without_declaration(header())}".encode(), "document type"),
    "external entity": (f"{DOCTYPE}<DataModelMsotProject>&e;</DataModelMsotProject>".encode(), "document type"),
    "many entities": (f"{BILLION}]><DataModelMsotProject>&i;</DataModelMsotProject>".encode(), "document type"),
    "unknown encoding": (header().replace("utf-8", "klingon").encode(), "error"),
    "wrong encoding": (header().replace("hand-written", "\xe4").encode("latin-1"), "error"),
}


@pytest.mark.parametrize("content", BROKEN_XML)
def test_a_header_that_is_no_safe_xml_is_refused(tmp_path, content):
    """With one sentence that names the file."""
    broken, word = BROKEN_XML[content]
    with pytest.raises(ReadError, match=word) as error:
        IThera().read(write(tmp_path, broken))
    assert "Scan_1.msot" in one_sentence(error)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_header_cut_short_is_refused(tmp_path, share):
    """At any place."""
    text = header().encode()
    with pytest.raises(ReadError, match="expected complete XML"):
        IThera().read(write(tmp_path, text[: int(share * len(text))]))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_a_header_in_another_encoding_is_read(tmp_path, encoding):
    """As its first line declares it."""
    text = header().replace("hand-written", "M\xe4use").replace("utf-8", encoding.removesuffix("-sig"))
    assert IThera().read(write(tmp_path, text.encode(encoding))).name == "M\xe4use"


def test_limits_of_size_and_number_hold(tmp_path, monkeypatch):
    """A header larger, or of more elements, than the stated limits is refused."""
    msot = write(tmp_path, header())
    monkeypatch.setattr(hostile, "MAX_XML_ELEMENTS", 20)
    with pytest.raises(ReadError, match="more than 20 XML elements"):
        IThera().read(msot)
    with pytest.raises(ReadError, match="at most"):
        parse_xml(b" " * (hostile.MAX_XML_BYTES + 1), msot)
    with open(msot, "ab") as file:
        file.truncate(hostile.MAX_XML_BYTES + 1)
    with pytest.raises(ReadError, match=f"at most {hostile.MAX_XML_BYTES}"):
        IThera().read(msot)


REQUIRED = [
    "HARDWARE-DESC",
    "SAMPLING-FREQUENCY",
    "FRAME-DESC",
    "PROJECTION",
    "VALUE",
    "MEASUREMENT-DESC",
    "RECORDED-LENGTH",
    "WAVELENGTHS",
    "WAVELENGTH",
    "ScanNode",
    "ScanFrames",
    "DataModelScanFrame",
    "Frame",
    "IDOffset",
]


@pytest.mark.parametrize("name", REQUIRED)
def test_a_missing_element_is_named(tmp_path, name):
    """File and element stand in the sentence."""
    text = header().replace(f"<{name}>", "<Gone>").replace(f"<{name} ", "<Gone ").replace(f"</{name}>", "</Gone>")
    with pytest.raises(ReadError, match=name) as error:
        IThera().read(write(tmp_path, text))
    assert "Scan_1.msot" in one_sentence(error)


FIELDS = {
    "SAMPLING-FREQUENCY": ">40<",
    "RECORDED-LENGTH": ">8<",
    "WAVELENGTH": ">700<",
    "TrimSpeedOfSound": ">43<",
    "SPEED-OF-SOUND-BASE": ">-90<",
    "TEMPERATURE": ">30<",
    "POWER": ">100<",
    "Z-POS": ">10<",
    "IDOffset": ">1<",
    "VALUE": ">0.0<",
}
NO_NUMBERS = ["", " ", "nan", "inf", "-Infinity", "1e999", "four", "12,5", "1&#9;2"]


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("name", FIELDS)
def test_a_field_that_is_no_finite_number_is_named(tmp_path, name, value):
    """Empty, not a number, not finite: the sentence names the element and what was found."""
    old = FIELDS[name]
    text = header()
    assert old in text
    with pytest.raises(ReadError, match=name) as error:
        IThera().read(write(tmp_path, text.replace(old, f">{value}<")))
    one_sentence(error)


OUT_OF_RANGE = {
    "negative samples": ("<RECORDED-LENGTH>8", "<RECORDED-LENGTH>-8", "RECORDED-LENGTH"),
    "half a sample": ("<RECORDED-LENGTH>8", "<RECORDED-LENGTH>8.5", "RECORDED-LENGTH"),
    "endless records": ("<RECORDED-LENGTH>8", "<RECORDED-LENGTH>1e15", "RECORDED-LENGTH"),
    "negative offset": ("<IDOffset>1", "<IDOffset>-1", "IDOffset"),
    "endless offset": ("<IDOffset>1", "<IDOffset>1e18", "IDOffset"),
    "sampling in THz": ('"M">40', '"M">40e9', "sampling_rate_hz"),
    "unknown modifier": ('unit-modifier="M"', 'unit-modifier="Q"', "unit-modifier"),
    "wavelength in m": (">700<", ">700e-9<", "wavelengths_nm"),
    "no speed of sound": ("<TrimSpeedOfSound>43", "<TrimSpeedOfSound>-1400", "speed_of_sound_m_s"),
    "no axis": ('axis-ref="2"', 'axis-ref="4"', "axis-ref"),
    "bad timestamp": ('timestamp="6', 'timestamp="-6', "timestamp"),
    "volume": ("msot2", "msot3", "TRANSDUCER"),
}


@pytest.mark.parametrize("case", OUT_OF_RANGE)
def test_a_value_out_of_range_is_refused(tmp_path, case):
    """With a sentence that names the field or the quantity."""
    old, new, word = OUT_OF_RANGE[case]
    text = header()
    assert old in text
    with pytest.raises(ReadError, match=word) as error:
        IThera().read(write(tmp_path, text.replace(old, new)))
    one_sentence(error)


@pytest.mark.parametrize(
    "geometry",
    [
        projections([(x, y, 0.01 * i) for i, (x, y, _) in enumerate(RING)]),
        projections([(3.8e8, 0.0, 0.0), *RING]),
        equal(0.3, 0.0, 1.3, 0.04),
        equal(0.3, 1e-12, 1.3, 0.04),
        equal(0.3, -0.1, 1.3, 0.04),
        equal(17, 2, 287, 0.04),
        equal(0.3, 0.25, 1.3, 40.0),
        "<EQUAL><START>0</START></EQUAL>",
        "<EQUAL><START>0</START><STEP>1</STEP><END>1</END></EQUAL>",
    ],
    ids=["volume", "on the moon", "no step", "endless", "wrong way", "degrees", "radius in mm", "no end", "no radius"],
)
def test_an_impossible_geometry_is_refused(tmp_path, geometry):
    """Before anything of its declared size is made."""
    with pytest.raises(ReadError) as error:
        IThera().read(write(tmp_path, header(geometry=geometry)))
    assert "FRAME-DESC" in one_sentence(error) or "detector" in str(error.value)


# The files beside a header ------------------------------------------------------------------------------------------


def test_too_few_signals_are_refused_with_their_numbers(tmp_path):
    """The sentence gives the bytes expected and found."""
    msot = write(tmp_path, header())
    with open(msot.with_suffix(".bin"), "r+b") as file:
        file.truncate(159)
    with pytest.raises(ReadError, match=r"expected at least 160 bytes .* found 159"):
        IThera().read(msot)


def test_missing_signals_are_named(tmp_path):
    """And no other file of signals in the folder is taken instead."""
    msot = write(tmp_path, header())
    msot.with_suffix(".bin").rename(tmp_path / "Scan_2.bin")
    with pytest.raises(ReadError, match=r"Scan_1\.bin: there is no such file"):
        IThera().read(msot)


@pytest.mark.parametrize("suffix", [".bin", ".irf"])
def test_a_link_out_of_the_folder_is_refused(tmp_path, suffix):
    """A scan folder from elsewhere cannot point at the user's other files; a link inside it is fine."""
    folder = tmp_path / "scan"
    msot = write(folder, header())
    (tmp_path / "outside").write_bytes(bytes(160))
    msot.with_suffix(suffix).unlink(missing_ok=True)
    msot.with_suffix(suffix).symlink_to(tmp_path / "outside")
    with pytest.raises(ReadError, match="leads out of the folder"):
        IThera().read(msot)


def test_signals_that_are_no_file_are_refused(tmp_path):
    """A pipe in their place would block for ever."""
    msot = write(tmp_path, header())
    msot.with_suffix(".bin").unlink()
    os.mkfifo(msot.with_suffix(".bin"))
    with pytest.raises(ReadError, match="expected a file"):
        IThera().read(msot)


@pytest.mark.parametrize("content", [b"", b"1234567", bytes(56), bytes(64), np.full(8, np.nan).tobytes()])
def test_a_broken_impulse_response_is_refused(tmp_path, content):
    """Empty, cut, too short, all zero or not finite."""
    msot = write(tmp_path, header())
    msot.with_suffix(".irf").write_bytes(content)
    with pytest.raises(ReadError, match=r"Scan_1\.irf: expected") as error:
        IThera().read(msot)
    one_sentence(error)


@pytest.mark.parametrize("text", ["not base64!", "AAAA" * 20])
def test_a_broken_embedded_response_is_refused(tmp_path, text):
    """No base64, or not one number for each sample."""
    with pytest.raises(ReadError, match="ImpulseResponse>: expected"):
        IThera().read(
            write(
                tmp_path, header().replace("</ReconPreset>", f"</ReconPreset><ImpulseResponse>{text}</ImpulseResponse>")
            )
        )


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", "a/../../b", "a\0b", "", ".", "link", "loop"])
def test_names_that_lead_out_are_refused(tmp_path, name):
    """Up, absolute, with a NUL, through a link, round in a circle."""
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "link").symlink_to("/etc/passwd")
    (folder / "loop").symlink_to("loop")
    with pytest.raises(ReadError) as error:
        inside(folder, name)
    one_sentence(error)


def test_names_that_stay_inside_are_taken(tmp_path):
    """A plain name, a subfolder, a link to a neighbour, and dots that lead nowhere."""
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("file")
    for name in ("file", "sub/file", "link", "sub/../file", "..file"):
        assert inside(tmp_path, name) == tmp_path / name


def test_control_characters_do_not_reach_the_terminal(tmp_path):
    """A name with escape codes is shown without them."""
    assert printable("a\x1b[2Jb\nc\u202ed") == "a?[2Jb?c?d"
    scan = IThera().read(write(tmp_path, header().replace("hand-written", "a&#9;b&#x202e;c")))
    assert scan.name == "a?b?c"


@pytest.mark.parametrize("reader", [IThera(), OatkitHdf5()])
def test_can_read_never_raises(tmp_path, reader):
    """Whatever the path is, the answer is no."""
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "empty.h5").touch()
    names = ["pipe.h5", "loop", "empty.h5", "missing.msot", "a\0b", "x" * 5000, ""]
    assert [reader.can_read(tmp_path / name) for name in names] == [False] * len(names)


def test_a_header_that_is_no_file_is_refused(tmp_path):
    """Missing, a NUL in its name, a folder without a header."""
    for name in ("missing.msot", "a\0b.msot", ""):
        with pytest.raises(ReadError):
            IThera().read(tmp_path / name)


# HDF5 ---------------------------------------------------------------------------------------------------------------


@pytest.fixture
def scan_file(tmp_path):
    """A good scan file with a truth, to be spoiled."""
    write_scan(a_scan(), tmp_path / "scan.h5", a_truth())
    return tmp_path / "scan.h5"


def spoil(path, change):
    """Apply a change to the open file and keep its marker."""
    with h5py.File(path, "r+") as file:
        change(file)
    return path


def refused(path) -> str:
    """The sentence with which the reader refuses a file, be it when opening or when reading the signals."""
    with pytest.raises(ReadError) as error:
        OatkitHdf5().read(path).signals[...]
    assert path.name in one_sentence(error)
    return str(error.value)


def test_a_file_of_another_kind_is_refused(tmp_path):
    """Empty, a text, an HDF5 file that is not ours, one of a later version."""
    path = tmp_path / "scan.h5"
    for content in (b"", b"no scan", MARKER, MARKER + b"1\n" + bytes(1000)):
        path.write_bytes(content)
        assert "not a complete HDF5 file" in refused(path)
    with h5py.File(path, "w") as file:
        file["signals"] = np.zeros((1, 1, 1, 1))
    assert not OatkitHdf5().can_read(path)
    assert "expected a scan file that begins with" in refused(path)


def test_a_later_version_is_refused(scan_file):
    """With the version that is known and the one that was found."""
    with open(scan_file, "r+b") as file:
        file.write(MARKER + b"2\n")
    assert "expected version 1 of the scan file, found '2'" in refused(scan_file)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_file_cut_short_is_refused(scan_file, share):
    """At any place."""
    content = scan_file.read_bytes()
    scan_file.write_bytes(content[: int(share * len(content))])
    refused(scan_file)


@pytest.mark.parametrize("name", ["about", "signals", "detectors_m", "valid"])
def test_a_missing_dataset_is_named(scan_file, name):
    """And so is a group in its place."""
    assert name in refused(spoil(scan_file, lambda file: file.__delitem__(name)))
    assert name in refused(spoil(scan_file, lambda file: file.create_group(name)))


def external_link(file, name):
    """A link to a dataset of another file."""
    other = os.path.join(os.path.dirname(file.filename), "other.h5")
    with h5py.File(other, "w") as target:
        target["x"] = np.zeros((3, 2, 5, 40))
    file[name] = h5py.ExternalLink(other, "/x")


def dangling(file, name):
    """A soft link to nothing."""
    file[name] = h5py.SoftLink("/nowhere")


def cycle(file, name):
    """Soft links that point at each other."""
    file[name] = h5py.SoftLink("/round")
    file["round"] = h5py.SoftLink(f"/{name}")


def external_storage(file, name):
    """A dataset whose bytes are those of any file on the disk."""
    file.create_dataset(name, (3, 2, 5, 40), "u1", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])


def virtual(file, name):
    """A dataset made of another file's."""
    layout = h5py.VirtualLayout((3, 2, 5, 40), "f8")
    layout[...] = h5py.VirtualSource("/tmp/other.h5", "x", (3, 2, 5, 40))
    file.create_virtual_dataset(name, layout)


@pytest.mark.parametrize("way", [external_link, dangling, cycle])
@pytest.mark.parametrize("name", ["signals", "about", "pulse_energy", "truth"])
def test_links_are_refused(scan_file, way, name):
    """Wherever they stand, and wherever they lead."""

    def change(file):
        del file[name]
        way(file, name)

    spoil(scan_file, change)
    if name == "truth":
        with pytest.raises(ReadError, match="links are refused"):
            read_truth(scan_file)
    else:
        assert "links are refused" in refused(scan_file)


def forged(path, **changes):
    """Replace entries of the description of a scan file; `None` removes one."""
    with h5py.File(path, "r+") as file:
        about = json.loads(file["about"][0])
        about = {key: value for key, value in {**about, **changes}.items() if value is not None}
        del file["about"]
        file["about"] = np.array([json.dumps(about).encode()])
    return path


KNOWN = {"quantity": "so2", "unit": "", "pixel_size_m": 1e-4, "centre_m": [0, 0], "wavelengths_nm": []}
FORGED_TRUTHS = {
    "no table": (["so2"], "expected a table 'truth_images'"),
    "no dataset": ({"so2": KNOWN}, "found nothing"),
    "a group": ({"": KNOWN}, "expected a dataset"),
    "no description": ({"same": None}, "the description of a truth is unusable"),
    "no text": ({"same": {**KNOWN, "quantity": ["so2"]}}, "the description of a truth is unusable"),
    "no pixel": ({"same": {**KNOWN, "pixel_size_m": 0}}, "pixel_size_m"),
    "one quantity twice": ({"same": {**KNOWN, "quantity": "initial_pressure"}}, "one truth for each quantity"),
}


@pytest.mark.parametrize(("table", "sentence"), FORGED_TRUTHS.values(), ids=FORGED_TRUTHS)
def test_forged_truths_are_refused(scan_file, table, sentence):
    """In one sentence that says where, whatever the description promises."""
    with h5py.File(scan_file, "r+") as file:
        file.create_group("truth_images")["same"] = np.zeros((1, 3, 3))
    with pytest.raises(ReadError, match=sentence) as error:
        read_truths(forged(scan_file, truth_images=table))
    assert scan_file.name in one_sentence(error)


@pytest.mark.parametrize("way", [external_link, dangling, cycle])
def test_links_to_further_truths_are_refused(scan_file, way):
    """As they are everywhere else in the file."""
    with h5py.File(scan_file, "r+") as file:
        file.create_group("truth_images")
        way(file, "truth_images/so2")
    with pytest.raises(ReadError, match="links are refused"):
        read_truths(forged(scan_file, truth_images={"so2": KNOWN}))


def test_truths_are_limited_together(scan_file, monkeypatch):
    """Ten names of one dataset count as ten: a small file cannot fill the memory."""
    with h5py.File(scan_file, "r+") as file:
        group = file.create_group("truth_images")
        for number in range(10):
            group[f"q{number}"] = group["q0"] if number else np.zeros((1, 3, 3))
    table = {f"q{number}": {**KNOWN, "quantity": f"q{number}"} for number in range(10)}
    assert len(read_truths(forged(scan_file, truth_images=table))) == 11
    monkeypatch.setattr("oatkit.scanfile.MAX_ARRAY_BYTES", read_truth(scan_file).values.nbytes + 9 * 72)
    with pytest.raises(ReadError, match="q9"):
        read_truths(scan_file)


@pytest.mark.parametrize("way", [external_storage, virtual])
def test_data_in_other_files_are_refused(scan_file, way):
    """The user's other files are not read, whatever the file says."""

    def change(file):
        del file["signals"]
        way(file, "signals")

    assert "other files" in refused(spoil(scan_file, change))


SIZES = {
    "shape": ({"shape": (10**6, 10, 1024, 10**5), "dtype": "u2", "chunks": (1, 1, 8, 8)}, "declares"),
    "chunk": ({"shape": (1, 1, 5, 2**25), "dtype": "f8", "chunks": (1, 1, 1, 2**25)}, "a chunk of 268435456 bytes"),
    "never written": ({"shape": (3, 2, 5, 40), "dtype": "u2", "chunks": (1, 1, 5, 40)}, "the file holds 0"),
    "contiguous": ({"shape": (10**6, 10, 1024, 10**5), "dtype": "u2"}, "declares"),
    "axes": ({"data": np.zeros(7)}, "expected 4 axes"),
    "objects": ({"shape": (3, 2, 5, 40), "dtype": h5py.string_dtype()}, "expected a type"),
    "texts": ({"shape": (3, 2, 5, 40), "dtype": "S9"}, "expected a type"),
    "complex": ({"shape": (3, 2, 5, 40), "dtype": "c16"}, "expected a type"),
    "filter": ({"data": np.zeros((3, 2, 5, 40), "i4"), "scaleoffset": 3, "chunks": (1, 1, 5, 40)}, "filters"),
}


@pytest.mark.parametrize("case", SIZES)
def test_signals_of_impossible_size_or_type_are_refused(scan_file, case):
    """By what is declared, before anything is read."""
    options, word = SIZES[case]

    def change(file):
        del file["signals"]
        file.create_dataset("signals", **options)

    assert word in refused(spoil(scan_file, change))


@pytest.mark.parametrize("shape", [(3, 2, 5, 41), (3, 2, 4, 40), (3, 1, 5, 40), (2, 2, 5, 40), (3, 2, 0, 40)])
def test_signals_that_do_not_fit_the_rest_are_refused(scan_file, shape):
    """Frames, wavelengths, detectors; the number of samples is the signals' own, but not none."""

    def change(file):
        del file["signals"]
        file.create_dataset("signals", data=np.zeros(shape))

    spoil(scan_file, change)
    if shape == (3, 2, 5, 41):
        assert OatkitHdf5().read(scan_file).geometry.n_samples == 41
    else:
        refused(scan_file)


def test_masses_of_attributes_are_refused(scan_file):
    """More than the stated limit, without looking at them."""

    def change(file):
        for i in range(200):
            file["signals"].attrs[f"a{i}"] = i

    assert "200 attributes" in refused(spoil(scan_file, change))


ABOUT = {
    "no json": (b"{", "JSON"),
    "no utf-8": (b"\xff\xfe", "JSON"),
    "no object": (b"[]", "JSON object"),
    "deep": (b"[" * 100_000, "JSON"),
    "not a number": (b'{"sampling_rate_hz": NaN}', "NaN"),
    "infinite": (b'{"sampling_rate_hz": -Infinity}', "Infinity"),
    "nothing": (b"{}", "sampling_rate_hz"),
    "large": (b" " * (5 * 2**20) + b"{}", "declares"),
}


@pytest.mark.parametrize("case", ABOUT)
def test_an_unusable_description_is_refused(scan_file, case):
    """The sentence names what is wrong with the JSON."""
    content, word = ABOUT[case]

    def change(file):
        del file["about"]
        file["about"] = np.array([content])

    assert word in refused(spoil(scan_file, change))


@pytest.mark.parametrize(
    "key", ["sampling_rate_hz", "start_time_s", "speed_of_sound_m_s", "wavelengths_nm", "name", "notes"]
)
@pytest.mark.parametrize("value", ["null", '{"a": 1}', "-1e300", "[[[]]]"])
def test_a_description_of_the_wrong_type_is_refused(scan_file, key, value):
    """One sentence for every field and every wrong type, never another kind of error."""

    def change(file):
        about = json.loads(file["about"][0])
        about[key] = "HERE"
        text = json.dumps(about).replace('"HERE"', value)
        del file["about"]
        file["about"] = np.array([text.encode()])

    refused(spoil(scan_file, change))


def test_the_secret_is_a_real_one():
    """The file that the links above lead to can be read here, so that a refusal means something."""
    with open("/etc/passwd") as file:
        assert SECRET in file.read()
