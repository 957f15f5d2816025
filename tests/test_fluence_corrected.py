"""Unmixing with its own light: the blood that made the data comes out, and what cannot be trusted is said."""

from functools import cache

import numpy as np
import pytest

import oatkit
from oatkit.api import Grid, Image, Optics, UnmixProblem
from oatkit.errors import ValidationError
from oatkit.light import CoarseLight
from oatkit.simulate import OxygenBody, illuminate
from oatkit.spectra import CHROMOPHORES, tissue_optics

WAVELENGTHS = (700.0, 760.0, 800.0, 850.0, 900.0)
GRID = Grid((100, 100), 25e-3 / 100)
NAMES = ("oxyhaemoglobin", "deoxyhaemoglobin", "water")
MODEL = oatkit.plugin("fluence_model", "diffusion-fvm")(band_width=8.0)
FluenceCorrected, Nnls = oatkit.plugin("unmixer", "fluence-corrected"), oatkit.plugin("unmixer", "nnls")
BODY = OxygenBody.draw(1)
BOUNDARY = BODY.boundary(GRID)
INSIDE = BOUNDARY.values[0] < 0
OPTICS = tissue_optics("soft-tissue", WAVELENGTHS)


@cache
def lit():
    """The body in its light, computed with finite elements on triangles."""
    return illuminate(BODY, WAVELENGTHS, spacing_m=0.15e-3)


@cache
def pressure(grid=GRID) -> Image:
    """What the body would show without noise; K = 1."""
    return lit().pressure(grid)


@cache
def homogeneous() -> Image:
    """The light of the body that one assumes."""
    return MODEL.fluence(BOUNDARY, OPTICS)


def problem(calibration=1.0, image=None, optics=OPTICS):
    """What the pipeline hands to the unmixer."""
    image = image or pressure()
    boundary = BODY.boundary(image.grid)
    return UnmixProblem(image, None, boundary, MODEL.fluence(boundary, optics), MODEL, optics, calibration)


@cache
def corrected(calibration=1.0, **changes):
    """The images of the corrected unmixing."""
    return FluenceCorrected(**{"chromophores": NAMES, "probe": 0.0, **changes}).unmix(problem(calibration))


def errors(images):
    """|so2 found - true| of each vessel, as the mean over its inner pixels, by the depth of its centre in mm."""
    found = {}
    for vessel in BODY.vessels:
        mask = vessel.region(0.1e-3).mask(GRID)
        oxy, total = (images[name].values[0][mask].mean() for name in ("oxyhaemoglobin", "total_haemoglobin"))
        depth = -1e3 * BOUNDARY.values[0][mask].mean()
        found[depth] = abs(oxy / total - vessel.tissue.oxygen_saturation)
    return found


def deep(images):
    """The mean error of the vessels below 3 mm."""
    return np.mean([error for depth, error in errors(images).items() if depth > 3])


def test_the_saturation_of_deep_vessels_comes_out():
    """With light from finite elements and K known, deep vessels are within 0.01, five times nearer than raw ones."""
    raw = Nnls(chromophores=NAMES).unmix(UnmixProblem(pressure()))
    assert deep(corrected()) < 0.01
    assert deep(corrected()) < 0.2 * deep(raw)


def test_the_spectra_tell_the_calibration():
    """K comes out within 3 % of the true one, and the best of those tried misfits a third of the worst or less."""
    found = FluenceCorrected(chromophores=NAMES).calibrate(problem(None))
    assert found.value == pytest.approx(1.0, rel=0.03)
    misfits = [misfit for _, misfit in found.curve]
    assert min(misfits) < max(misfits) / 3


def test_the_calibration_by_spectra_makes_up_for_a_wrong_scattering():
    """With mu_s' 20 % too high, K by the spectra halves the error of the true K, and is nearer than no correction."""
    wrong = Optics(WAVELENGTHS, OPTICS.absorption_per_m, 1.2 * OPTICS.reduced_scattering_per_m)
    unmixer = FluenceCorrected(chromophores=NAMES, probe=0.0)
    found = unmixer.calibrate(problem(None, optics=wrong))
    by_spectra, by_hand = (deep(unmixer.unmix(problem(k, optics=wrong))) for k in (found.value, 1.0))
    assert by_spectra < 0.5 * by_hand
    assert by_spectra < deep(Nnls(chromophores=NAMES).unmix(UnmixProblem(pressure())))


def test_spectra_that_fit_anything_tell_no_calibration():
    """Three chromophores at three wavelengths fit every spectrum: no K is found, and the note says why."""
    few = Image(pressure().values[:3], "initial_pressure", "a.u.", GRID, WAVELENGTHS[:3])
    found = FluenceCorrected(chromophores=NAMES).calibrate(
        problem(None, few, tissue_optics("soft-tissue", WAVELENGTHS[:3]))
    )
    assert found.value is None
    assert "fit any spectrum" in found.notes[0]


