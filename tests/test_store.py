"""Results on disk: nothing is lost, and nothing is written where it should not be."""

import gc
import math
import os
import pickle
import shutil
import weakref
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

from oatkit.data import Image
from oatkit.errors import ResultError, ValidationError
from oatkit.store import StoreWriter, load, verify
from results import GRID, WAVELENGTHS_NM, absorption, make_result, pressure, write_frames

PROVENANCE = ("pipeline", "requested", "versions", "scan", "seconds", "warnings", "frame_index", "weight_choice")


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    """A result folder of three frames, the second of which failed."""
    with StoreWriter(tmp_path / "out.zarr", frames=3) as writer:
        writer.write(2, make_result(2))
        writer.fail(1, "the light was off")
        writer.write(0, make_result(0))
    return tmp_path / "out.zarr"


def _same_bits(one: Image, other: Image) -> bool:
    return one.values.dtype == other.values.dtype and one.values.tobytes() == other.values.tobytes()


def test_a_result_comes_back_bit_equal_with_all_its_provenance(tmp_path: Path) -> None:
    """What is saved is what is loaded: every bit of every image, NaN included, and every field of the provenance."""
    result = make_result(5)
    result.save(tmp_path / "out.zarr")
    back = load(tmp_path / "out.zarr")
    assert list(back) == list(result)
    for name, image in result.items():
        assert _same_bits(back[name], image)
        assert back[name] == image  # grid, unit, wavelengths, history and diagnostics
    assert [dict(step) for step in back["initial_pressure"].history] == [dict(s) for s in pressure().history]
    for field in PROVENANCE:
        assert getattr(back, field) == getattr(result, field), field
    assert back == result
    assert verify(tmp_path / "out.zarr") == []


def test_text_that_looks_like_a_number_stays_text(tmp_path: Path) -> None:
    """A scan named "nan" and a setting named "$float" come back as they were, the number nan equal to itself."""
    scan = {
        "name": "nan",
        "notes": ("-inf", "$float"),
        "settings": {"$float": "inf"},
        "worst": float("inf"),
        "mean": math.nan,
    }
    make_result(scan=scan).save(tmp_path / "out.zarr")
    assert load(tmp_path / "out.zarr").scan == scan


def test_frames_are_counted_within_the_result_and_read_alone(stored: Path) -> None:
    """`frame(i)` is the i-th frame of the folder, whatever the order of writing, and knows its frame of the scan."""
    result = load(stored)
    assert result.frames == 3
    assert result.frame(2).frame_index == 2
    assert _same_bits(result.frame(2)["initial_pressure"], pressure(2))
    (stored / "initial_pressure/c/2/0/0/0").unlink()
    assert _same_bits(load(stored).frame(0)["initial_pressure"], pressure(0))
    with pytest.raises(ValidationError, match=r"frame 3: the result has frames 0 \.\. 2"):
        result.frame(3)


def test_a_failed_frame_says_why(stored: Path) -> None:
    """A frame that failed has no image but a reason, and other zarr readers see NaN there."""
    result = load(stored)
    assert result.failed == {1: "the light was off"}
    with pytest.raises(ResultError, match="frame 1 failed: the light was off"):
        result.frame(1)
    assert np.isnan(zarr.open_group(stored, mode="r")["initial_pressure"][1]).all()


def test_a_result_whose_first_frame_failed_still_opens(tmp_path: Path) -> None:
    """It shows the first frame that has images; frame 0 says why it has none, and a copy keeps all of that."""
    load(write_frames(tmp_path / "out.zarr", "no light", make_result(5), make_result(6))).save(tmp_path / "copy.zarr")
    for name in ("out.zarr", "copy.zarr"):
        result = load(tmp_path / name)
        assert result == result.frame(1) == make_result(5)
        assert (result.frame_index, result.frames, result.failed) == (5, 3, {0: "no light"})
        with pytest.raises(ResultError, match="frame 0 failed: no light"):
            result.frame(0)


def test_a_loaded_result_can_be_saved_again_and_pickled(stored: Path, tmp_path: Path) -> None:
    """A copy of a stored result has the same frames and failures; pickles of results, stored or not, are equal."""
    result = load(stored)
    result.save(tmp_path / "copy.zarr")
    copy = load(tmp_path / "copy.zarr")
    assert (copy.frames, copy.failed) == (3, {1: "the light was off"})
    assert copy.frame(2) == result.frame(2)
    for either in (result, make_result(0)):
        assert pickle.loads(pickle.dumps(either)) == either


def test_an_unknown_image_names_the_nearest(stored: Path) -> None:
    """Asking for an image that is not there is a KeyError that helps, in memory and on disk."""
    for result in (make_result(), load(stored)):
        with pytest.raises(KeyError, match="did you mean 'initial_pressure'"):
            result["initial_presure"]


