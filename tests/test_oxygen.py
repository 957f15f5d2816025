"""A body with vessels of known oxygen saturation, its light, and scans of it at many wavelengths."""

from functools import cache

import numpy as np
import pytest

import oatkit
from oatkit.data import Grid, Optics
from oatkit.errors import ValidationError
from oatkit.polygons import area
from oatkit.simulate import OxygenBody, illuminate, oxygen_phantom, simulate_multispectral, simulate_scan
from oatkit.simulate.oxygen import DEPTHS_M, GAP_M, SATURATIONS, SKIN_M, WHOLE_BLOOD_MOL_PER_M3
from oatkit.spectra import haemoglobin_absorption_per_m, lipid_absorption_per_m, water_absorption_per_m

GRID = Grid((230, 230), 0.1e-3)
COARSE_M = 0.5e-3
"""Between rings, where the light itself is not what is tested."""
ARC = oatkit.plugin("forward_model", "arc")()
SMALL = {"wavelengths_nm": (700, 800), "pixels": 61, "spacing_m": COARSE_M, "band": None}


@cache
def drawn(seed=0):
    """The body of a seed."""
    return OxygenBody.draw(seed)


@cache
def lit(spacing_m=COARSE_M):
    """The first body in the light of 760 nm on all of z."""
    return illuminate(drawn(), (760,), band=None, spacing_m=spacing_m)


@pytest.mark.parametrize("seed", range(6))
def test_vessels_are_where_they_are_said_to_be(seed):
    """Depths and saturations are evenly spread; vessels are 0.6 to 1.5 mm wide, apart and below the skin."""
    body = drawn(seed)
    vessels = body.vessels
    depths = np.array([body.depth_m(v.centre_m) for v in vessels])
    radii = np.array([v.half_axes_m[0] for v in vessels])
    assert np.sort(depths) == pytest.approx(np.linspace(*DEPTHS_M, 7), abs=1e-5)
    assert np.sort([v.tissue.oxygen_saturation for v in vessels]) == pytest.approx(np.linspace(*SATURATIONS, 7))
    assert ((radii >= 0.3e-3) & (radii <= 0.75e-3)).all()
    assert (depths - radii > SKIN_M).all()
    assert all(0.3 <= v.tissue.blood_volume <= 1 for v in vessels)
    for i, one in enumerate(vessels):
        for other in vessels[:i]:
            away = np.hypot(*np.subtract(one.centre_m, other.centre_m))
            assert away - one.half_axes_m[0] - other.half_axes_m[0] >= GAP_M


def test_order_of_saturations_does_not_follow_that_of_depths():
    """Over twenty bodies, depth and saturation of the vessels are uncorrelated to 0.2."""
    bodies = [drawn(seed) for seed in range(20)]
    found = [(b.depth_m(v.centre_m), v.tissue.oxygen_saturation) for b in bodies for v in b.vessels]
    assert abs(np.corrcoef(np.transpose(found))[0, 1]) < 0.2


@pytest.mark.parametrize("seed", range(6))
def test_a_body_fits_the_scanner(seed):
    """It is 19 to 22 mm across, 1 mm from the edge of 25 mm, and no circle."""
    outline = drawn(seed).outline_m
    across = np.ptp(outline, axis=0)
    radius = np.hypot(*outline.T)
    assert ((across > 19e-3) & (across < 22e-3)).all()
    assert abs(outline).max() < 11.5e-3
    assert np.ptp(radius) > 0.5e-3


def test_a_body_is_drawn_by_its_seed():
    """The same seed gives the same body, another seed another one."""
    one, again, other = (OxygenBody.draw(seed).total_haemoglobin(GRID) for seed in (4, 4, 5))
    assert one == again
    assert one != other


def test_all_of_the_body_is_one_tissue_or_another():
    """Shares sum up to 1 inside and 0 outside; their areas are those of outline and vessels, to 0.1 and 1 %."""
    body = drawn()
    shares, distance = body.shares(GRID), body.boundary(GRID).values[0]
    total = shares.sum(axis=0)
    assert (total[distance < -GRID.pixel_size_m] == 1).all()
    assert (total[distance > GRID.pixel_size_m] == 0).all()
    areas = shares.sum(axis=(1, 2)) * GRID.pixel_size_m**2
    assert areas.sum() == pytest.approx(area(body.outline_m), rel=1e-3)
    assert areas[-7:] == pytest.approx([np.pi * v.half_axes_m[0] ** 2 for v in body.vessels], rel=1e-2)


