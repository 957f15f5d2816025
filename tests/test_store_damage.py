"""Results on disk under attack: no changed bit goes unseen, no half result stands under a final name."""

import hashlib
import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from oatkit.errors import ResultError
from oatkit.store import load, verify
from results import make_result, write_frames


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    """A result folder of three frames, the second of which failed."""
    return write_frames(tmp_path / "out.zarr", make_result(0), "the light was off", make_result(2))


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _read_all(folder: Path) -> None:
    result = load(folder)
    for index in set(range(result.frames)) - result.failed.keys():
        result.frame(index)


def _flipped_bits(path: Path, count: int) -> Iterator[int]:
    """Flip one bit of a file at a time, in its first and last byte and at `count` seeded places; put all back after."""
    whole = path.read_bytes()
    rng = np.random.default_rng(len(whole))
    for position in {0, len(whole) - 1, *rng.integers(len(whole), size=count).tolist()}:
        damaged = bytearray(whole)
        damaged[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        yield position
    path.write_bytes(whole)


def _forge(folder: Path, where: str, value: Any) -> None:
    """Set one entry of the manifest, keys joined by ``>``, as somebody would who knows how it is sealed."""
    manifest = json.loads((folder / "manifest.json").read_bytes())["manifest"]
    *parents, last = where.split(">")
    part = manifest
    for key in parents:
        part = part[key]
    part[last] = value
    body = json.dumps(manifest)
    seal = hashlib.sha256(body.encode()).hexdigest()
    (folder / "manifest.json").write_text(f'{{"sha256": "{seal}",\n"manifest": {body}}}\n')


def test_a_flipped_bit_in_any_file_is_found(stored: Path) -> None:
    """One flipped bit anywhere in any file makes verify complain and reading fail, never return other numbers."""
    for path in _files(stored):
        for position in _flipped_bits(path, 12):
            assert verify(stored), f"{path.name}, byte {position}"
            with pytest.raises(ResultError):
                _read_all(stored)
    assert verify(stored) == []


def test_a_flipped_bit_is_found_by_any_zarr_reader(stored: Path) -> None:
    """Programs that know nothing of the manifest get an error or the right numbers from a damaged chunk."""
    path = stored / "initial_pressure/c/0/0/0/0"
    right = make_result(0)["initial_pressure"].values
    caught = 0
    for position in _flipped_bits(path, 40):
        try:
            values = zarr.open_group(stored, mode="r")["initial_pressure"][0]
        except Exception:
            caught += 1
        else:
            np.testing.assert_array_equal(values, right, err_msg=f"byte {position}")
    assert caught >= 40


def test_a_missing_or_foreign_file_is_found(stored: Path) -> None:
    """A deleted file is named by verify and stops the reader; a file or link that does not belong is named too."""
    for path in _files(stored):
        content = path.read_bytes()
        path.unlink()
        problems = verify(stored)
        assert len(problems) == 1
        assert path.name in problems[0]
        with pytest.raises(ResultError):
            _read_all(stored)
        path.write_bytes(content)
    (stored / "absorption" / "notes.txt").write_text("mine")
    (stored / "elsewhere").symlink_to("/")
    assert [problem.split("'")[1] for problem in verify(stored)] == ["absorption/notes.txt", "elsewhere"]


def test_a_link_in_place_of_a_file_is_refused(stored: Path, tmp_path: Path) -> None:
    """A chunk that was moved away and linked to is not followed, though its content is right."""
    chunk = stored / "absorption/c/0/0/0/0"
    shutil.move(chunk, tmp_path / "chunk")
    chunk.symlink_to(tmp_path / "chunk")
    assert len(verify(stored)) == 1
    with pytest.raises(ResultError, match="a link"):
        _read_all(stored)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_cut_manifest_is_found(stored: Path, share: float) -> None:
    """A manifest that ends early is damaged, wherever it ends."""
    path = stored / "manifest.json"
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    assert "damaged" in verify(stored)[0]
    with pytest.raises(ResultError, match="damaged"):
        load(stored)


@pytest.mark.parametrize(
    ("where", "value", "reason"),
    [
        ("images>../../escape", {}, "not a valid manifest: images"),
        ("images>absorption>grid>shape", [24, 31], "the manifest says"),
        ("images>absorption>grid>shape", [10**9, 10**9], "less than or equal to 100000"),
        ("images>absorption>grid>pixel_size_m", 12.5, "pixel_size_m: 12.5 is outside"),
        ("images>absorption>wavelengths_nm", [700.0], "the manifest says"),
        ("images>other", None, "not a valid manifest: images"),
        ("records>2>frame_index", "two", "not a valid manifest: records"),
        ("records>-1", None, "not a valid manifest: records"),
        ("frames", 4, "the manifest says"),
        ("version", 2, "format version 2 is newer than 1"),
        ("format", "something-else", "not a valid manifest: format"),
        ("novelty", True, "not a valid manifest: novelty"),
    ],
)
def test_a_forged_manifest_is_refused(stored: Path, where: str, value: Any, reason: str) -> None:
    """A sealed manifest that lies about names, shapes, frames or its version is found out, in a sentence."""
    _forge(stored, where, value)
    assert reason in "".join(verify(stored))
    with pytest.raises(ResultError, match=reason):
        load(stored)


def test_names_in_a_manifest_open_no_files(stored: Path) -> None:
    """A manifest that lists a file outside the folder has it reported as missing: the name is never opened."""
    _forge(stored, "files>../../../../etc/passwd", {"size": 1, "sha256": "0"})
    assert verify(stored) == [f"{stored}: '../../../../etc/passwd' is missing"]


def test_a_frame_that_was_never_written_is_found(stored: Path) -> None:
    """A folder whose manifest has a good frame where there are no chunks contradicts itself."""
    manifest = json.loads((stored / "manifest.json").read_bytes())["manifest"]
    _forge(stored, "records>1", manifest["records"]["0"])
    assert [problem.split("'")[1] for problem in verify(stored)] == [
        "absorption/c/1/0/0/0",
        "initial_pressure/c/1/0/0/0",
    ]


@pytest.mark.parametrize(
    ("limit", "size"),
    [("oatkit.store.manifest.LARGEST_MANIFEST", 1000), ("oatkit.store.folder.LARGEST_IMAGE", 2 * 24 * 30 * 4 - 1)],
)
def test_what_is_too_large_is_not_read(stored: Path, monkeypatch: pytest.MonkeyPatch, limit: str, size: int) -> None:
    """A manifest or an image above the stated limit in bytes is refused before it is read into memory."""
    monkeypatch.setattr(limit, size)
    with pytest.raises(ResultError, match="so it is not read"):
        load(stored)
    monkeypatch.setattr(limit, 20 * size)
    _read_all(stored)


def test_what_is_no_result_is_said_to_be_none(tmp_path: Path) -> None:
    """Loading a missing path, a file, an empty folder or a bare zarr group is one sentence; verify reports the same."""
    (tmp_path / "file.zarr").write_text("text")
    (tmp_path / "empty.zarr").mkdir()
    zarr.create_group(tmp_path / "bare.zarr")
    for name in ("missing", "file", "empty", "bare"):
        path = tmp_path / f"{name}.zarr"
        with pytest.raises(ResultError, match="no such result" if name == "missing" else "no oatkit result") as caught:
            load(path)
        assert verify(path) == [str(caught.value)]


WRITE_AND_WAIT = """
import sys, time
sys.path.insert(0, sys.argv[2])
from results import make_result
from oatkit.store import StoreWriter
with StoreWriter(sys.argv[1], frames=2) as writer:
    writer.write(0, make_result(0))
    print("written", flush=True)
    time.sleep(60)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
def test_a_killed_writer_leaves_nothing_under_the_final_name(tmp_path: Path) -> None:
    """After kill -9 in the middle of writing there is a hidden folder at most, and the next run succeeds."""
    output = tmp_path / "out.zarr"
    command = [sys.executable, "-c", WRITE_AND_WAIT, str(output), str(Path(__file__).parent)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stdout.readline() == "written\n"
        process.kill()
    assert not output.exists()
    left = sorted(path.name for path in tmp_path.iterdir())
    assert [name[: len(".out.zarr.partial-")] for name in left] == [".out.zarr.lock", ".out.zarr.partial-"]
    make_result().save(output)
    assert verify(output) == []


WRITE_WITH_A_LIMIT = """
import resource, sys
sys.path.insert(0, sys.argv[2])
from results import make_result
from oatkit.errors import ResultError
result = make_result(0)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
try:
    result.save(sys.argv[1])
except ResultError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on the size of files")
@pytest.mark.parametrize("limit", [4000, 1000])
def test_a_failing_disk_leaves_nothing(tmp_path: Path, limit: int) -> None:
    """Where the system refuses a write, of a chunk or of metadata, there is one sentence and no file at all."""
    command = [sys.executable, "-c", WRITE_WITH_A_LIMIT, str(tmp_path / "out.zarr"), str(Path(__file__).parent)]
    done = subprocess.run([*command, str(limit)], capture_output=True, text=True, check=True)
    assert "could not be written: File too large" in done.stdout
    assert list(tmp_path.iterdir()) == []