def test_it_is_an_ome_zarr_image(stored: Path) -> None:
    """Plain zarr finds OME-Zarr 0.5 metadata with axes, pixel size and position in micrometres for each image."""
    group = zarr.open_group(stored, mode="r")
    ome = group.attrs["ome"]
    assert ome["version"] == "0.5"
    assert [scale["name"] for scale in ome["multiscales"]] == ["initial_pressure", "absorption"]
    for multiscale in ome["multiscales"]:
        assert [axis["name"] for axis in multiscale["axes"]] == ["t", "c", "y", "x"]
        assert [axis["type"] for axis in multiscale["axes"]] == ["time", "channel", "space", "space"]
        assert {axis.get("unit") for axis in multiscale["axes"][2:]} == {"micrometer"}
        scale, translation = multiscale["datasets"][0]["coordinateTransformations"]
        array = group[multiscale["datasets"][0]["path"]]
        assert array.shape == (3, 2, *GRID.shape)
        assert array.metadata.dimension_names == ("t", "c", "y", "x")
        last = np.array(scale["scale"]) * (np.array(array.shape) - 1) + translation["translation"]
        np.testing.assert_allclose(last[2:], [1e6 * GRID.y_m[-1], 1e6 * GRID.x_m[-1]], rtol=1e-12)
        assert array.attrs["wavelengths_nm"] == list(WAVELENGTHS_NM)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError()])
def test_an_interrupted_writer_cleans_up(tmp_path: Path, error: BaseException) -> None:
    """An exception, Ctrl-C too, leaves neither a result nor anything hidden."""
    with pytest.raises(type(error)):
        write_frames(tmp_path / "out.zarr", make_result(), error)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_output_is_kept(stored: Path) -> None:
    """A result is not overwritten unless asked for, and stays until the new one is complete."""
    with pytest.raises(ResultError, match="exists already"):
        make_result(7).save(stored)
    with pytest.raises(KeyboardInterrupt):
        write_frames(stored, make_result(7), KeyboardInterrupt(), overwrite=True)
    assert load(stored).frames == 3
    make_result(7).save(stored, overwrite=True)
    assert load(stored).frame_index == 7
    assert verify(stored) == []
    assert list(stored.parent.iterdir()) == [stored]


def test_an_output_that_appears_meanwhile_is_kept(tmp_path: Path) -> None:
    """What somebody else puts at the output while it is written stays, and the run says so."""
    late = StoreWriter(tmp_path / "out.zarr").__enter__()
    late.write(0, make_result(2))
    make_result(1).save(tmp_path / "other.zarr")
    (tmp_path / "other.zarr").rename(late.path)
    with pytest.raises(ResultError, match="exists already"):
        late.__exit__(None, None, None)
    assert load(tmp_path / "out.zarr").frame_index == 1
    assert len(list(tmp_path.iterdir())) == 1


def test_only_results_are_overwritten(tmp_path: Path) -> None:
    """A folder or file that is no result stays, even where overwriting is asked for."""
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("years of work")
    (tmp_path / "letter").write_text("dear")
    for name in ("thesis", "letter"):
        with pytest.raises(ResultError, match="no oatkit result"):
            make_result().save(tmp_path / name, overwrite=True)
    assert (tmp_path / "thesis" / "chapter.tex").read_text() == "years of work"


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    """An output in a folder that does not exist is refused before anything is computed."""
    with pytest.raises(ResultError) as caught:
        StoreWriter(tmp_path / "nowhere" / "out.zarr").__enter__()
    assert str(caught.value) == f"{tmp_path}/nowhere/out.zarr: its folder does not exist"


