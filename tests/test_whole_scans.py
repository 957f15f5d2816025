"""Whole scans: which wavelengths are used and in what order, what memory many frames take, and frames without blood."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import oatkit
from oatkit import Geometry, Image, Pipeline, Scan, plugin
from oatkit.describe import scan_text
from oatkit.engine.rules import motion_in
from oatkit.errors import ValidationError
from oatkit.memo import Memo
from oatkit.scanfile import write_scan
from oatkit.simulate import arc_detectors, disc, simulate_scan
from oatkit.spectra import chromophore
from oatkit.store import verify
from oatkit.tables import ScanTable
from oatkit.wavelengths import ChosenSignals

GEOMETRY = Geometry(arc_detectors(32, 0.015), 20e6, 400, start_time_s=2e-6, speed_of_sound_m_s=1500)
CHEAP = """
version = 1
[scan]
{scan}
[grid]
pixels = 48
field_of_view_mm = 9
[[preprocess]]
use = "energy"
[forward]
use = "arc"
[reconstruct]
use = "{solver}"
[unmix]
use = "nnls"
"""


def blood(*wavelengths_nm: float, saturation: float = 0.8, frames: int = 1) -> Scan:
    """A noisy scan of a disc of blood at some wavelengths."""

    def image(grid):
        oxy, deoxy = (chromophore(f"{name}haemoglobin").spectrum(wavelengths_nm) for name in ("oxy", "deoxy"))
        colour = (saturation * oxy + (1 - saturation) * deoxy)[:, None, None]
        return Image(disc(grid, radius_m=3e-3).values * colour, "initial_pressure", "a.u.", grid, wavelengths_nm)

    arc = plugin("forward_model", "arc")()
    return simulate_scan(image, arc, geometry=GEOMETRY, field_of_view_m=10e-3, pixels=91, snr_db=25, frames=frames)


@pytest.fixture(scope="module")
def four():
    """Four wavelengths in rising order, three frames, each pulse with an energy of its own."""
    scan = blood(700, 760, 800, 850, frames=3)
    return replace(scan, pulse_energy=np.arange(1.0, 13.0).reshape(3, 4))


def permuted(scan: Scan, order: list[int]) -> Scan:
    """The same pulses in another order."""
    signals, energy = np.asarray(scan.signals)[:, order], scan.pulse_energy[:, order]
    return Scan(signals, scan.geometry, tuple(scan.wavelengths_nm[i] for i in order), pulse_energy=energy)


@pytest.fixture
def pipeline(tmp_path):
    """A function that makes a pipeline of a few steps from lines of its table [scan]."""

    def load(scan: str = "", solver: str = "lsqr", changes: tuple[str, ...] = ()) -> Pipeline:
        path = tmp_path / "cheap.toml"
        path.write_text(CHEAP.format(scan=scan, solver=solver))
        return Pipeline.load(path, changes)

    return load


def test_only_the_wavelengths_asked_for_are_used(four, pipeline):
    """Images at two of four are those of a scan of these two, energies and all, to the bit, in the scan's order."""
    result = oatkit.run(pipeline("wavelengths_nm = [850.4, 700]"), four, frame=1)
    alone = oatkit.run(pipeline(), permuted(four, [0, 3]), frame=1)
    assert result["initial_pressure"].wavelengths_nm == (700.0, 850.0)
    for name, image in alone.items():
        assert np.array_equal(result[name].values, image.values, equal_nan=True), name


def test_a_wavelength_left_out_cannot_fail_a_frame(four, pipeline):
    """Samples that are not finite count only where they are used."""
    signals = np.array(four.signals)
    signals[:, 1] = np.nan
    broken = replace(four, signals=signals)
    assert oatkit.run(pipeline("wavelengths_nm = [700, 850]"), broken)["so2"].values.shape == (1, 48, 48)
    with pytest.raises(oatkit.OatkitError):
        oatkit.run(pipeline(), broken)


