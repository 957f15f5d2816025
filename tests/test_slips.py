"""Slips of units, orientation and time: refused, or noted, with a hint at the unit that was meant."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import ipasc_files
import msot_files
import oatkit
import patato_files
from array_files import ARC, POSITIONS, saved
from oatkit import Detectors, Geometry, Grid, Pipeline, Scan
from oatkit.builtin.readers.plain_array import PlainArray
from oatkit.data import Optics
from oatkit.errors import OatkitError
from oatkit.regions import EllipseRegion, PolygonRegion
from oatkit.simulate import arc_detectors
from oatkit.slips import arrival_notes, optics_notes, scan_notes

RING = arc_detectors(8, 0.04, 270)
GOOD = Geometry(RING, 40e6, 2000)


def scan(geometry: Geometry = GOOD, wavelengths: tuple = (700.0,), **parts: Any) -> Scan:
    """A scan without signals."""
    shape = (1, len(wavelengths), *geometry.shape)
    return Scan(np.zeros(shape), geometry, wavelengths, **parts)


def pipeline(change: str) -> Pipeline:
    """A preset with a change."""
    return Pipeline.load("lsqr-threshold-absorption", [change])


# In Python: what is done, and words of the message --------------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "positions in mm": (lambda: Detectors(1e3 * RING.positions_m), "the unit is m, so 40 mm is 0.04"),
    "positions in km": (lambda: Detectors(1e-3 * RING.positions_m), "the unit is m, so 40 mm is 0.04"),
    "positions nan": (lambda: Detectors([[np.nan, 0.04]]), "the unit is m"),
    "positions (n, 3)": (lambda: Detectors(np.ones((8, 3))), "from_xyz"),
    "positions turned": (lambda: Detectors(RING.positions_m.T), "expected shape (n, 2) in the order (y, x)"),
    "radius in mm": (lambda: arc_detectors(8, 40.5, 270), "40.5 mm is 0.0405"),
    "coverage in rad": (lambda: arc_detectors(8, 0.04, 0.05), "the unit is degrees"),
    "rate in MHz": (lambda: Geometry(RING, 40.0, 2000), "40 MHz is 40e6"),
    "rate in kHz": (lambda: Geometry(RING, 40e3, 2000), "40 MHz is 40e6"),
    "rate in mHz": (lambda: Geometry(RING, 40e9, 2000), "40 MHz is 40e6"),
    "period for rate": (lambda: Geometry(RING, 25e-9, 2000), "the unit is Hz"),
    "start in us": (lambda: Geometry(RING, 40e6, 2000, 10.0), "10 us is 1e-5"),
    "speed in km/s": (lambda: Geometry(RING, 40e6, 2000, 0, 1.5), "1.5 km/s is 1500"),
    "speed in mm/s": (lambda: Geometry(RING, 40e6, 2000, 0, 1.5e6), "1.5 km/s is 1500"),
    "speed in cm/s": (lambda: Geometry(RING, 40e6, 2000, 0, 1.5e5), "1.5 km/s is 1500"),
    "pixel in mm": (lambda: Grid((200, 200), 0.125), "0.1 mm is 1e-4"),
    "pixel in um": (lambda: Grid((200, 200), 125.0), "0.1 mm is 1e-4"),
    "centre in mm": (lambda: Grid((200, 200), 1e-4, (5.0, 0.0)), "10 mm is 0.01"),
    "wavelength in m": (lambda: scan(wavelengths=(700e-9,)), "700e-9 m is 700"),
    "wavelength in um": (lambda: scan(wavelengths=(0.7,)), "the unit is nm"),
    "absorption in 1/m for 1/nm": (lambda: Optics((700.0,), [1e9], [1e3]), "1 per cm is 100"),
    "negative scattering": (lambda: Optics((700.0,), [20.0], [-1.0]), "1 per cm is 100"),
    "region in mm": (lambda: PolygonRegion("a", [[0, 0], [0, 10], [10, 10]]), "10 mm is 0.01"),
    "axes of a region in mm": (lambda: EllipseRegion("a", (0, 0), (5.0, 5.0)), "10 mm is 0.01"),
    "angle in degrees": (lambda: EllipseRegion("a", (0, 0), (5e-3, 5e-3), 90.0), "90 degrees is 1.57"),
    "detectors inside": (lambda: GOOD.check_grid(Grid((200, 200), 5e-4)), "detectors lie inside the field of view"),
    "grid out of reach": (lambda: GOOD.check_grid(Grid((9, 9), 1e-4, (0.9, 0.9))), "check its centre and the start"),
    "sound before the record": (
        lambda: replace(GOOD, start_time_s=5e-3).check_grid(Grid((99, 99), 1e-4)),
        "check its centre and the start time",
    ),
    "record too short": (lambda: Geometry(RING, 40e6, 100).check_grid(Grid((99, 99), 1e-4)), "start time"),
    "field of view in um": (lambda: pipeline("grid.field_of_view_mm=25000"), "at most 1000 mm"),
    "field of view in m": (lambda: pipeline("grid.field_of_view_mm=0.025"), "0.1 mm is 1e-4"),
    "centre in um": (lambda: pipeline("grid.centre_mm=[5000.0, 0.0]"), "at most 1000 mm"),
    "table: speed in km/s": (lambda: pipeline("scan.speed_of_sound_m_s=1.5"), "at least 300 m/s"),
    "table: wavelength in m": (lambda: pipeline("scan.wavelengths_nm=[7e-7]"), "at least 100 nm"),
    "table: start in ns": (lambda: pipeline("scan.start_time_us=20000.0"), "at most 10000 us"),
    "table: absorption nan": (lambda: pipeline("optics.absorption_per_cm=nan"), "1/cm"),
    "table: absorption in 1/km": (lambda: pipeline("optics.absorption_per_cm=2e6"), "at most 100000 1/cm"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_is_refused(what):
    """In one sentence with the unit, or what to look at."""
    make, words = REFUSED[what]
    with pytest.raises(oatkit.ValidationError) as caught:
        make()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


NOTED: dict[str, tuple[Callable[[], Any], str]] = {
    "speed in ft/s": (lambda: scan(replace(GOOD, speed_of_sound_m_s=4921)), "feet a second"),
    "speed of air": (lambda: scan(replace(GOOD, speed_of_sound_m_s=343)), "the unit is m/s"),
    "rate in 100 kHz": (lambda: scan(replace(GOOD, sampling_rate_hz=4e5)), "40 MHz is 40e6"),
    "rate in GHz": (lambda: scan(replace(GOOD, sampling_rate_hz=4e9)), "40 MHz is 40e6"),
    "wavelength in angstrom": (lambda: scan(wavelengths=(7000.0,)), "7000 angstrom are 700"),
    "temperature in K": (lambda: scan(temperature_c=[[306.0]]), "306 K is 32.85"),
    "temperature nan": (lambda: scan(temperature_c=[[np.nan]]), "degrees Celsius"),
    "time in ms": (lambda: scan(timestamps_s=[[1.6e12]]), "the unit is s"),
    "place in mm": (lambda: scan(position_m=[[60.0]]), "60 mm is 0.06"),
    "energy zero": (lambda: scan(pulse_energy=[[0.0]]), "energies are positive"),
    "energy negative": (lambda: scan(pulse_energy=[[-1.0]]), "energies are positive"),
    "one detector in cm": (
        lambda: scan(replace(GOOD, detectors=Detectors([*RING.positions_m[:-1], 10 * RING.positions_m[-1]]))),
        "Detector 7 of 8 lies",
    ),
    "one detector twice": (
        lambda: scan(replace(GOOD, detectors=Detectors([*RING.positions_m[:-1], RING.positions_m[0]]))),
        "at 7 places only",
    ),
}


@pytest.mark.parametrize("what", NOTED)
def test_what_can_be_but_is_odd_is_noted(what):
    """Somebody may mean it, so it is read and run, and the note has the unit; nothing is said of a usual scan."""
    make, words = NOTED[what]
    (note,) = scan_notes(make())
    assert words in note
    usual = scan(pulse_energy=[[1.0]], temperature_c=[[33.0]], timestamps_s=[[1.6e9]], position_m=[[0.06]])
    assert scan_notes(usual) == ()


def test_scattering_per_cm_is_noted():
    """Of 10 per cm taken for 10 per m; tissue gives no note."""
    assert "10 per cm is 1000" in optics_notes(Optics((700.0,), [20.0], [10.0]))[0]
    assert optics_notes(Optics((700.0,), [20.0], [1000.0])) == ()


def test_notes_reach_the_result_and_info(small_scan):
    """Whoever runs a pipeline over an odd scan, or asks what is in it, is told once."""
    from oatkit.describe import scan_table

    odd = replace(small_scan, temperature_c=np.full((2, 1), 306.0))
    quick = Pipeline.load("lsqr", ["grid.pixels=32", "grid.field_of_view_mm=9", "reconstruct.n_iterations=2"])
    for notes in (oatkit.run(quick, odd).warnings, scan_table(odd)["notes"]):
        assert sum("306 K is 32.85" in note for note in notes) == 1


# Time and orientation -------------------------------------------------------------------------------------------------

GRID = Grid((32, 32), 9e-3 / 32)


@pytest.mark.parametrize("shift_us", [-9.0, -6.0, 6.0, 9.0])
def test_a_wrong_time_zero_shows_in_the_data(small_scan, shift_us):
    """Signals that arrive before or after sound can come from the field of view are noted; right ones are not."""
    clean = small_scan.frame(0)
    assert arrival_notes(clean, GRID) == ()
    shifted = clean.with_start_time(clean.geometry.start_time_s + shift_us * 1e-6)
    (note,) = arrival_notes(shifted, GRID)
    assert ("before" in note) == (shift_us < 0)
    assert "check the time of the first sample" in note


def test_a_reversed_time_axis_shows_where_the_record_is_not_symmetric(small_scan):
    """The last sample first: this record has its signals before its middle."""
    clean = small_scan.frame(0)
    (note,) = arrival_notes(replace(clean, signals=clean.signals[..., ::-1]), GRID)
    assert "whether the time axis runs forward" in note


def test_the_real_scan_gives_no_note(mouse_scan):
    """Of a usual scan there is nothing to say, neither of its numbers nor of its signals."""
    from oatkit.memo import Memo
    from oatkit.reconstruction import preprocess

    preset = Pipeline.load("lsqr")
    clean = preprocess(preset, oatkit.read(mouse_scan), 0, Memo())
    assert scan_notes(clean) == ()
    assert arrival_notes(clean, preset.grid.grid()) == ()


def test_a_mirrored_array_cannot_be_told():
    """Its data are exactly those of the mirrored body: no data can show the slip, so nothing is claimed."""
    mirrored = replace(GOOD, detectors=Detectors(RING.positions_m * [1, -1]))
    grid = Grid((40, 40), 2e-4)
    arc = oatkit.plugin("forward_model", "arc")(precision="double")
    image = np.random.default_rng(0).random(grid.shape)
    one = arc.operator(GOOD, grid).matvec(image.ravel())
    other = arc.operator(mirrored, grid).matvec(image[:, ::-1].ravel())
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-10 * abs(one).max())


# In files -------------------------------------------------------------------------------------------------------------


def _msot(old: str, new: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        text = msot_files.header()
        assert old in text
        return msot_files.write(folder / "s", text.replace(old, new))

    return make


def _ipasc(**changes: Any) -> Callable[[Path], Path]:
    return lambda folder: ipasc_files.write(folder / "scan.hdf5", **changes)


def _patato(change: Callable[[h5py.File], None]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = patato_files.write_patato(folder / "scan.hdf5", results=False)
        with h5py.File(path, "r+") as file:
            change(file)
        return path

    return make


def _rate(file: h5py.File) -> None:
    file.attrs["fs"] = file["raw_data"].attrs["fs"] = 40.0


def _times(name: str, factor: float) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        values = file[name][()] * factor
        del file[name]
        file[name] = values

    return change


def _arrays(**keys: Any) -> Callable[[Path], Path]:
    return lambda folder: saved(folder, **keys)


def _positions(factor: float) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        np.save(folder / "p.npy", factor * ipasc_files.ARC[:, :2])
        return saved(folder, rest=POSITIONS.format(file="p.npy"))

    return make


IN_MM = msot_files.projections([(1e3 * x, 1e3 * y, 0) for x, y, _ in msot_files.RING])
FILES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "iThera: positions in mm": (
        lambda folder: msot_files.write(
            folder / "s", msot_files.header(geometry=IN_MM)
        ),
        "40 mm is 0.04",
    ),
    "iThera: arc in degrees": (
        lambda folder: msot_files.write(folder / "s", msot_files.header(geometry=msot_files.equal(17, 2, 287, 0.04))),
        "angles in radians",
    ),
    "iThera: rate in Hz called MHz": (_msot('"M">40<', '"M">40e6<'), "the unit is Hz"),
    "iThera: rate in MHz called Hz": (_msot('unit-modifier="M"', 'unit-modifier="none"'), "40 MHz is 40e6"),
    "iThera: wavelength in m": (_msot(">700<", ">700e-9<"), "700e-9 m is 700"),
    "iThera: temperature in K": (_msot(">30</TEMPERATURE>", ">303</TEMPERATURE>"), "306 K is 32.85"),
    "iThera: power negative": (_msot(">100</POWER>", ">-100</POWER>"), "energies are positive"),
    "iThera: place in um": (_msot(">10</Z-POS>", ">10000</Z-POS>"), "60 mm is 0.06"),
    "IPASC: positions in mm": (_ipasc(points=1e3 * ipasc_files.ARC), "40 mm is 0.04"),
    "IPASC: positions in km": (_ipasc(points=1e-3 * ipasc_files.ARC), "40 mm is 0.04"),
    "IPASC: rate in MHz": (_ipasc(ad_sampling_rate=40.0), "40 MHz is 40e6"),
    "IPASC: speed in km/s": (_ipasc(speed_of_sound=1.5), "1.5 km/s is 1500"),
    "IPASC: wavelengths in nm": (_ipasc(acquisition_wavelengths=[700.0, 800.0]), "taken as nm"),
    "IPASC: wavelengths in um": (_ipasc(acquisition_wavelengths=[0.7, 0.8]), "between 1e-7 and 2e-5 m"),
    "IPASC: temperature in C": (_ipasc(temperature_control=33.0), "degrees Celsius"),
    "IPASC: energy negative": (_ipasc(pulse_energy=-1.0), "not all positive"),
    "IPASC: start in us": (_ipasc(oatkit_start_time_s=10.0), "10 us is 1e-5"),
    "PATATO: rate in MHz": (_patato(_rate), "40 MHz is 40e6"),
    "PATATO: positions in mm": (_patato(_times("GEOMETRY", 1e3)), "40 mm is 0.04"),
    "PATATO: positions in km": (_patato(_times("GEOMETRY", 1e-3)), "40 mm is 0.04"),
    "PATATO: wavelengths in m": (_patato(_times("wavelengths", 1e-9)), "700e-9 m is 700"),
    "PATATO: temperature in K": (_patato(_times("TEMPERATURE", 9.3)), "306 K is 32.85"),
    "PATATO: place in um": (_patato(_times("Z-POS", 1e3)), "60 mm is 0.06"),
    "arrays: positions in mm called m": (_positions(1e3), "40 mm is 0.04"),
    "arrays: positions in km": (_positions(1e-3), "is their unit 'm'?"),
    "arrays: rate in Hz": (_arrays(sampling_rate_mhz="40e6"), "at most 10000 MHz"),
    "arrays: rate in kHz": (_arrays(sampling_rate_mhz="0.04"), "at least 0.1 MHz"),
    "arrays: speed in km/s": (_arrays(speed_of_sound_m_s="1.5"), "at least 300 m/s"),
    "arrays: speed in ft/s": (_arrays(speed_of_sound_m_s="4921"), "feet a second"),
    "arrays: start in ps": (_arrays(start_time_us="1e6"), "at most 10000 us"),
    "arrays: wavelengths in m": (_arrays(wavelengths_nm="[7e-7, 8e-7]"), "at least 100 nm"),
    "arrays: wavelengths in angstrom": (_arrays(wavelengths_nm="[7000, 7300]"), "7000 angstrom are 700"),
    "arrays: radius in m": (_arrays(rest=ARC.format(count=5).replace("40.5", "0.0405")), "at least 1 mm"),
    "arrays: coverage in rad": (_arrays(rest=ARC.format(count=5).replace("270", "-4.7")), "degrees"),
    "arrays: axes swapped": (
        _arrays(axes=["frame", "wavelength", "sample", "detector"]),
        "are 'axes' in the order of the file?",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", FILES)
def test_a_slip_in_a_file_is_refused_or_noted(tmp_path, what):
    """By every reader: an error with the unit, or a note with it that `oatkit info` and each run show."""
    from oatkit.describe import scan_table

    make, words = FILES[what]
    path = make(tmp_path)
    try:
        reader = PlainArray() if path.suffix == ".toml" else None
        text = "\n".join(scan_table(oatkit.read(path, reader))["notes"])
    except OatkitError as error:
        text = str(error)
    assert words in text
