"""Detector arrays against a real one, and scans against the signals of a disc and the statistics of their noise."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import aslinearoperator

from oatkit.api import Detectors, ForwardModel, Geometry, Grid, Image, ValidationError
from oatkit.simulate import arc_detectors, disc, msot_geometry, simulate_scan, useful_window


class Shells(ForwardModel):
    """The arc integrals of Eq. 2 before the time derivative, (1/R) int H dl, each averaged over one sample."""

    name = "shells"

    def operator(self, geometry, grid):
        y, x = (a.ravel() for a in np.meshgrid(grid.y_m, grid.x_m, indexing="ij"))
        step = geometry.speed_of_sound_m_s / geometry.sampling_rate_hz
        rows, columns, weights = [], [], []
        for k, (at_y, at_x) in enumerate(geometry.detectors.positions_m):
            distance = np.hypot(y - at_y, x - at_x)
            sample = np.rint((distance - geometry.start_time_s * geometry.speed_of_sound_m_s) / step).astype(int)
            seen = np.flatnonzero((sample >= 0) & (sample < geometry.n_samples))
            rows.append(k * geometry.n_samples + sample[seen])
            columns.append(seen)
            weights.append(grid.pixel_size_m**2 / (step * distance[seen]))
        entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
        shape = (geometry.detectors.count * geometry.n_samples, y.size)
        return aslinearoperator(coo_array(entries, shape=shape).tocsr())


@pytest.fixture(scope="module")
def few():
    """Sixteen detectors of the MSOT arc, sampled at 10 MHz."""
    return Geometry(arc_detectors(16), sampling_rate_hz=10e6, n_samples=512, speed_of_sound_m_s=1520)


def test_the_default_arc_is_the_array_of_a_real_scanner(mouse_scan):
    """All 256 positions in the header of a real MSOT scan are reproduced to a nanometre, in their order."""
    header = mouse_scan.read_text(encoding="utf-8")
    projections = re.findall(r"<PROJECTION .*?</PROJECTION>", header, re.DOTALL)
    points = [[float(v) for v in re.findall(r"<VALUE[^>]*>([^<]+)<", p)] for p in projections]
    real = Detectors.from_xyz(points).positions_m
    assert abs(arc_detectors().positions_m - real).max() <= 1e-9


def test_the_arc_opens_at_the_bottom():
    """No detector of a 270 degree arc is within 45 degrees of the negative y axis; the first is at the lower right."""
    y, x = arc_detectors(64).positions_m.T
    assert np.hypot(y, x) == pytest.approx(0.0405, rel=1e-14)
    assert not (-y > abs(x)).any()
    assert y[0] < 0 < x[0]


def test_a_full_ring_is_evenly_spaced():
    """Turning a ring of 64 by 90 degrees rolls it by 16 detectors."""
    y, x = arc_detectors(64, coverage_deg=360).positions_m.T
    turned = np.column_stack([x, -y])
    assert turned == pytest.approx(np.roll(np.column_stack([y, x]), -16, axis=0), abs=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n": 0}, "at least one detector"),
        ({"radius_m": 40.5}, "40.5 mm is 0.0405"),
        ({"coverage_deg": np.nan}, "coverage_deg: nan is outside 0.1 .. 360"),
    ],
)
def test_an_impossible_array_is_refused(change, message):
    """The message has the range and a hint at the unit."""
    with pytest.raises(ValidationError, match=message):
        arc_detectors(**change)


def test_the_signals_are_the_arc_integrals_of_the_object(few):
    """For a disc off the centre they are 2 arccos((r0^2 + R^2 - a^2) / (2 r0 R)), to 1.2e-2 of their norm."""
    centre, radius = np.array([2e-3, 1e-3]), 4e-3

    def object_(grid):
        return disc(grid, radius_m=radius, centre_m=tuple(centre))

    signals = simulate_scan(object_, Shells(), geometry=few, snr_db=None).signals[0, 0]
    r0 = np.hypot(*(few.detectors.positions_m - centre).T)[:, None, None]
    within_a_sample = (np.arange(100) + 0.5) / 100 - 0.5
    distance = 1520 * (few.times_s[1:, None] + within_a_sample / 10e6)
    cosine = (r0**2 + distance**2 - radius**2) / (2 * r0 * distance)
    expected = (2 * np.arccos(np.clip(cosine, -1, 1))).mean(-1)
    assert np.linalg.norm(signals[:, 1:] - expected) <= 1.2e-2 * np.linalg.norm(expected)


def test_the_scan_says_what_it_is(few):
    """One frame at 700 nm in float32, with its phantom, model, grid, SNR, window and seed in words."""
    scan = simulate_scan("star", Shells(), geometry=few, pixels=60, seed=5)
    assert scan.signals.shape == (1, 1, 16, 512)
    assert scan.signals.dtype == np.float32
    assert (scan.wavelengths_nm, scan.name) == ((700.0,), "star")
    assert scan.valid.all()
    assert scan.source == "simulated from the phantom 'star' by the forward model 'shells'"
    assert scan.notes == ("simulated on 60 x 60 pixels over 25 mm; SNR 32 dB over the useful window, seed 5",)


@pytest.mark.parametrize("window", ["useful", "record"])
def test_the_snr_is_the_one_asked_for_in_the_window_that_is_named(few, window):
    """20 log10 of the rms ratio is 12 dB within four standard errors there, and not so in the other window."""
    clean, noisy = (
        simulate_scan("disc", Shells(), geometry=few, pixels=101, snr_db=snr, snr_window=window, frames=20).signals
        for snr in (None, 12.0)
    )
    useful = useful_window(few, Grid((101, 101), 25e-3 / 101))
    masks = {"useful": useful, "record": np.ones_like(useful)}

    def snr(mask):
        noise = (noisy - clean)[..., mask].astype(float)
        return 10 * np.log10((clean[..., mask].astype(float) ** 2).mean() / (noise**2).mean()), noise.size

    measured, count = snr(masks[window])
    # The standard error of a variance is sqrt(2 / n) of it; 4.34 turns that into dB.
    assert abs(measured - 12) <= 4 * 4.34 * np.sqrt(2 / count)
    other, _ = snr(masks["record" if window == "useful" else "useful"])
    assert abs(other - 12) > 2


def test_noise_is_white_and_fills_the_record(few):
    """Outside the useful window it is as strong as inside, and neighbouring samples are uncorrelated."""
    clean, noisy = (
        simulate_scan("disc", Shells(), geometry=few, pixels=51, snr_db=snr, frames=20).signals for snr in (None, 0.0)
    )
    noise = (noisy - clean).astype(float)
    useful = useful_window(few, Grid((51, 51), 25e-3 / 51))
    inside, outside = noise[..., useful], noise[..., ~useful]
    error = np.sqrt(0.5 / inside.size + 0.5 / outside.size)
    assert abs(np.log(inside.std() / outside.std())) <= 4 * error
    correlation = (noise[..., 1:] * noise[..., :-1]).mean() / noise.var()
    assert abs(correlation) <= 4 / np.sqrt(noise.size)


def test_a_scan_is_drawn_by_its_seed(few):
    """The same seed gives the same scan to the bit; another seed, and each frame, has another noise."""
    first, again, other = (
        simulate_scan("disc", Shells(), geometry=few, pixels=51, frames=2, seed=seed) for seed in (1, 1, 2)
    )
    assert first == again
    assert (first.signals[0] != other.signals[0]).mean() > 0.99
    assert (first.signals[0] != first.signals[1]).mean() > 0.99


def test_each_plane_of_a_phantom_becomes_a_wavelength(few):
    """A phantom with two wavelengths gives both, in its order and proportion, under one noise level."""

    def coloured(grid):
        plane = disc(grid).values[0]
        return Image(np.stack([plane, 3 * plane]), "initial_pressure", "a.u.", grid, (750, 700))

    scan = simulate_scan(coloured, Shells(), geometry=few, pixels=51, snr_db=None)
    assert scan.wavelengths_nm == (750, 700)
    assert scan.signals[0, 1] == pytest.approx(3 * scan.signals[0, 0], rel=1e-6)


def test_the_useful_window_holds_what_the_grid_reaches_and_no_more(few):
    """It is one interval per detector, whose ends are the distances to the nearest and farthest point of the grid."""
    grid = Grid((40, 60), 3e-4, (1e-3, -2e-3))
    window = useful_window(few, grid)
    left, right, bottom, top = grid.extent_m
    y, x = np.meshgrid(np.linspace(bottom, top, 400), np.linspace(left, right, 600), indexing="ij")
    for (at_y, at_x), samples in zip(few.detectors.positions_m, window, strict=True):
        distance = np.hypot(y - at_y, x - at_x)
        reached = few.times_s[samples] * 1520
        assert (np.diff(np.flatnonzero(samples)) == 1).all()
        # The points are 30 um apart, a sample is 152 um long.
        assert 0 <= reached[0] - distance.min() <= 152e-6 + 30e-6
        assert 0 <= distance.max() - reached[-1] <= 152e-6 + 30e-6


def test_what_a_20_mm_field_of_view_fills_of_the_msot_record():
    """The first sample in which any detector can hear it is 694, the last 1437, of 2030."""
    seen = np.flatnonzero(useful_window(msot_geometry(), Grid((200, 200), 1e-4)).any(axis=0))
    assert (seen[0], seen[-1]) == (694, 1437)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"snr_db": np.nan}, "snr_db: nan is outside"),
        ({"snr_window": "all"}, "expected 'useful' or 'record', got 'all'"),
        ({"field_of_view_m": 25}, "25 mm is 25e-3"),
        ({"field_of_view_m": 0.09}, "16 of 16 detectors lie inside the field of view"),
        ({"pixels": 0}, "pixels: 0 is outside"),
        ({"frames": 0}, "at least one frame"),
    ],
)
def test_an_impossible_scan_is_refused(few, change, message):
    """The message has what was found and what was expected."""
    with pytest.raises(ValidationError, match=message):
        simulate_scan("disc", Shells(), geometry=few, **change)


def test_a_phantom_that_nobody_hears_is_refused(few):
    """An object outside the field of view, or before the record begins, gives no SNR and is an error."""
    with pytest.raises(ValidationError, match="it gives no signal"):
        simulate_scan(lambda grid: disc(grid, centre_m=(0.5, 0.0)), Shells(), geometry=few, pixels=51)
    late = replace(few, start_time_s=34.5e-6)
    with pytest.raises(ValidationError, match="it gives no signal"):
        simulate_scan(lambda grid: disc(grid, radius_m=1e-3), Shells(), geometry=late, pixels=51)


def test_importing_is_light():
    """Simulation and metrics bring neither numba, scikit-image nor scipy along before these are used."""
    code = (
        "import sys, oatkit; before = set(sys.modules); import oatkit.simulate, oatkit.metrics;"
        "new = {m.split('.')[0] for m in set(sys.modules) - before}; print(new & {'numba', 'skimage', 'scipy'})"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "set()"
