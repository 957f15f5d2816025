"""Unmixing: exact solutions, derived images, and what is said where the data cannot carry what is asked."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

import oatkit
from oatkit.api import Grid, Image, UnmixProblem
from oatkit.builtin.unmixers.nonnegative import least_squares, nonnegative
from oatkit.errors import ValidationError
from oatkit.spectra import CHROMOPHORES

Nnls, Lstsq = oatkit.plugin("unmixer", "nnls"), oatkit.plugin("unmixer", "lstsq")
PAPER_NM = tuple(np.arange(680.0, 901.0, 20.0))
BLOOD = ("oxyhaemoglobin", "deoxyhaemoglobin")


def spectra(names, wavelengths=PAPER_NM):
    """The matrix of spectra, (wavelength, chromophore)."""
    return np.stack([CHROMOPHORES[name].spectrum(wavelengths) for name in names], axis=1)


def absorption(values, wavelengths=PAPER_NM, unit="1/m", quantity="absorption"):
    """An image with these values."""
    values = np.asarray(values, float)
    return Image(values, quantity, unit, Grid(values.shape[1:], 1e-4), wavelengths)


def unmixed(unmixer, image):
    """What an unmixer makes of an image of absorption."""
    return unmixer.unmix(UnmixProblem(absorption(np.ones_like(image.values), image.wavelengths_nm), image))


def mixed(names, concentrations, wavelengths=PAPER_NM):
    """The absorption of known concentrations, (chromophore, y, x)."""
    return absorption(np.tensordot(spectra(names, wavelengths), concentrations, 1), wavelengths)


@pytest.mark.parametrize(
    "names", [BLOOD[:1], BLOOD, (*BLOOD, "water"), (*BLOOD, "water", "melanin"), tuple(CHROMOPHORES)], ids=len
)
def test_all_pixels_at_once_equal_scipy_pixel_by_pixel(names):
    """Non-negative least squares equals `scipy.optimize.nnls` to 1e-10 of the largest, with noise and empty pixels."""
    matrix, rng = spectra(names), np.random.default_rng(len(names))
    shares = rng.random((600, len(names))) * rng.integers(0, 2, (600, len(names))) / np.linalg.norm(matrix, axis=0)
    data = shares @ matrix.T + 0.05 * rng.standard_normal((600, len(PAPER_NM)))
    data[:5] = 0
    expected = np.array([nnls(matrix, row)[0] for row in data])
    size = np.linalg.norm(matrix, axis=0)
    found = nonnegative(matrix, data)
    assert abs((found - expected) * size).max() <= 1e-10 * (expected * size).max()
    assert (found >= 0).all()


@settings(max_examples=60, deadline=None)
@given(unknowns=st.integers(1, 7), extra=st.integers(0, 5), decades=st.integers(0, 6), seed=st.integers(0, 10**6))
def test_solutions_obey_the_conditions_of_kkt(unknowns, extra, decades, seed):
    """For random spectra of any scale: x >= 0, slope >= 0, and x times slope is zero, to rounding."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-decades, decades, unknowns)
    matrix = rng.standard_normal((unknowns + extra, unknowns)) * scale
    data = rng.standard_normal((50, unknowns + extra))
    found = nonnegative(matrix, data)
    normal = matrix / np.linalg.norm(matrix, axis=0)
    slope = (found @ matrix.T - data) @ normal
    loss = 1e-9 * np.linalg.cond(normal) * np.linalg.norm(data, axis=1)
    assert (found >= 0).all()
    assert (slope >= -loss[:, None]).all()
    assert (abs(slope[found > 0]) <= np.broadcast_to(loss[:, None], slope.shape)[found > 0]).all()


def test_least_squares_is_numpys():
    """Without bounds, every pixel equals `numpy.linalg.lstsq`."""
    matrix, rng = spectra((*BLOOD, "water")), np.random.default_rng(0)
    data = rng.standard_normal((40, len(PAPER_NM)))
    expected = np.linalg.lstsq(matrix, data.T, rcond=None)[0].T
    assert least_squares(matrix, data) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("unmixer", [Nnls, Lstsq])