def test_a_read_only_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An output in a folder that the system says is not writable is refused before anything is computed."""
    # Root may write anywhere, so the system's answer is put in its mouth.
    monkeypatch.setattr(os, "access", lambda path, mode: not (path == tmp_path and mode & os.W_OK))
    with pytest.raises(ResultError) as caught:
        StoreWriter(tmp_path / "out.zarr").__enter__()
    assert str(caught.value) == f"{tmp_path}/out.zarr: its folder is read-only"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_really_read_only_folder_is_refused(tmp_path: Path) -> None:
    """The system does say so of a folder without the right to write."""
    tmp_path.chmod(0o500)
    with pytest.raises(ResultError, match="its folder is read-only"):
        StoreWriter(tmp_path / "out.zarr").__enter__()
    tmp_path.chmod(0o700)


def test_the_input_is_safe_from_the_output(tmp_path: Path) -> None:
    """An output that is, lies inside, or contains the input is refused, also through a link; a neighbour is fine."""
    scan, link = tmp_path / "scans" / "scan", tmp_path / "link"
    scan.mkdir(parents=True)
    link.symlink_to(scan)
    refused = {
        scan: "is the input",
        scan / "o.zarr": "inside",
        tmp_path / "scans": "contains",
        link / "o.zarr": "inside",
    }
    for output, reason in refused.items():
        with pytest.raises(ResultError, match=reason):
            StoreWriter(output, source=str(scan), overwrite=True).__enter__()
    make_result(scan={"source": str(scan)}).save(scan.parent / "out.zarr")
    make_result(scan={"source": "a phantom"}).save(tmp_path / "a.zarr")


def test_a_full_disk_is_seen_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A first frame of 17,280 bytes announces that a thousand of them would not fit."""
    monkeypatch.setattr(shutil, "disk_usage", lambda path: type("Usage", (), {"free": 17_279_999})())
    with pytest.raises(ResultError, match=r"needs 17\.3 MB, but only 17\.3 MB"):
        write_frames(tmp_path / "out.zarr", make_result(), *["dark"] * 999)
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(shutil, "disk_usage", lambda path: type("Usage", (), {"free": 17_280_000})())
    write_frames(tmp_path / "out.zarr", make_result(), *["dark"] * 999)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_pressure_that_is_not_finite_is_refused(tmp_path: Path, bad: float) -> None:
    """One pixel of initial pressure that is not finite stops the writer."""
    values = pressure().values.copy()
    values[1, 3, 4] = bad
    with pytest.raises(ResultError, match=r"frame 0: initial_pressure: (1 infinite and 0|0 infinite and 1) undefined"):
        make_result(images={"initial_pressure": replace(pressure(), values=values)}).save(tmp_path / "out.zarr")


def test_an_infinite_absorption_is_refused(tmp_path: Path) -> None:
    """Absorption may be undefined but not infinite."""
    values = np.where(np.isnan(absorption().values), np.float32("inf"), absorption().values)
    with pytest.raises(ResultError, match=f"{np.isinf(values).sum()} infinite and 0 undefined"):
        make_result(images={"absorption": replace(absorption(), values=values)}).save(tmp_path / "out.zarr")


def test_an_image_without_any_value_is_still_an_image(tmp_path: Path) -> None:
    """An absorption that is NaN everywhere is written and read back, not mistaken for a lost chunk."""
    nothing = replace(absorption(), values=np.full_like(absorption().values, np.nan))
    make_result(images={"absorption": nothing}).save(tmp_path / "out.zarr")
    assert verify(tmp_path / "out.zarr") == []
    assert _same_bits(load(tmp_path / "out.zarr")["absorption"], nothing)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"images": {"initial_pressure": pressure()}}, "differs from the first in images"),
        ({"images": {"initial_pressure": replace(pressure(), unit="Pa"), "absorption": absorption()}}, "units"),
        ({"pipeline": {"reconstruct": {"use": "lsqr"}}}, "another pipeline"),
    ],
)
def test_frames_of_one_result_are_alike(tmp_path: Path, changes: dict[str, Any], reason: str) -> None:
    """A frame with other images or units, or of another pipeline, does not go into the same result."""
    with pytest.raises(ResultError, match=reason):
        write_frames(tmp_path / "out.zarr", make_result(0), make_result(1, **changes))


def test_every_frame_is_written_exactly_once(tmp_path: Path) -> None:
    """A frame twice or a frame too many is refused when it is written."""
    with StoreWriter(tmp_path / "out.zarr") as writer:
        writer.write(0, make_result())
        with pytest.raises(ResultError, match="frame 0 was written already"):
            writer.fail(0, "on second thoughts")
        with pytest.raises(ResultError, match=r"frame 1 is not one of 0 \.\. 0"):
            writer.write(1, make_result())
    assert load(tmp_path / "out.zarr").failed == {}


def test_a_forgotten_frame_is_no_result(tmp_path: Path) -> None:
    """A writer that ends with frames neither written nor failed, or without a single good one, leaves nothing."""
    with pytest.raises(ResultError, match="2 of 3 frames were not written, the first is 1"):  # noqa: SIM117
        with StoreWriter(tmp_path / "out.zarr", frames=3) as writer:
            writer.write(0, make_result())
    with pytest.raises(ResultError, match="no frame gave an image; frame 0: dark"):
        write_frames(tmp_path / "out.zarr", "dark", "dark")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["../x", "a/b", "", ".hidden", "/abs", "zarr.json"])
def test_an_image_name_cannot_leave_the_folder(tmp_path: Path, name: str) -> None:
    """A plugin that names its image as a path is refused."""
    with pytest.raises(ResultError, match="expected letters, digits"):
        make_result(images={name: pressure()}).save(tmp_path / "out.zarr")
    assert list(tmp_path.iterdir()) == []


def test_written_frames_are_not_kept_in_memory(tmp_path: Path) -> None:
    """A frame that was written is let go."""
    with StoreWriter(tmp_path / "out.zarr", frames=2) as writer:
        first = make_result(0)
        image = weakref.ref(first["initial_pressure"])
        writer.write(0, first)
        del first
        gc.collect()
        assert image() is None
        writer.write(1, make_result(1))
