"""Motion: what is out of place is found, what is at rest or changes is left alone, and runs do what they are told."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oatkit
from moving_scans import DIRECTIONS, TISSUE, VESSELS, at_rest, noisy_scan, pulses
from oatkit import Pipeline, ValidationError
from oatkit.data import Grid
from oatkit.describe import motion_text
from oatkit.motion import find_motion
from oatkit.scanfile import write_scan
from oatkit.tables import MotionTable
from packages import run_oatkit

FAST = ("grid.pixels=24", "reconstruct.n_iterations=2", "reconstruct.tolerance=0.5")


def with_moved(clean: np.ndarray, where: list[tuple[int, int]], distance_m: float = 0.3e-3) -> np.ndarray:
    """The pulses at some (frame, wavelength) taken after a move, in different directions."""
    clean = clean.copy()
    for i, (frame, wavelength) in enumerate(where):
        move = tuple(distance_m * part for part in DIRECTIONS[i % len(DIRECTIONS)])
        clean[frame, wavelength] = pulses(TISSUE[wavelength], VESSELS[wavelength], move)
    return clean


def moved(motion) -> list[tuple[int, int]]:
    """The (frame, wavelength) of all pulses said to be out of place."""
    return [tuple(map(int, pair)) for pair in np.argwhere(motion.moved)]


@pytest.mark.parametrize("snr_db", [32.0, 10.0])
@pytest.mark.parametrize("seed", range(6))
def test_a_displacement_of_a_third_of_a_millimetre_is_found(snr_db, seed):
    """Of ten frames with four pulses displaced by 0.3 mm, exactly these are out of place, at 32 and at 10 dB."""
    places = np.random.default_rng(seed).choice(40, 4, replace=False)
    where = sorted((int(p) // 4, int(p) % 4) for p in places)
    assert moved(find_motion(noisy_scan(with_moved(at_rest(10), where), snr_db, seed))) == where


@pytest.mark.parametrize("snr_db", [32.0, 10.0])
def test_a_scan_at_rest_is_left_alone(snr_db):
    """None of 10 x 24 pulses of a body at rest is out of place, nor does anything change for good."""
    for seed in range(10):
        motion = find_motion(noisy_scan(at_rest(6), snr_db, seed))
        assert (motion.frames, motion.shifts, motion.notes) == ((), (), ())


def gas(share: float) -> np.ndarray:
    """One frame with vessels of this oxygen saturation: two made-up spectra, crossing like those of haemoglobin."""
    without, oxygenated = np.array([1.2, 0.8, 0.6, 0.4]), np.array([0.25, 0.4, 0.6, 0.7])
    return pulses(TISSUE, (1 - share) * without + share * oxygenated)


def bolus(frame: int) -> np.ndarray:
    """One frame with a contrast agent that arrives at frame 4, peaks three frames later and is washed out."""
    after = max(frame - 4, 0) / 3
    return pulses(TISSUE, VESSELS + 2 * after * np.exp(1 - after) * np.array([0.5, 0.7, 1.0, 0.9]))


CHANGES = {
    "gas challenge": [gas(0.6 + 0.35 * min(max(f - 4, 0) / 3, 1)) for f in range(12)],
    "sudden gas challenge": [gas(0.6 if f < 6 else 0.95) for f in range(12)],
    "contrast agent": [bolus(f) for f in range(16)],
    "energy": [(0.8 + 0.1 * (f % 5)) * pulses(TISSUE, VESSELS) for f in range(10)],
}


@pytest.mark.parametrize("what", CHANGES)
@pytest.mark.parametrize("snr_db", [32.0, 10.0])
def test_what_changes_without_moving_is_no_motion(what, snr_db):
    """A gas challenge, a contrast agent and the energy of the pulses put no pulse out of place."""
    assert moved(find_motion(noisy_scan(np.stack(CHANGES[what]), snr_db, 1))) == []


def test_a_body_that_moves_for_good_is_not_out_of_place_but_noted():
    """After a lasting move no pulse is out of place, and the note says after which frame it was."""
    clean = np.concatenate([at_rest(5), np.repeat(pulses(TISSUE, VESSELS, (0.0, 0.3e-3))[None], 5, axis=0)])
    motion = find_motion(noisy_scan(clean, 20.0, 0))
    assert moved(motion) == []
    assert motion.shifts == ((4, 4),)
    assert "after frame 4 the signals of 4 of 4 wavelengths changed for good" in motion.notes[0]


def test_two_frames_out_of_place_in_a_row_are_both_found():
    """A breath that lasts two frames does not vouch for itself: both are out of place."""
    clean = at_rest(9)
    clean[3:5] = pulses(TISSUE, VESSELS, (0.3e-3, 0.0))
    assert find_motion(noisy_scan(clean, 20.0, 0)).frames == (3, 4)


def test_one_frame_is_judged_by_its_wavelengths():
    """In a scan of one frame, a pulse is compared with the wavelengths beside it."""
    twelve = np.stack([pulses(t, v) for t, v in zip(np.linspace(1, 0.6, 12), np.linspace(0.2, 0.5, 12), strict=True)])
    rest = find_motion(noisy_scan(twelve[None], 32.0, 0))
    assert (rest.compared, moved(rest)) == ("wavelengths", [])
    twelve[7] = pulses(0.75, 0.4, (0.3e-3, 0.0))
    assert moved(find_motion(noisy_scan(twelve[None], 32.0, 0))) == [(0, 7)]


@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 2), (2, 2)])
def test_of_too_few_pulses_nothing_is_said(shape):
    """Where a pulse has no two others to be compared with, that is what the notes say."""
    motion = find_motion(noisy_scan(at_rest(shape[0])[:, : shape[1]], 32.0, 0))
    assert motion.frames == ()
    assert "too few" in motion.notes[0]
    assert json.loads(json.dumps(motion.table(), allow_nan=False))["correlation"][0][0] is None


def test_noise_alone_is_nothing_to_judge_by():
    """Signals of noise alone, or of zeros, are not said to have moved nor to be at rest."""
    for clean, level in ((at_rest(6), -30.0), (np.zeros_like(at_rest(6)), 0.0)):
        motion = find_motion(noisy_scan(clean, level, 0))
        assert motion.frames == ()
        assert "nothing can be said of 24 of 24 pulses" in motion.notes[0]


def test_offset_scale_and_bad_channels_do_not_count():
    """The correlation does not depend on offsets, on a factor, nor on what a channel not to be trusted holds."""
    scan = noisy_scan(with_moved(at_rest(6), [(2, 1)]), 20.0, 0)
    expected = find_motion(scan).correlation
    rng = np.random.default_rng(0)
    changed = np.asarray(scan.signals) * rng.uniform(1, 3, (6, 4, 1, 1)) + rng.uniform(-5, 5, (6, 4, 48, 1))
    assert np.allclose(find_motion(replace(scan, signals=changed)).correlation, expected, atol=1e-5)
    valid = np.ones((6, 4, 48), bool)
    valid[3, :, 5] = valid[4, 2, 7] = False
    zero, wild = np.array(scan.signals), np.array(scan.signals)
    zero[~valid], wild[~valid] = 0, np.nan
    first, second = (find_motion(replace(scan, signals=s, valid=valid)).correlation for s in (zero, wild))
    assert np.array_equal(first, second)
    assert np.allclose(first, expected, atol=0.05)


def test_samples_out_of_the_field_of_view_do_not_count():
    """What the laser does to the records before any point of the grid can be heard changes nothing."""
    scan = noisy_scan(at_rest(4), 20.0, 0)
    loud = np.array(scan.signals)
    loud[..., :100] += 1e3 * np.random.default_rng(0).standard_normal((4, 4, 48, 100), dtype=np.float32)
    grid = Grid((40, 40), 5e-4)
    expected = find_motion(scan, grid=grid).correlation
    assert np.array_equal(find_motion(replace(scan, signals=loud), grid=grid).correlation, expected)


def test_frames_are_read_one_after_another():
    """No more than one frame is asked for at a time, each of them once, in order."""

    class Lazy:
        def __init__(self, array):
            self.array, self.shape, self.dtype, self.asked = array, array.shape, array.dtype, []

        def __getitem__(self, index):
            self.asked.append(index)
            return self.array[index]

    scan = noisy_scan(at_rest(6), 20.0, 0)
    lazy = Lazy(np.asarray(scan.signals))
    assert np.array_equal(find_motion(replace(scan, signals=lazy)).correlation, find_motion(scan).correlation)
    assert lazy.asked == [slice(f, f + 1) for f in range(6)]


def test_the_limit_is_what_the_settings_say():
    """The limit lies below the median by the larger of k spreads of the values above it and a share of it."""
    scan = noisy_scan(with_moved(at_rest(8), [(2, 1), (5, 0)]), 10.0, 0)
    for settings in (MotionTable(), MotionTable(threshold=40.0, least_drop=0.01)):
        motion = find_motion(scan, settings)
        middle = np.median(motion.correlation, axis=0)
        above = np.where(motion.correlation >= middle, motion.correlation - middle, np.nan)
        spread = 1.4826 * np.nanmedian(above, axis=0)
        limit = middle - np.maximum(settings.threshold * spread, settings.least_drop * middle)
        assert np.allclose(motion.limit, np.broadcast_to(limit, (8, 4)), rtol=1e-12)


@pytest.fixture(scope="module")
def restless():
    """A scan of six frames whose frame 2 moved at the second wavelength, with the times of its pulses."""
    times = np.arange(24.0).reshape(6, 4) / 10
    return noisy_scan(with_moved(at_rest(6), [(2, 1)]), 20.0, 0, name="restless", timestamps_s=times)


def pipeline(*changes: str) -> Pipeline:
    """A preset that takes a moment, with a table `[motion]`."""
    return Pipeline.load("lsqr", [*FAST, "motion.threshold=6.0", *changes])


def test_a_run_warns_of_frames_that_moved(restless, tmp_path):
    """With `[motion]`, each frame is run, and that which moved says so, alone and among all."""
    sentence = "frame 2: 750 nm moved, correlation 0."
    alone = oatkit.run(pipeline("motion.leave_out=true"), restless, frame=2)
    assert any(note.startswith(sentence) for note in alone.warnings)
    stored = oatkit.run_frames(pipeline(), restless, tmp_path / "out.zarr")
    said = [any(note.startswith(sentence) for note in stored.frame(i).warnings) for i in range(6)]
    assert said == [False, False, True, False, False, False]


def test_frames_that_moved_are_left_out_when_asked(restless, tmp_path):
    """With `leave_out`, the result holds the other frames, none of them failed, and each says which were left out."""
    stored = oatkit.run_frames(pipeline("motion.leave_out=true"), restless, tmp_path / "out.zarr", range(1, 5))
    assert (stored.frames, dict(stored.failed)) == (3, {})
    assert [stored.frame(i).frame_index for i in range(3)] == [1, 3, 4]
    assert all("left out: frames 2 (motion)" in stored.frame(i).warnings for i in range(3))
    assert oatkit.verify(tmp_path / "out.zarr") == []


def test_a_run_of_nothing_but_moved_frames_is_refused(restless, tmp_path):
    """Where all frames asked for are left out, there is a sentence and no result."""
    with pytest.raises(ValidationError, match="all frames asked for are out of place: 2"):
        oatkit.run_frames(pipeline("motion.leave_out=true"), restless, tmp_path / "out.zarr", [2])
    assert list(tmp_path.iterdir()) == []


def test_frames_know_when_they_were_taken(restless, tmp_path):
    """A result, stored or not, knows the mean time of its frame's pulses; without timestamps it knows none."""
    assert oatkit.run(pipeline(), restless, frame=1).time_s == pytest.approx(0.55)
    stored = oatkit.run_frames(pipeline(), restless, tmp_path / "out.zarr", [1, 3])
    assert stored.frame(1).time_s == pytest.approx(1.35)
    assert stored.when(1) == (3, stored.frame(1).time_s)
    unknown = replace(restless, timestamps_s=np.full((6, 4), np.nan))
    assert oatkit.run(pipeline(), unknown).time_s is None