def test_exact_data_give_back_the_concentrations(unmixer):
    """Mixtures of known concentrations are taken apart exactly; the residual is zero; units are those of the tables."""
    true = np.random.default_rng(1).random((3, 4, 5)) * np.array([2.0, 1.0, 0.7])[:, None, None]
    names = (*BLOOD, "water")
    images = unmixed(unmixer(chromophores=names), mixed(names, true))
    for name, plane in zip(names, true, strict=True):
        assert images[name].values[0] == pytest.approx(plane, rel=1e-5, abs=1e-6)
        assert images[name].wavelengths_nm == ()
    assert images["so2"].values[0] == pytest.approx(true[0] / (true[0] + true[1]), abs=1e-5)
    assert images["total_haemoglobin"].values[0] == pytest.approx(true[0] + true[1], rel=1e-5)
    assert images["residual"].values.max() < 1e-6
    units = {name: image.unit for name, image in images.items()}
    assert units == {
        "oxyhaemoglobin": "mol/m^3", "deoxyhaemoglobin": "mol/m^3", "water": "", "total_haemoglobin": "mol/m^3",
        "so2": "", "residual": "",
    }  # fmt: skip


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 12))
def test_saturation_lies_between_0_and_1_or_is_undefined(seed, n):
    """Whatever the data, even noise about zero: so2 of nnls is in [0, 1] or NaN, and the total is never negative."""
    rng = np.random.default_rng(seed)
    wavelengths = tuple(sorted(rng.choice(np.arange(680.0, 900.0), n, replace=False)))
    image = absorption(rng.standard_normal((n, 6, 7)), wavelengths)
    images = unmixed(Nnls(), image)
    so2 = images["so2"].values
    assert (np.isnan(so2) | ((so2 >= 0) & (so2 <= 1))).all()
    assert (images["total_haemoglobin"].values >= 0).all()


def test_saturation_is_undefined_below_its_floor():
    """so2 is NaN where total haemoglobin does not exceed `so2_floor` times its 99th percentile, which is recorded."""
    total = np.linspace(0, 1, 101)[None]
    images = unmixed(Nnls(so2_floor=0.5), mixed(BLOOD, np.stack([0.7 * total, 0.3 * total])))
    least = images["so2"].diagnostics["least_haemoglobin"]
    assert least == pytest.approx(0.5 * np.percentile(total, 99))
    assert (np.isnan(images["so2"].values[0]) == (images["total_haemoglobin"].values[0] <= np.float32(least))).all()


def test_bounds_matter_only_where_they_bind():
    """Where least squares is not negative both unmixers agree; elsewhere nnls has zeros and lstsq negative numbers."""
    rng = np.random.default_rng(3)
    image = mixed(BLOOD, rng.random((2, 20, 20)))
    noisy = absorption(image.values + 40 * rng.standard_normal(image.values.shape))
    free, bounded = unmixed(Lstsq(), noisy), unmixed(Nnls(), noisy)
    fine = (free["oxyhaemoglobin"].values >= 0) & (free["deoxyhaemoglobin"].values >= 0)
    assert 0 < fine.sum() < fine.size
    for name in BLOOD:
        assert bounded[name].values[fine] == pytest.approx(free[name].values[fine], rel=1e-5)
        assert (bounded[name].values[~fine] >= 0).all()
    assert (bounded["residual"].values >= free["residual"].values - 1e-6).all()


def test_the_order_of_wavelengths_does_not_matter():
    """Unsorted and repeated wavelengths give what sorted ones give; a repetition counts as a second measurement."""
    rng = np.random.default_rng(4)
    image = absorption(rng.random((12, 5, 5)))
    order = rng.permutation(12)
    shuffled = absorption(image.values[order], tuple(np.array(PAPER_NM)[order]))
    twice = absorption(np.concatenate([image.values, image.values]), PAPER_NM * 2)
    for other in (shuffled, twice):
        for name in (*BLOOD, "so2"):
            assert unmixed(Nnls(), other)[name].values == pytest.approx(unmixed(Nnls(), image)[name].values, rel=1e-5)


def test_too_few_wavelengths_fit_fewer_chromophores():
    """At two different wavelengths, one of them repeated, the first two of three are fitted, and the notes say it."""
    names, wavelengths = (*BLOOD, "water"), (700.0, 850.0, 700.0)
    true = np.random.default_rng(5).random((2, 3, 3))
    images = unmixed(Nnls(chromophores=names), mixed(BLOOD, true, wavelengths))
    assert "water" not in images
    assert images["deoxyhaemoglobin"].values[0] == pytest.approx(true[1], rel=1e-5)
    assert "water left out" in images["oxyhaemoglobin"].diagnostics["notes"][0]


def test_one_wavelength_has_no_saturation():
    """A single wavelength gives one chromophore and neither so2 nor a total."""
    assert set(unmixed(Nnls(), absorption(np.ones((1, 3, 3)), (800.0,)))) == {"oxyhaemoglobin", "residual"}


def test_undefined_pixels_stay_undefined():
    """A pixel that is NaN at one wavelength is NaN in every image, and no other is touched."""
    values = np.random.default_rng(6).random((12, 4, 4))
    hurt = values.copy()
    hurt[3, 1, 2] = np.nan
    whole, holed = (unmixed(Nnls(), absorption(v)) for v in (values, hurt))
    for name in whole:
        assert np.isnan(holed[name].values[0, 1, 2])
        rest = np.ones((4, 4), bool)
        rest[1, 2] = False
        assert (holed[name].values[0][rest] == whole[name].values[0][rest]).all()