def test_absorption_holds_the_chromophores_that_the_truth_says():
    """Its spectrum in every pixel is oxy- and deoxyhaemoglobin of `so2` and `total_haemoglobin`, water and fat."""
    body, wavelengths = drawn(), tuple(range(680, 901, 20))
    blood = haemoglobin_absorption_per_m(wavelengths) / WHOLE_BLOOD_MOL_PER_M3
    spectra = np.array([*blood, water_absorption_per_m(wavelengths), lipid_absorption_per_m(wavelengths)])
    scale = np.linalg.norm(spectra, axis=1)
    absorption = body.absorption(GRID, wavelengths).values.reshape(12, -1)
    oxy, deoxy = (np.linalg.lstsq((spectra / scale[:, None]).T, absorption, rcond=None)[0] / scale[:, None])[:2]
    total = body.total_haemoglobin(GRID).values.ravel()
    so2 = body.so2(GRID).values.ravel()
    assert oxy + deoxy == pytest.approx(total, abs=1e-10)
    inside = total > 0
    assert oxy[inside] / (oxy + deoxy)[inside] == pytest.approx(so2[inside], abs=1e-8)
    assert np.isnan(so2[~inside]).all()


def test_oxygen_is_not_seen_where_the_spectra_cross():
    """At the isosbestic wavelength near 800 nm absorption does not depend on the saturation of the vessels; at 760 nm
    it does.
    """
    body = drawn()
    airless = body.with_saturations({v.name: 0.0 for v in body.vessels})
    fine = np.linspace(780, 820, 4001)
    oxy, deoxy = haemoglobin_absorption_per_m(fine)
    isosbestic = fine[np.argmin(abs(oxy - deoxy))]
    at = (isosbestic, 760.0)
    one, other = body.absorption(GRID, at).values, airless.absorption(GRID, at).values
    assert other[0] == pytest.approx(one[0], rel=1e-4)
    assert abs(other[1] / np.where(one[1] > 0, one[1], 1)).max() > 1.5


def test_regions_hold_one_tissue():
    """Eroded by a pixel's diagonal, the region of a vessel holds nothing but its blood and its saturation."""
    body = drawn()
    so2, haemoglobin = body.so2(GRID).values[0], body.total_haemoglobin(GRID).values[0]
    for vessel in body.vessels:
        mask = vessel.region(erode_m=0.15e-3).mask(GRID)
        assert mask.any()
        assert so2[mask] == pytest.approx(vessel.tissue.oxygen_saturation, rel=1e-12)
        blood = vessel.tissue.blood_volume * WHOLE_BLOOD_MOL_PER_M3
        assert haemoglobin[mask] == pytest.approx(blood, rel=1e-12)


