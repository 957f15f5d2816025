"""Figures of merit against hand-made images, other definitions and scikit-image."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from oatkit import metrics
from oatkit.errors import ValidationError

COMPARISONS = [metrics.rmse, metrics.psnr, metrics.ssim, metrics.fitted_scale]
ALONE = [metrics.sharpness, metrics.negative_pixels]


@pytest.fixture
def truth(rng):
    """A smooth positive image of 40 x 30."""
    return gaussian_filter(rng.random((40, 30)), 2) + 0.1


@pytest.fixture
def rng():
    """A seeded generator."""
    return np.random.default_rng(7)


def half(shape):
    """A mask of the lower rows."""
    mask = np.zeros(shape, bool)
    mask[: shape[0] // 2] = True
    return mask


def test_sharpness_of_a_ramp_is_its_squared_slope():
    """A plane with slopes a and b has the sharpness a^2 + b^2, edges included."""
    y, x = np.mgrid[:9, :14]
    assert metrics.sharpness(0.3 * y - 2.0 * x + 5) == pytest.approx(0.3**2 + 2.0**2, rel=1e-13)


def test_sharpness_of_a_wave_is_that_of_its_central_difference():
    """cos(kx) over whole periods has the mean squared central difference sin(k)^2 / 2, away from the edges."""
    k = 2 * np.pi / 10
    image = np.cos(k * np.arange(42)) * np.ones((5, 1))
    inner = np.zeros(image.shape, bool)
    inner[:, 1:41] = True
    assert metrics.sharpness(image, inner) == pytest.approx(np.sin(k) ** 2 / 2, rel=1e-12)


def test_psnr_of_a_known_error(truth):
    """An offset of a tenth of the maximum gives 20 dB, and the peak is the truth's, not the image's."""
    assert metrics.psnr(truth + 0.1 * truth.max(), truth) == pytest.approx(20, abs=1e-10)
    assert metrics.psnr(truth, truth) == np.inf


def test_psnr_is_that_of_scikit_image(truth, rng):
    """With max(truth) as the data range, both are the same number."""
    image = truth + 0.05 * rng.standard_normal(truth.shape)
    assert metrics.psnr(image, truth) == pytest.approx(
        peak_signal_noise_ratio(truth, image, data_range=truth.max()), rel=1e-13
    )


@pytest.mark.parametrize("metric", [metrics.rmse, metrics.psnr, metrics.fitted_scale])
def test_the_mask_cuts_the_image(metric, truth, rng):
    """Masking rows is the same as handing in the others alone: their errors and their peak do not count."""
    truth[30, 5] = 2 * truth.max()
    image = truth + 0.05 * rng.standard_normal(truth.shape)
    image[20:] = 3.0
    masked = metric(image, truth, half(truth.shape))
    assert masked == pytest.approx(metric(image[:20], truth[:20]), rel=1e-13)
    assert masked != pytest.approx(metric(image, truth), rel=1e-2)


def test_the_mask_of_ssim_cuts_its_map(truth, rng):
    """It is the mean of scikit-image's map over the pixels of the mask that are 5 or more from the edge."""
    image = truth + 0.05 * rng.standard_normal(truth.shape)
    similarity = structural_similarity(
        image, truth, data_range=truth.max(), gaussian_weights=True, use_sample_covariance=False, full=True
    )[1]
    expected = similarity[5:20, 5:-5].mean()
    assert metrics.ssim(image, truth, half(truth.shape)) == pytest.approx(expected, rel=1e-13)