def test_noise_counts_a_bad_wavelength_less():
    """With sigma given, the solution is that of least squares weighted by 1 / sigma^2."""
    rng = np.random.default_rng(7)
    sigma = rng.uniform(0.1, 3, 12)
    data = mixed(BLOOD, rng.random((2, 3, 3))).values + rng.standard_normal((12, 3, 3))
    found = unmixed(Nnls(noise=tuple(sigma)), absorption(data))
    matrix = spectra(BLOOD) / sigma[:, None]
    expected = np.array([nnls(matrix, row / sigma)[0] for row in data.reshape(12, -1).T]).T.reshape(2, 3, 3)
    assert found["oxyhaemoglobin"].values[0] == pytest.approx(expected[0], rel=1e-5, abs=1e-6)
    with pytest.raises(ValidationError, match="12 wavelengths"):
        unmixed(Nnls(noise=(1.0, 2.0)), absorption(data))


@pytest.mark.parametrize("unmixer", [Nnls, Lstsq])
def test_normalising_changes_nothing_but_rounding(unmixer):
    """Spectra scaled to length one give the same concentrations as unscaled ones."""
    image = absorption(np.random.default_rng(8).random((12, 5, 5)))
    names = (*BLOOD, "water", "melanin")
    scaled, plain = (unmixed(unmixer(chromophores=names, normalise=flag), image) for flag in (True, False))
    for name in names:
        assert scaled[name].values == pytest.approx(plain[name].values, rel=1e-4, abs=1e-9)


def test_without_calibration_concentrations_have_no_unit():
    """From absorption in arbitrary units come concentrations in arbitrary units, and the same so2."""
    image = mixed(BLOOD, np.random.default_rng(9).random((2, 3, 3)))
    scaled = absorption(image.values * 1e-3, unit="a.u.")
    one, other = unmixed(Nnls(), image), unmixed(Nnls(), scaled)
    assert other["total_haemoglobin"].unit == "a.u."
    assert other["so2"].values == pytest.approx(one["so2"].values, abs=1e-6)


def test_without_absorption_the_pressure_is_unmixed():
    """A pipeline without absorption gets the chromophores of its pressure, and the diagnostics say so."""
    pressure = absorption(np.random.default_rng(10).random((12, 3, 3)), unit="a.u.", quantity="initial_pressure")
    images = Nnls().unmix(UnmixProblem(pressure))
    assert images["so2"].diagnostics["fitted_to"] == "initial_pressure"


def test_spectra_that_cannot_be_told_apart_are_reported():
    """Three neighbouring wavelengths cannot tell blood and water apart: a note gives the condition number."""
    names, wavelengths = (*BLOOD, "water"), (850.0, 851.0, 852.0)
    images = unmixed(Nnls(chromophores=names), absorption(np.ones((3, 2, 2)), wavelengths))
    assert images["so2"].diagnostics["condition"] > 100
    assert "hard to tell apart" in images["oxyhaemoglobin"].diagnostics["notes"][0]


@pytest.mark.parametrize(
    ("changes", "wavelengths", "text"),
    [
        ({"chromophores": ()}, PAPER_NM, "one or more different names"),
        ({"chromophores": ("water", "water")}, PAPER_NM, "one or more different names"),
        ({"chromophores": ("oxyhemoglobin",)}, PAPER_NM, "did you mean 'oxyhaemoglobin'"),
        ({"chromophores": ("icg",)}, tuple(np.arange(600.0, 821.0, 20.0)), "600 nm"),
    ],
)
def test_what_cannot_be_unmixed_is_refused(changes, wavelengths, text):
    """Empty, doubled and unknown chromophores, and wavelengths beyond a table, are refused with the reason."""
    with pytest.raises(ValidationError, match=text):
        unmixed(Nnls(**changes), absorption(np.ones((12, 2, 2)), wavelengths))


def test_a_table_of_the_user_is_found_beside_the_pipeline(tmp_path):
    """Paths of spectra in a pipeline file are relative to the file."""
    (tmp_path / "dye.csv").write_text("wavelength_nm,dye\n600,1\n1000,1\n")
    text = (
        oatkit.Pipeline.load("lsqr").to_toml()
        + '\n[unmix]\nuse = "nnls"\nchromophores = ["dye"]\ntables = ["dye.csv"]\n'
    )
    pipeline = oatkit.Pipeline.loads(text, folder=tmp_path)
    images = unmixed(pipeline.unmix, absorption(np.full((12, 2, 2), 3.0)))
    assert images["dye"].values == pytest.approx(np.full((1, 2, 2), 3.0))
    assert oatkit.Pipeline.loads(pipeline.to_toml()) == pipeline