def test_one_body_on_two_grids_holds_the_same_blood():
    """The amount of haemoglobin does not depend on the pixels, to 1e-3."""
    amounts = [
        drawn().total_haemoglobin(grid).values.sum() * grid.pixel_size_m**2
        for grid in (Grid((250, 250), 0.1e-3), Grid((83, 83), 25e-3 / 83))
    ]
    assert amounts[0] == pytest.approx(amounts[1], rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_light_that_corrects_agrees_with_light_that_simulates(seed):
    """Given the true optics, finite volumes and triangles differ by 1e-3 in the mean, less when both are refined."""
    body, model = drawn(seed), oatkit.plugin("fluence_model", "diffusion-fvm")()
    differences = []
    for pixel, spacing in ((0.3e-3, 0.24e-3), (0.15e-3, 0.12e-3)):
        grid = Grid((round(23.4e-3 / pixel),) * 2, pixel)
        # Of pixels that the wall cuts, the model wants the absorption of the part inside.
        inside = body.shares(grid).sum(axis=0)
        absorption = body.absorption(grid, (760,)).values / np.where(inside > 0, inside, 1)
        optics = Optics((760,), absorption, body.scattering_of_tissues((760,))[:, 0])
        boundary = body.boundary(grid)
        theirs = model.fluence(boundary, optics).values
        ours = illuminate(body, (760,), band=None, spacing_m=spacing).fluence(grid).values
        differences.append(np.sqrt(np.mean((ours / theirs - 1)[boundary.values < 0] ** 2)))
    assert differences[1] < 1e-3
    assert differences[1] < differences[0] / 2


def test_blood_without_oxygen_dims_the_light_around_it():
    """At 760 nm, where deoxyhaemoglobin absorbs more, less light is left everywhere without oxygen in the vessels."""
    airless = drawn().with_saturations({v.name: 0.0 for v in drawn().vessels})
    dim = illuminate(airless, (760,), band=None, spacing_m=COARSE_M)
    assert (dim.at_nodes < lit().at_nodes).all()


def test_a_band_of_light_reaches_less_deep_than_light_on_all_of_z():
    """Under a band of 8 mm the centre has 0.4 to 0.8 of the light in the plane."""
    band = illuminate(drawn(), (760,), spacing_m=COARSE_M)
    assert 0.4 < band.at_nodes[0, 0] / lit().at_nodes[0, 0] < 0.8


def test_pressure_is_absorption_times_light():
    """p0 = K mu_a Phi on any grid, and it moves with the body: by whole pixels, the image moves by whole pixels."""
    expected = 3 * drawn().absorption(GRID, (760,)).values * lit().fluence(GRID).values
    still, moved = (oxygen_phantom(lit(), 3.0, by)(GRID).values for by in ((0, 0), (0.5e-3, -0.2e-3)))
    assert still == pytest.approx(expected, rel=1e-14)
    differing = abs(moved - np.roll(still, (5, -2), axis=(1, 2))) > 1e-9 * expected.max()
    # Rounding moves some of the points that an edge crosses.
    assert differing.mean() < 2e-3


def test_one_state_is_the_scan_of_its_phantom():
    """Without a challenge or motion, the scan is what `simulate_scan` makes of the lit body, frame by frame."""
    scan = simulate_multispectral(drawn(), ARC, frames=2, seed=3, **SMALL)
    light = illuminate(drawn(), (700, 800), band=None, spacing_m=COARSE_M)
    expected = simulate_scan(oxygen_phantom(light), ARC, pixels=61, frames=2, seed=3)
    assert scan == expected
    assert scan.wavelengths_nm == (700.0, 800.0)


def test_frames_follow_challenge_and_motion():
    """Frames in one state are equal but for noise, others differ, and each is the scan of its own state."""
    name = drawn().vessels[0].name

    def saturations(frame):
        return {name: 0.9} if frame % 2 else {}

    def displacement_m(frame):
        return (0.3e-3, 0.0) if frame == 2 else (0.0, 0.0)

    scan = simulate_multispectral(
        drawn(), ARC, frames=5, snr_db=None, saturations=saturations, displacement_m=displacement_m, **SMALL
    )
    signals = np.asarray(scan.signals)
    assert scan.frames == 5
    assert (signals[1] == signals[3]).all()
    assert (signals[0] == signals[4]).all()
    assert all((signals[0] != signals[i]).any() for i in (1, 2))
    changed = simulate_multispectral(drawn().with_saturations({name: 0.9}), ARC, snr_db=None, **SMALL)
    assert (np.asarray(changed.signals)[0] == signals[1]).all()


def test_noise_differs_in_every_frame_of_every_state():
    """Two frames that differ in nothing else, and two states, have each a noise of their own."""
    scan = simulate_multispectral(
        drawn(), ARC, frames=4, snr_db=0.0, displacement_m=lambda frame: (0.0, 1e-5 * (frame % 2)), **SMALL
    )
    flat = np.asarray(scan.signals).reshape(4, -1).astype(float)
    clean = simulate_multispectral(drawn(), ARC, snr_db=None, **SMALL)
    noise = flat - np.asarray(clean.signals).ravel()
    correlation = np.corrcoef(noise)
    assert abs(correlation[np.triu_indices(4, 1)]).max() < 0.1


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: drawn().with_saturations({"vesel-1": 0.5}), "did you mean 'vessel-1'"),
        (lambda: drawn().with_saturations({"vessel-1": 1.2}), "saturation of vessel-1"),
        (lambda: drawn().with_saturations({"vessel-1": np.nan}), "saturation of vessel-1"),
        (lambda: drawn().vessels[0].region(erode_m=1e-2), "nothing of the inclusion"),
        (lambda: drawn().absorption(GRID, (680e-9,)), "700e-9 m is 700"),
        (lambda: OxygenBody.draw(0, n_vessels=50), "do not fit"),
        (lambda: simulate_multispectral(drawn(), ARC, displacement_m=lambda _: (0.3, 0.0), **SMALL), "0.3 mm is 3e-4"),
        (lambda: simulate_multispectral(drawn(), ARC, calibration=np.nan, **SMALL), "calibration"),
        (lambda: simulate_multispectral(drawn(), ARC, frames=0, **SMALL), "at least one frame"),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_refused(ask, words):
    """Unknown vessels, saturations that are none, lengths and wavelengths in other units."""
    with pytest.raises(ValidationError, match=words):
        ask()
