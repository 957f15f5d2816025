"""Files of every kind, damaged or edited in one place: refused in a sentence, read as they were, or told apart.

`benchmarks/fuzz.py` does the same for longer.
"""

import contextlib
import io
import os
import re
import signal
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import oatkit
from fuzz_subjects import SUBJECTS, Subject
from msot_files import RING, header, projections, write
from mutations import mutate
from oatkit.builtin.readers.array_tables import read_description
from oatkit.hdf5_heaps import HEAP
from oatkit.pipeline import presets
from patato_files import write_patato

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from fuzz import Reader, fuzz

# Subjects of a kind that no reader has --------------------------------------------------------------------------------


def _write_text(folder: Path) -> None:
    (folder / "file").write_bytes(b"text")


def _crash(folder: Path) -> dict:
    if (folder / "file").read_bytes() != b"text":
        os.kill(os.getpid(), signal.SIGSEGV)
    return {}


def _hang(folder: Path) -> dict:
    if (folder / "file").read_bytes() != b"text":
        time.sleep(1000)
    return {}


def _foreign(folder: Path) -> dict:
    return {"number": [1][(folder / "file").read_bytes() != b"text"]}


def _memory(folder: Path) -> dict:
    whole = (folder / "file").read_bytes() == b"text"
    return {"sum": 0.0 if whole else float(np.ones(2**26).sum()) * 0}


def _control(folder: Path) -> dict:
    if (folder / "file").read_bytes() != b"text":
        raise oatkit.ReadError("a\x1b[2Jb")
    return {}


def _silent(folder: Path) -> dict:
    return {"bytes": (folder / "file").read_bytes()}


def _npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.zeros((3, 4)))
    return stream.getvalue()


BAD = {
    "crash": _crash, "hang": _hang, "foreign": _foreign, "memory": _memory, "unclear": _control, "silent": _silent,
}  # fmt: skip


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="peak memory is read from /proc")
@pytest.mark.parametrize("kind", BAD)
def test_the_harness_finds_what_may_not_happen(kind):
    """A reader that crashes, hangs, raises what is not ours, fills the memory or tells nothing is found."""
    subjects = {"bad": Subject(_write_text, BAD[kind], {"file": "binary"})}
    outcomes = list(fuzz(range(3), ["bad"], 0, subjects=subjects, processes=1, hang_seconds=2))
    assert [outcome.number for outcome in outcomes] == [0, 1, 2]
    assert {outcome.kind for outcome in outcomes} <= {kind, "equal"}
    assert any(outcome.kind == kind for outcome in outcomes)


@pytest.mark.parametrize("form", ["text", "binary", "xml", "npy"])
def test_mutations_come_again(form):
    """The same seed makes the same damage, and of ten seeds most make some."""
    contents = {
        "text": presets()["lsqr"].encode(),
        "binary": bytes(range(256)),
        "xml": header().encode(),
        "npy": _npy(),
    }
    content = contents[form]
    made = [mutate(content, form, np.random.default_rng(seed)) for seed in range(10)]
    assert made == [mutate(content, form, np.random.default_rng(seed)) for seed in range(10)]
    assert sum(changed != content for _, changed in made) >= 6


@pytest.mark.slow
def test_damaged_files_are_refused_or_told_apart():
    """Of 900 mutations in at most a minute none crashes, hangs, raises what is not ours, or passes a checksum."""
    outcomes = list(fuzz(range(900), list(SUBJECTS), seed=6, seconds=60))
    assert len(outcomes) > 200
    assert [outcome for outcome in outcomes if outcome.is_wrong] == []
    assert sum(outcome.kind == "refused" for outcome in outcomes) > len(outcomes) / 4


@pytest.mark.parametrize("name", ["result", "unfinished"])
def test_a_flipped_bit_in_a_result_or_a_diary_is_found_or_harmless(name, tmp_path):
    """Of 200 damages to a result none is read as other values; of 200 to an interrupted run none is in its end."""
    reader = Reader(name, SUBJECTS[name], tmp_path)
    for number in range(200):
        outcome = reader.outcome(number, np.random.default_rng([11, number]))
        assert outcome.kind in ("refused", "equal"), outcome


# What the fuzzing found ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("libver", ["earliest", "latest"])
@pytest.mark.parametrize("user_block", [0, 512])
@pytest.mark.parametrize("attributes", [3, 30])
@pytest.mark.timeout(30)
def test_a_lost_part_of_a_heap_of_texts_does_not_hang(tmp_path, libver, user_block, attributes):
    """The HDF5 library would follow zeros for ever, wherever the attributes of the object lie."""
    import h5py

    from oatkit.hostile import check_attribute_heaps, open_hdf5

    path = tmp_path / "file.h5"
    with h5py.File(path, "w", libver=libver, userblock_size=user_block) as file:
        file["item"] = 1.0
        for number in range(attributes):
            file["item"].attrs[f"a{number}"] = "text" * 9
    with open_hdf5(path) as file:
        check_attribute_heaps(file["item"])
    content = path.read_bytes()
    at = content.index(HEAP) + 60
    path.write_bytes(content[:at] + bytes(90) + content[at + 90 :])
    with pytest.raises(oatkit.ReadError, match="heap of texts"), open_hdf5(path) as file:
        check_attribute_heaps(file["item"])