def test_the_order_of_wavelengths_changes_nothing_but_the_order(four, pipeline):
    """Unsorted wavelengths stay so, in every image of many; so2 is the same to rounding of single precision."""
    order = [2, 0, 3, 1]
    sorted_, unsorted = oatkit.run(pipeline(), four), oatkit.run(pipeline(), permuted(four, order))
    assert unsorted["initial_pressure"].wavelengths_nm == (800.0, 700.0, 850.0, 760.0)
    assert np.array_equal(unsorted["initial_pressure"].values, sorted_["initial_pressure"].values[order])
    for name in ("so2", "total_haemoglobin"):
        assert np.array_equal(np.isnan(unsorted[name].values), np.isnan(sorted_[name].values))
        np.testing.assert_allclose(unsorted[name].values, sorted_[name].values, rtol=1e-5, atol=1e-12)
    notes = [note for note in unsorted.warnings if note.startswith("wavelengths: ")]
    assert notes == ["wavelengths: they are in no rising order; images keep the order of the scan"]
    assert not any(note.startswith("wavelengths: ") for note in sorted_.warnings)


def test_repeated_wavelengths_stay_repeated(four, pipeline):
    """Each is an image of its own, and one note says so; where one is asked for, all of its repetitions are used."""
    repeated = permuted(four, [0, 3, 0])
    result = oatkit.run(pipeline("wavelengths_nm = [700, 850]"), repeated)
    pressure = result["initial_pressure"]
    assert pressure.wavelengths_nm == (700.0, 850.0, 700.0)
    assert np.array_equal(pressure.values[0], pressure.values[2])
    notes = [note for note in result.warnings if note.startswith("wavelengths: ")]
    assert notes[0] == "wavelengths: the scan has 700 nm 2 times; each is an image of its own"
    assert len(notes) == len(set(notes)) == 1
    only = oatkit.run(pipeline("wavelengths_nm = [700]"), repeated)
    assert only["initial_pressure"].wavelengths_nm == (700.0, 700.0)


def test_info_says_what_is_odd_about_wavelengths(four):
    """Once, with the other notes on the scan; of wavelengths in rising order nothing is said."""
    assert "note: wavelengths:" not in scan_text(four)
    assert scan_text(permuted(four, [3, 0, 3])).count("note: wavelengths:") == 2


def test_a_wavelength_that_the_scan_lacks_is_named(four, pipeline, tmp_path):
    """Once for the run, before a frame is tried, with those that there are; nearer than 0.5 nm is the same."""
    wrong = pipeline("wavelengths_nm = [700, 710, 850.6]")
    sentence = r"the scan has no 710, 850.6 nm; it has 700, 760, 800, 850 nm"
    for attempt in (
        lambda: oatkit.run(wrong, four),
        lambda: oatkit.run_frames(wrong, four, tmp_path / "out.zarr", on_frame=pytest.fail),
    ):
        with pytest.raises(ValidationError, match=sentence):
            attempt()
    assert ScanTable(wavelengths_nm=(759.5,)).apply(four).wavelengths_nm == (760.0,)
    for bad in ((float("nan"),), (7e-7,), (True,)):
        with pytest.raises(ValidationError, match="wavelengths_nm"):
            ScanTable(wavelengths_nm=bad)


def test_motion_sees_the_wavelengths_that_are_used(four, pipeline):
    """Pulses of others are neither compared nor named."""
    looking = pipeline("wavelengths_nm = [700, 800]\n[motion]")
    motion = motion_in(looking, four, Memo())
    assert motion.wavelengths_nm == (700.0, 800.0)
    assert motion.correlation.shape == (3, 2)


class Watched:
    """Signals that note what is read of them."""

    fingerprint = "watched"

    def __init__(self, values: np.ndarray) -> None:
        self.values, self.read = values, []
        self.shape, self.dtype = values.shape, values.dtype

    def __getitem__(self, index):
        self.read.append(index)
        return self.values[index]


def test_choosing_wavelengths_reads_nothing(four):
    """Signals in a file stay there until a frame is asked for, and then no other frame is read."""
    watched = Watched(np.asarray(four.signals))
    chosen = ScanTable(wavelengths_nm=(760, 850)).apply(replace(four, signals=watched))
    assert watched.read == []
    assert chosen.frame(2) == ScanTable(wavelengths_nm=(760, 850)).apply(four.frame(2))
    assert watched.read == [slice(2, 3)]
    other = ScanTable(wavelengths_nm=(760, 800)).apply(replace(four, signals=watched))
    assert chosen.fingerprint != other.fingerprint


INDICES = {
    "a frame": 1, "frames": slice(0, 2), "all": Ellipsis, "the last": -1, "a pulse": (1, 0),
    "a pulse of each frame": (slice(None), 1), "samples": (slice(0, 2), 1, slice(None), slice(None, None, 5)),
    "the end": (Ellipsis, 3), "a channel": (0, slice(None), 4),
}  # fmt: skip


