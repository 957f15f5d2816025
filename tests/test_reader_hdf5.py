"""The scan file of oatkit: what is written comes back, lazily, or not at all."""

import os
import pickle
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from oatkit.builtin.readers.oatkit_hdf5 import OatkitHdf5
from oatkit.data import Detectors, Geometry, Grid, Image, Scan
from oatkit.errors import ReadError, ResultError, ValidationError
from oatkit.scanfile import read_truth, read_truths, write_scan

RNG_SEED = 3


def a_scan(dtype="u2", frames=3) -> Scan:
    """A scan of two wavelengths, five detectors and 40 samples that uses every field."""
    rng = np.random.default_rng(RNG_SEED)
    geometry = Geometry(Detectors(rng.uniform(-0.04, 0.04, (5, 2))), 40e6, 40, 1.1e-6, 1483.7, rng.standard_normal(7))
    table = [rng.uniform(1, 2, (frames, 2)) for _ in range(4)]
    return Scan(
        (1000 * rng.uniform(0, 60, (frames, 2, 5, 40))).astype(dtype),
        geometry,
        (700.0, 813.5),
        rng.random((frames, 2, 5)) > 0.3,
        *table,
        name="µ-phantom",
        source="simulated",
        reader="test",
        speed_of_sound_source="by hand",
        notes=("first", "second"),
    )


def a_truth(dtype="f4") -> Image:
    """An image of two wavelengths, off centre."""
    values = np.random.default_rng(RNG_SEED).random((2, 6, 7)).astype(dtype)
    return Image(values, "initial_pressure", "Pa", Grid((6, 7), 1e-4, (1e-3, -2e-3)), (700, 813.5))


def texts(scan: Scan) -> tuple:
    """What a scan says of itself beside its data, but where it lies and who read it."""
    return scan.name, scan.speed_of_sound_source, scan.notes


def in_memory(scan: Scan) -> Scan:
    """The same scan with its signals read."""
    return replace(scan, signals=scan.signals[...])


@pytest.mark.parametrize("dtype", ["u2", "i2", ">i4", "u1", "f4", "f8"])
def test_a_scan_comes_back_as_it_was(tmp_path, dtype):
    """Every field, bit for bit; only source, reader and a note tell of the file."""
    scan, path = a_scan(dtype), tmp_path / "scan.h5"
    write_scan(scan, path)
    back = in_memory(OatkitHdf5().read(path))
    assert back.signals.dtype == scan.signals.dtype.newbyteorder("<")
    assert (back.source, back.reader) == (str(path), "oatkit-hdf5")
    notes = (*scan.notes, "The file was written from: simulated by test.")
    assert texts(back) == (scan.name, scan.speed_of_sound_source, notes)
    assert back == replace(scan, signals=scan.signals.astype(back.signals.dtype))


def test_optional_fields_stay_absent(tmp_path):
    """None comes back as None, and there is no truth where none was written."""
    bare = Scan(a_scan().signals, replace(a_scan().geometry, impulse_response=None), (700, 800))
    write_scan(bare, tmp_path / "scan.h5")
    back = in_memory(OatkitHdf5().read(tmp_path / "scan.h5"))
    assert back == bare
    assert texts(back) == ("", "default", ())
    assert read_truth(tmp_path / "scan.h5") is None


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_the_truth_comes_back_as_it_was(tmp_path, dtype):
    """The image that a scan was simulated from, with its grid and wavelengths."""
    write_scan(a_scan(), tmp_path / "scan.h5", a_truth(dtype))
    assert read_truth(tmp_path / "scan.h5") == a_truth(dtype)


def test_several_truths_come_back_by_quantity(tmp_path):
    """Each as it was, pixels without a value too, on a grid of its own; the first is what the scan was made from."""
    grid = Grid((4, 5), 2e-4)
    so2 = Image(np.where(np.eye(4, 5) > 0, np.nan, 0.5), "so2", "", grid)
    total = Image(np.full((4, 5), 1.25), "total_haemoglobin", "mol/m^3", grid)
    write_scan(a_scan(), tmp_path / "scan.h5", [a_truth(), so2, total])
    found = read_truths(tmp_path / "scan.h5")
    assert list(found) == ["initial_pressure", "so2", "total_haemoglobin"]
    assert list(found.values()) == [a_truth(), so2, total]
    assert read_truth(tmp_path / "scan.h5") == a_truth()


def test_a_file_with_one_truth_or_none_has_as_many(tmp_path):
    """`read_truths` reads what a file holds that was written before there could be several."""
    write_scan(a_scan(), tmp_path / "one.h5", a_truth())
    write_scan(a_scan(), tmp_path / "none.h5")
    with h5py.File(tmp_path / "one.h5") as file:
        assert "truth_images" not in file
        assert b"truth_images" not in file["about"][0]
    assert read_truths(tmp_path / "one.h5") == {"initial_pressure": a_truth()}
    assert read_truths(tmp_path / "none.h5") == {}


@pytest.mark.parametrize("quantity", ["initial_pressure", "a/b", ""])
def test_a_truth_needs_a_name_of_its_own(tmp_path, quantity):
    """Two of one quantity, or one that is no name of a dataset, are refused, and no file is left."""
    with pytest.raises(ValidationError, match="one image for each quantity"):
        write_scan(a_scan(), tmp_path / "scan.h5", [a_truth(), replace(a_truth(), quantity=quantity)])
    assert not list(tmp_path.iterdir())