def test_other_unmixers_say_that_they_cannot_calibrate():
    """`nnls` refuses to find a calibration and names the unmixer that can."""
    with pytest.raises(ValidationError, match=r"'nnls' finds no calibration.*'fluence-corrected'"):
        Nnls().calibrate(problem(None))


def test_a_stated_mean_takes_the_place_of_the_calibration():
    """Without K the mean absorption of the body is the one stated, exactly, and deep vessels are still twice nearer."""
    images = corrected(None)
    fitted = sum(
        images[name].values[0].astype(float) * np.mean(CHROMOPHORES[name].spectrum(WAVELENGTHS)) for name in NAMES
    )
    assert fitted[INSIDE].mean() == pytest.approx(OPTICS.absorption_per_m.mean(), rel=1e-4)
    raw = Nnls(chromophores=NAMES).unmix(UnmixProblem(pressure()))
    assert deep(images) < 0.5 * deep(raw)
    assert "no calibration is known" in images["oxyhaemoglobin"].diagnostics["notes"][0]


def test_pressure_is_absorption_times_light():
    """Where the passes rest, p0 = K mu_a Phi in every pixel above the floor, and Phi is the light of that mu_a."""
    images = corrected(1.0, tolerance=1e-6, passes=60)
    light, mu_a = images["fluence"].values, images["absorption"].values
    above = INSIDE & (light > 0.021 * light[:, INSIDE].max(1)[:, None, None])
    assert (mu_a * light)[above] == pytest.approx(pressure().values[above], rel=1e-5)
    assert np.isnan(mu_a[:, ~INSIDE]).all()
    fitted = np.stack([images[name].values[0] for name in NAMES])
    spectra = np.stack([CHROMOPHORES[name].spectrum(WAVELENGTHS) for name in NAMES], axis=1)
    seen = np.where(INSIDE, np.tensordot(spectra, fitted, 1), 1.0)
    again = MODEL.fluence(BOUNDARY, Optics(WAVELENGTHS, seen, OPTICS.reduced_scattering_per_m)).values
    assert light[:, INSIDE] == pytest.approx(again[:, INSIDE], rel=1e-4)


def test_only_the_product_of_pressure_and_calibration_counts():
    """Signals and K three times as large give the same images."""
    scaled = Image(3 * pressure().values, "initial_pressure", "a.u.", GRID, WAVELENGTHS)
    one = FluenceCorrected(probe=0.0, light_pixel=0.5).unmix(problem(1.0))
    other = FluenceCorrected(probe=0.0, light_pixel=0.5).unmix(problem(3.0, scaled))
    for name in one:
        assert other[name].values == pytest.approx(one[name].values, rel=1e-4, abs=1e-6, nan_ok=True)


def test_the_passes_are_recorded():
    """The change of each pass but the first is kept, the last within the tolerance; so2 lies in [0, 1] or is NaN."""
    so2 = corrected()["so2"]
    told = so2.diagnostics
    assert told["settled"]
    assert not told["diverged"]
    assert len(told["change"]) == told["passes"] - 1
    assert told["change"][-1] <= 1e-3 < told["change"][-2]
    assert np.isnan(so2.values[0][~INSIDE]).all()
    assert ((so2.values[0][INSIDE] >= 0) & (so2.values[0][INSIDE] <= 1) | np.isnan(so2.values[0][INSIDE])).all()


def test_too_few_passes_are_reported():
    """Two passes do not rest: the note gives the last change and says what to raise."""
    notes = corrected(1.0, passes=2)["oxyhaemoglobin"].diagnostics["notes"]
    assert any("raise unmix.passes" in note for note in notes)


@pytest.mark.parametrize(("calibration", "diverged"), [(0.4, True), (0.8, True), (1.0, False), (1.25, False)])
def test_a_calibration_that_is_too_low_runs_away(calibration, diverged):
    """K 20 % too low drives deep vessels to the limit, which is said, and all stays finite; 25 % too high does not."""
    images = corrected(calibration, light_pixel=0.5)
    told = images["so2"].diagnostics
    assert told["diverged"] is diverged
    assert told["settled"] is not diverged
    assert any("ran away" in note for note in images["oxyhaemoglobin"].diagnostics["notes"]) is diverged
    assert np.isfinite(images["fluence"].values).all()
    assert np.isfinite(images["absorption"].values[:, INSIDE]).all()


def test_the_sensitivities_are_what_another_run_would_give():
    """The maps are so2 of a run with mu_s', or K, 20 % higher, minus so2, where light is on the pixels of the image."""
    image = pressure(Grid((50, 50), 25e-3 / 50))
    more = Optics(WAVELENGTHS, OPTICS.absorption_per_m, 1.2 * OPTICS.reduced_scattering_per_m)
    images = FluenceCorrected(tolerance=1e-6, passes=60).unmix(problem(1.0, image))
    quiet = FluenceCorrected(tolerance=1e-6, passes=60, probe=0.0)
    for name, altered in (
        ("so2_sensitivity_scattering", quiet.unmix(problem(1.0, image, more))),
        ("so2_sensitivity_calibration", quiet.unmix(problem(1.2, image))),
    ):
        expected = altered["so2"].values - images["so2"].values
        known = np.isfinite(expected)
        assert known.sum() > 1000
        assert abs(expected[known]).max() > 1e-3
        assert images[name].values[known] == pytest.approx(expected[known], abs=1e-4)