def test_ssim_is_that_of_scikit_image(truth, rng):
    """Without a mask it is scikit-image's mean with the parameters of Wang et al. and max(truth) as the range."""
    image = truth + 0.05 * rng.standard_normal(truth.shape)
    theirs = structural_similarity(
        image, truth, data_range=truth.max(), gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    assert metrics.ssim(image, truth) == pytest.approx(theirs, rel=1e-12)
    assert theirs < 0.95


def test_ssim_follows_its_formula(truth, rng):
    """At a pixel it is the formula, evaluated by hand with an 11 x 11 Gaussian window of 1.5 pixels."""
    image = truth + 0.05 * rng.standard_normal(truth.shape)
    window = np.exp(-np.add.outer(np.arange(-5, 6) ** 2, np.arange(-5, 6) ** 2) / (2 * 1.5**2))
    window /= window.sum()
    a, b = image[10:21, 8:19], truth[10:21, 8:19]
    mean_a, mean_b = (window * a).sum(), (window * b).sum()
    var_a, var_b = (window * (a - mean_a) ** 2).sum(), (window * (b - mean_b) ** 2).sum()
    covariance = (window * (a - mean_a) * (b - mean_b)).sum()
    c1, c2 = (0.01 * truth.max()) ** 2, (0.03 * truth.max()) ** 2
    expected = (2 * mean_a * mean_b + c1) * (2 * covariance + c2)
    expected /= (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    one = np.zeros(truth.shape, bool)
    one[15, 13] = True
    assert metrics.ssim(image, truth, one) == pytest.approx(expected, rel=1e-10)


def test_negative_pixels_are_those_below_zero(truth):
    """Neither 0 nor -0 is negative, and the share is that of the pixels looked at."""
    image = truth.copy()
    image[0, :6] = -1e-300
    image[1, :] = -0.0
    image[-1, :3] = -5
    assert metrics.negative_pixels(image) == metrics.NegativePixels(9, 9 / 1200)
    assert metrics.negative_pixels(image, half(image.shape)) == metrics.NegativePixels(6, 6 / 600)


def test_fitted_scale_leaves_an_orthogonal_error(truth, rng):
    """After scaling, the error is orthogonal to the image, so that no other factor comes nearer."""
    image = 30 * truth + rng.standard_normal(truth.shape)
    scale = metrics.fitted_scale(image, truth)
    assert abs(np.vdot(scale * image - truth, image)) <= 1e-12 * np.linalg.norm(truth) * np.linalg.norm(image)
    best = metrics.rmse(scale * image, truth)
    assert all(metrics.rmse(factor * scale * image, truth) > best for factor in (0.999, 1.001))


def test_fitted_scale_makes_the_comparison_blind_to_scale(truth, rng):
    """PSNR after fitting is the same for an image and any multiple of it."""
    image = truth + 0.05 * rng.standard_normal(truth.shape)
    values = [metrics.psnr(metrics.fitted_scale(k * image, truth) * k * image, truth) for k in (1, 1e-6, 4e5)]
    assert values == pytest.approx([values[0]] * 3, rel=1e-12)


def test_cnr_of_known_regions(rng):
    """A step of 3 over noise of 0.5 gives 6 within the statistical error, whatever the scale and its sign."""
    image = 0.5 * rng.standard_normal((200, 200))
    target = half(image.shape)
    image[target] += 3
    measured = metrics.cnr(image, target, ~target)
    # The deviation of 20000 samples is known to 1 / sqrt(2 n) = 0.5 %.
    assert measured == pytest.approx(6, rel=4 * 0.005)
    assert metrics.cnr(-1e-9 * image, target, ~target) == pytest.approx(measured, rel=1e-12)


def test_cnr_over_a_constant_background():
    """It is infinite where there is contrast, and 0 where there is none."""
    image, target = np.zeros((4, 4)), half((4, 4))
    assert metrics.cnr(image, target, ~target) == 0
    assert metrics.cnr(image + target, target, ~target) == np.inf


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("metric", COMPARISONS)
def test_values_that_are_not_finite_are_refused(metric, bad, truth):
    """One such pixel in either image is an error that counts it."""
    broken = truth.copy()
    broken[3, 4] = bad
    with pytest.raises(ValidationError, match="image: 1 of 1200 pixels are not finite"):
        metric(broken, truth)
    with pytest.raises(ValidationError, match="truth: 1 of 1200 pixels are not finite"):
        metric(truth, broken)


@pytest.mark.parametrize("metric", ALONE)
def test_a_single_image_is_checked_too(metric):
    """NaN, a wrong number of axes and a mask of another shape are refused."""
    with pytest.raises(ValidationError, match="not finite"):
        metric([[np.nan, 1.0], [1.0, 1.0]])
    with pytest.raises(ValidationError, match=r"one plane of shape \(y, x\), got \(1, 3, 3\)"):
        metric(np.ones((1, 3, 3)))
    with pytest.raises(ValidationError, match=r"mask: expected True or False for each pixel of \(3, 3\)"):
        metric(np.ones((3, 3)), np.ones((3, 2), bool))


@pytest.mark.parametrize("metric", COMPARISONS)
def test_shapes_must_agree(metric, truth):
    """Two images of different shape are no pair, even where numpy would stretch one."""
    with pytest.raises(ValidationError, match=r"expected the shape of the truth, \(40, 30\), got \(1, 30\)"):
        metric(truth[:1], truth)


def test_a_signed_distance_is_no_mask(truth):
    """A boundary image, which is non-zero nearly everywhere, is not mistaken for a mask; nor is an empty one taken."""
    with pytest.raises(ValidationError, match="write boundary < 0"):
        metrics.sharpness(truth, truth - 0.5)
    with pytest.raises(ValidationError, match="leaves no pixel"):
        metrics.sharpness(truth, np.zeros(truth.shape, bool))


def test_what_has_no_peak_scale_or_window_is_refused():
    """PSNR without a positive pixel, a factor for a zero image, SSIM below its window, a gradient of one row."""
    with pytest.raises(ValidationError, match="must be above 0"):
        metrics.psnr(np.ones((3, 3)), np.zeros((3, 3)))
    with pytest.raises(ValidationError, match="zero everywhere"):
        metrics.fitted_scale(np.zeros((3, 3)), np.ones((3, 3)))
    with pytest.raises(ValidationError, match="at least 11 x 11"):
        metrics.ssim(np.ones((10, 30)), np.ones((10, 30)))
    with pytest.raises(ValidationError, match="at least 2 x 2"):
        metrics.sharpness(np.ones((1, 5)))