def test_a_real_scan_survives_the_copy(mouse_scan, tmp_path):
    """From the iThera file to ours, lazily on both sides, and nothing is lost."""
    from oatkit.builtin.readers.ithera import IThera

    scan = IThera().read(mouse_scan)
    write_scan(scan, tmp_path / "scan.h5")
    back = OatkitHdf5().read(tmp_path / "scan.h5")
    assert in_memory(back) == in_memory(scan)
    assert texts(back)[:2] == texts(scan)[:2]
    assert back.notes[:-1] == scan.notes


def test_signals_are_lazy_and_pickle_as_their_path(tmp_path):
    """They index as h5py does, pickle small, and are equal to their copy."""
    write_scan(a_scan(frames=50), tmp_path / "scan.h5")
    signals = OatkitHdf5().read(tmp_path / "scan.h5").signals
    packed = pickle.dumps(signals)
    assert not isinstance(signals, np.ndarray)
    assert len(packed) < 1000
    assert pickle.loads(packed) == signals
    assert np.array_equal(pickle.loads(packed)[7:9, 1], a_scan(frames=50).signals[7:9, 1])


def test_a_moved_file_is_the_same_scan(tmp_path):
    """Fingerprints come from the content alone: not from the path nor from the time of the file."""
    write_scan(a_scan(), tmp_path / "scan.h5")
    before = OatkitHdf5().read(tmp_path / "scan.h5")
    (tmp_path / "elsewhere").mkdir()
    moved = (tmp_path / "scan.h5").rename(tmp_path / "elsewhere" / "renamed.h5")
    os.utime(moved, (0, 0))
    after = OatkitHdf5().read(moved)
    assert after.signals == before.signals
    assert after.fingerprint == before.fingerprint
    write_scan(a_scan("i2"), tmp_path / "scan.h5")
    assert OatkitHdf5().read(tmp_path / "scan.h5").fingerprint != before.fingerprint


def test_one_pulse_is_one_chunk(tmp_path):
    """Reading a frame touches no other frame's bytes."""
    write_scan(a_scan(), tmp_path / "scan.h5")
    with h5py.File(tmp_path / "scan.h5") as file:
        assert file["signals"].chunks == (1, 1, 5, 40)
        assert all(file[name].fletcher32 for name in file)


def test_a_replaced_file_is_noticed(tmp_path):
    """Signals of a file that changed under the scan are an error, not other numbers."""
    write_scan(a_scan(), tmp_path / "scan.h5")
    scan = OatkitHdf5().read(tmp_path / "scan.h5")
    write_scan(a_scan("i2"), tmp_path / "scan.h5", overwrite=True)
    with pytest.raises(ReadError, match="has changed"):
        scan.signals[0]


def test_no_flipped_bit_goes_unseen(tmp_path):
    """Of 600 files with one wrong bit, each reads as before or not at all; most do not."""
    path, broken = tmp_path / "scan.h5", tmp_path / "broken.h5"
    write_scan(a_scan(), path, a_truth())
    content, rng = path.read_bytes(), np.random.default_rng(RNG_SEED)

    def everything(path: Path):
        scan = in_memory(OatkitHdf5().read(path))
        return scan, texts(scan), read_truth(path)

    right, refused = everything(path), 0
    for _ in range(600):
        damaged = bytearray(content)
        damaged[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        broken.write_bytes(damaged)
        try:
            assert everything(broken) == right
        except ReadError:
            refused += 1
    assert refused > 300


def test_an_existing_file_is_kept(tmp_path):
    """It is replaced only where that is asked for."""
    path = tmp_path / "scan.h5"
    write_scan(a_scan(), path)
    before = path.read_bytes()
    with pytest.raises(ResultError, match="exists already"):
        write_scan(a_scan("f4"), path)
    assert path.read_bytes() == before
    write_scan(a_scan("f4"), path, overwrite=True)
    assert OatkitHdf5().read(path).signals.dtype == "f4"


def test_a_scan_is_not_written_over_its_own_signals(tmp_path):
    """A lazy scan reads from the file that it would replace."""
    path = tmp_path / "scan.h5"
    write_scan(a_scan(), path)
    with pytest.raises(ResultError, match="is the input"):
        write_scan(OatkitHdf5().read(path), path, overwrite=True)


def test_a_failed_write_leaves_nothing(tmp_path, monkeypatch):
    """No half file under the final name nor beside it, and an old file stays as it was."""
    path = tmp_path / "scan.h5"
    write_scan(a_scan(), path)
    before = path.read_bytes()

    def broken(source, target):
        raise OSError("the disk is gone")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(ResultError, match="the disk is gone"):
        write_scan(a_scan("f4"), path, overwrite=True)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_seen_before_writing(tmp_path, monkeypatch):
    """The library would crash on it."""
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 1000}))
    with pytest.raises(ResultError, match="free"):
        write_scan(a_scan(), tmp_path / "scan.h5")
    assert list(tmp_path.iterdir()) == []


def test_long_records_are_split_into_chunks_that_can_be_read(tmp_path):
    """A pulse of more than the reader's limit for a chunk is written in several."""
    geometry = Geometry(Detectors(np.full((20, 2), 0.04)), 40e6, 1_000_000)
    write_scan(Scan(np.ones((1, 1, 20, 1_000_000), "f4"), geometry, (700,)), tmp_path / "scan.h5")
    assert OatkitHdf5().read(tmp_path / "scan.h5").signals[0, 0, 19, -1] == 1


def test_a_record_too_long_for_any_chunk_is_refused(tmp_path):
    """Rather than writing what cannot be read."""
    geometry = Geometry(Detectors(np.zeros((1, 2))), 40e6, 9_000_000)
    with pytest.raises(ValidationError, match="rows of up to"):
        write_scan(Scan(np.ones((1, 1, 1, 9_000_000)), geometry, (700,)), tmp_path / "scan.h5")
    assert list(tmp_path.iterdir()) == []