def test_the_command_says_what_moved(restless, tmp_path):
    """`motion` prints a sentence for each pulse out of place, JSON on request, and draws the curve."""
    write_scan(restless, tmp_path / "scan.h5")
    text = run_oatkit("motion", "scan.h5", "-o", "curve.png", cwd=tmp_path).stdout
    assert text.startswith("1 of 24 pulses out of place, in 1 of 6 frames\nframe 2: 750 nm moved")
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    table = json.loads(run_oatkit("motion", "scan.h5", "--json", cwd=tmp_path).stdout)
    assert table["moved"] == [{"frame": 2, "wavelength_nm": 750.0}]


def test_the_page_on_time_shows_what_happens(tmp_path, monkeypatch):
    """The script of the page writes its scans, the text that it shows is printed of them, its pipeline loads."""
    page = (Path(__file__).parents[1] / "docs" / "guides" / "time.md").read_text()
    monkeypatch.chdir(tmp_path)
    exec(re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0], {})
    assert f"```\n{motion_text(find_motion(oatkit.read('gas.h5')))}\n```" in page
    assert find_motion(oatkit.read("dye.h5")).frames == ()
    table = next(block for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "[motion]" in block)
    assert MotionTable(**tomllib.loads(table)["motion"]) == MotionTable(leave_out=True)