def test_without_a_model_of_light_it_says_what_is_missing():
    """A pipeline without outline or light is refused, with the tables to add and the unmixer to take instead."""
    with pytest.raises(ValidationError, match=r"\[segment\] and \[fluence\].*'nnls'"):
        FluenceCorrected().unmix(UnmixProblem(pressure()))


def test_nothing_is_found_in_an_empty_image():
    """An image of zeros gives concentrations of zero, so2 undefined everywhere, and no warning of numpy's."""
    empty = Image(np.zeros((5, 100, 100)), "initial_pressure", "a.u.", GRID, WAVELENGTHS)
    images = FluenceCorrected(light_pixel=1.0).unmix(problem(None, empty))
    assert (images["total_haemoglobin"].values[0][INSIDE] == 0).all()
    assert np.isnan(images["so2"].values).all()


@pytest.mark.parametrize("factor", [1, 2, 3, 7])
def test_coarse_light_of_the_homogeneous_body_is_its_light(factor):
    """Whatever the blocks, also such as do not divide the image, nothing is added to what is known."""
    light = CoarseLight(MODEL, BOUNDARY, OPTICS, homogeneous().values, factor)
    mu_a = np.broadcast_to(OPTICS.absorption_per_m[:, None, None], homogeneous().values.shape)
    assert light.light(mu_a) == pytest.approx(homogeneous().values, rel=1e-12)


def test_coarse_light_nears_that_of_the_full_grid():
    """Halving the blocks brings the light of the true absorption nearer to the one on the image's own pixels."""
    mu_a = np.where(INSIDE, BODY.absorption(GRID, WAVELENGTHS).values, 0.0)
    lights = [CoarseLight(MODEL, BOUNDARY, OPTICS, homogeneous().values, f).light(mu_a)[:, INSIDE] for f in (4, 2, 1)]
    coarse, fine = (np.linalg.norm(light - lights[2]) / np.linalg.norm(lights[2]) for light in lights[:2])
    assert fine < 0.6 * coarse
    assert fine < 0.02


def test_the_preset_unmixes_a_scan():
    """`multispectral` runs from signals to so2 in [0, 1] or NaN on a small scan of three wavelengths."""
    from oatkit.simulate import simulate_multispectral

    arc = oatkit.plugin("forward_model", "arc")()
    scan = simulate_multispectral(BODY, arc, wavelengths_nm=(700, 800, 850), spacing_m=0.3e-3, pixels=211)
    changes = ["grid.pixels=60", "reconstruct.n_iterations=20", "unmix.passes=3", "preprocess.band-pass.high=1.5"]
    pipeline = oatkit.Pipeline.load("multispectral", changes)
    result = oatkit.run(pipeline, scan)
    so2 = result["so2"].values
    assert so2.shape == (1, 60, 60)
    assert np.isfinite(so2).sum() > 300
    assert (np.isnan(so2) | ((so2 >= 0) & (so2 <= 1))).all()
    assert result["so2"].history[-1]["use"] == "fluence-corrected"
    assert any("the spectra tell no calibration" in note for note in result.warnings)


def test_the_calibration_is_found_once_for_a_scan(tmp_path):
    """With four wavelengths the preset finds K on the first frame and runs all with it; the result keeps the curve."""
    from oatkit.simulate import simulate_multispectral

    arc = oatkit.plugin("forward_model", "arc")()
    scan = simulate_multispectral(
        BODY, arc, wavelengths_nm=(700, 760, 800, 850), spacing_m=0.3e-3, pixels=211, frames=2
    )
    changes = ["grid.pixels=60", "reconstruct.n_iterations=20", "unmix.probe=0", "preprocess.band-pass.high=1.5"]
    stored = oatkit.run_frames(oatkit.Pipeline.load("multispectral", changes), scan, tmp_path / "out.zarr")
    found = stored.calibration_choice["calibration"]
    assert stored.pipeline["absorption"]["calibration"] == pytest.approx(found)
    assert len(stored.calibration_choice["tried"]) == len(stored.calibration_choice["misfit"]) > 5
    for index in range(2):
        assert stored.frame(index)["so2"].diagnostics["calibration"] == pytest.approx(found)
    again = oatkit.run(oatkit.Pipeline.loads(oatkit.Pipeline.load("multispectral", changes).to_toml()), scan, frame=1)
    assert (again["so2"].values == stored.frame(1)["so2"].values)[np.isfinite(again["so2"].values)].all()