@pytest.mark.parametrize("index", INDICES.values(), ids=INDICES)
def test_chosen_signals_are_indexed_as_an_array(four, index):
    """Whatever begins with a frame, frames or all of them gives what numpy gives of the chosen wavelengths."""
    values = np.asarray(four.signals)
    chosen = ChosenSignals(values, (1, 3))
    assert chosen.shape == values[:, [1, 3]].shape
    assert np.array_equal(chosen[index], values[:, [1, 3]][index])


def test_a_frame_without_blood_is_a_frame(four, pipeline, tmp_path):
    """Where all signals are zero so2 has no value anywhere: it is stored, verified and read back as such."""
    signals = np.array(four.signals)
    signals[1] = 0
    result = oatkit.run_frames(pipeline(), replace(four, signals=signals), tmp_path / "out.zarr")
    assert result.frames == 3
    assert not result.failed
    assert verify(tmp_path / "out.zarr") == []
    assert [bool(np.isnan(result.frame(i)["so2"].values).all()) for i in range(3)] == [False, True, False]


def test_a_frame_that_fails_leaves_those_after_it(four, pipeline, tmp_path):
    """Samples that are not finite in the middle of a scan: the last frame has the numbers that it has alone."""
    signals = np.array(four.signals)
    signals[1, 2, 0] = np.inf
    result = oatkit.run_frames(pipeline(), replace(four, signals=signals), tmp_path / "out.zarr")
    assert list(result.failed) == [1]
    alone = oatkit.run(pipeline(), four, frame=2)
    assert np.array_equal(result.frame(2)["so2"].values, alone["so2"].values, equal_nan=True)


def test_one_note_for_wavelengths_that_fail_alike(four, pipeline):
    """Four solvers that stop too early differ in a number: one sentence has the first and counts the others."""
    hasty = pipeline(solver="nnls", changes=("reconstruct.n_iterations=1",))
    notes = [note for note in oatkit.run(hasty, four).warnings if "did not converge" in note]
    assert len(notes) == 1
    assert notes[0].startswith("reconstruct at 700 nm and at 3 further wavelengths did not converge: stopped after 1")


def test_notes_on_many_wavelengths_are_short(four):
    """Energies of more than three are told by their range, and channels that are bad everywhere once."""
    one = four.frame(0)
    signals = np.array(one.signals)
    signals[:, :, 5] = 0
    signals[0, 2, 7] = 0
    tested = plugin("preprocessor", "channels")().process(replace(one, signals=signals))
    assert not tested.valid[0, :, 5].any()
    assert [note for note in tested.notes if "not used" in note] == [
        "channels: not used at 700, 760, 850 nm: 5 dead.",
        "channels: not used at 800 nm: 5, 7 dead.",
    ]
    assert plugin("preprocessor", "energy")().process(one).notes[-1] == (
        "energy: signals were divided by 1 .. 4, by wavelength."
    )


PEAK = """
import sys
from pathlib import Path
import oatkit

pipeline, scan, out = sys.argv[1:]
oatkit.run_frames(oatkit.Pipeline.load(pipeline), oatkit.read(scan), out)
status = Path("/proc/self/status").read_text().splitlines()
print(next(line.split()[1] for line in status if line.startswith("VmHWM")))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is read from /proc")
def test_memory_does_not_grow_with_the_frames(pipeline, tmp_path):
    """The peak of 100 frames of 12 wavelengths is within 20 % of that of ten, where every other one fails, too."""
    pipeline(solver="backprojection")
    geometry = replace(GEOMETRY, detectors=arc_detectors(48, 0.015), n_samples=600)
    rng = np.random.default_rng(0)
    wavelengths = tuple(range(680, 901, 20))
    peaks = {}
    for frames in (10, 100):
        signals = rng.standard_normal((frames, len(wavelengths), *geometry.shape), dtype=np.float32)
        signals[1::2, 0, 0, 0] = np.nan
        write_scan(Scan(signals, geometry, wavelengths), tmp_path / f"{frames}.h5")
        arguments = (str(tmp_path / name) for name in ("cheap.toml", f"{frames}.h5", f"{frames}.zarr"))
        done = subprocess.run([sys.executable, "-c", PEAK, *arguments], capture_output=True, text=True, check=True)
        peaks[frames] = int(done.stdout)
    assert peaks[100] <= 1.2 * peaks[10], peaks