@pytest.mark.timeout(30)
def test_a_patato_file_with_a_lost_heap_is_refused(tmp_path):
    """As its reader meets it: in the name of the scan."""
    path = write_patato(tmp_path / "scan.hdf5")
    content = path.read_bytes()
    at = content.index(HEAP) + 70
    path.write_bytes(content[:at] + bytes(200) + content[at + 200 :])
    with pytest.raises(oatkit.ReadError, match="heap of texts"):
        oatkit.read(path)


def test_detectors_that_were_lost_from_a_header_are_missed(tmp_path):
    """Their numbers run on; a file of signals that holds no whole number of records is noted, too."""
    short = projections().split("</PROJECTION>")
    gap = "</PROJECTION>".join([*short[:2], *short[3:]])
    with pytest.raises(oatkit.ReadError, match=r"PROJECTION\[3\]>: expected elements numbered one by one"):
        oatkit.read(write(tmp_path, header(geometry=gap)))
    assert "no whole number" in oatkit.read(write(tmp_path, header(geometry=projections(RING[:4])))).notes[-1]


def test_a_scan_file_misses_its_datasets(tmp_path):
    """An optional one that was there when it was written is missed; older files that name none are read."""
    import h5py

    from fuzz_subjects import own_scan
    from oatkit.scanfile import write_scan

    write_scan(own_scan(), tmp_path / "scan.h5")
    with h5py.File(tmp_path / "scan.h5", "r+") as file:
        del file["pulse_energy"]
    with pytest.raises(oatkit.ReadError, match="expected the dataset 'pulse_energy', found nothing"):
        oatkit.read(tmp_path / "scan.h5")


@pytest.mark.parametrize(
    "text", ["a" * 200_000, "wavelength_nm,a\n700," + "1" * 200_000, 'wavelength_nm,a\n"' + "1\n" * 99_999]
)
def test_an_endless_cell_of_a_table_is_refused(tmp_path, text):
    """Python's reader of CSV has a limit of its own, and an error of its own."""
    from oatkit.spectra.csv_table import spectra_at

    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(oatkit.ReadError):
        spectra_at(tmp_path / "table.csv", ["a"], [700.0])


# Texts of any kind --------------------------------------------------------------------------------------------------

KEYS = st.sampled_from(["version", "scan", "grid", "pixels", "reconstruct", "use", "weight", "a b", "", "é"])
VALUES = st.recursive(
    st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=8), st.sampled_from(["lsqr", "arc", "l1"])),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)
TABLES = st.dictionaries(KEYS, VALUES, max_size=6)


@settings(max_examples=150, deadline=None)
@given(table=TABLES)
def test_any_table_is_a_pipeline_or_refused(table):
    """Whatever stands in a pipeline file, it is a pipeline that comes back from its text, or a `ValidationError`."""
    base = tomllib.loads(presets()["lsqr"])
    for candidate in (table, {**base, **table}):
        try:
            pipeline = oatkit.Pipeline.of_table(candidate)
        except oatkit.ValidationError:
            continue
        assert oatkit.Pipeline.loads(pipeline.to_toml()) == pipeline


@settings(max_examples=100, deadline=None)
@given(text=st.text(max_size=60) | st.binary(max_size=60).map(lambda raw: raw.decode("latin-1")))
def test_any_text_is_a_pipeline_or_refused(text):
    """And so it is with any text, before or after a good one."""
    for whole in (text, presets()["lsqr"] + text, text + presets()["lsqr"]):
        with contextlib.suppress(oatkit.ValidationError):
            oatkit.Pipeline.loads(whole)


@settings(max_examples=60, deadline=None)
@given(content=st.binary(max_size=200))
def test_any_bytes_are_a_description_or_refused(content, tmp_path_factory):
    """Of plain arrays, or of regions."""
    from oatkit.regions import load_regions

    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_bytes(b"[signals]\n" + content)
    with pytest.raises(oatkit.ReadError):
        read_description(path)
    path.write_bytes(content)
    with pytest.raises((oatkit.ReadError, oatkit.ValidationError)):
        load_regions(path)


# SECURITY.md ---------------------------------------------------------------------------------------------------------


def test_a_pipeline_shows_nothing_of_a_file_that_is_no_table(tmp_path):
    """A path in it may lead to any file, whose content does not come out in the message."""
    (tmp_path / "secret").write_text("password,hunter2\nhunter3,4\n")
    for change in ("optics.table=secret", "optics.table=/etc/passwd"):
        name = change.split("=")[1]
        pipeline = oatkit.Pipeline.loads(presets()["lsqr-threshold-absorption"], folder=tmp_path, changes=[change])
        with pytest.raises(oatkit.ReadError) as caught:
            pipeline.optics.optics((700.0,))
        assert "expected the columns" in str(caught.value)
        assert not any(word in str(caught.value).split(name)[-1] for word in ("hunter", "password", "root:"))


def test_each_claim_of_the_security_page_has_its_test():
    """Every test that it names exists."""
    page = (Path(__file__).parents[1] / "SECURITY.md").read_text()
    named = set(re.findall(r"`(test_\w+)`", page))
    code = "".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    assert len(named) > 25
    assert [name for name in sorted(named) if f"def {name}(" not in code] == []
