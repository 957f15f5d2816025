"""Figures of merit of an image, after [Prakash2019]_, Eqs. 22 to 24, and a few that the field uses beside them.

All take one plane of shape ``(y, x)``, as ``image.values[0]`` of an `oatkit.data.Image`, and an optional `mask` of the
same shape that says which pixels count. They raise `ValidationError` for another shape, for values that are not finite
and for an empty mask. An image is compared as it is: see `fitted_scale` for one whose scale is arbitrary.

.. [Prakash2019] J. Prakash, S. Mandal, D. Razansky, V. Ntziachristos, "Maximum entropy based non-negative optoacoustic
   tomographic image reconstruction", IEEE Trans. Biomed. Eng., 2019, doi:10.1109/TBME.2019.2892842.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.errors import ValidationError


@dataclass(frozen=True)
class NegativePixels:
    """How many pixels of an image are below zero."""

    count: int
    share: float
    """`count` over the number of pixels looked at."""


def sharpness(image: Any, mask: Any = None) -> float:
    r"""Return the mean squared gradient, Eq. 22 of [Prakash2019]_ with the squares on the derivatives.

    .. math:: SM = \frac{1}{n} \sum \left(\frac{dI}{dx}\right)^2 + \left(\frac{dI}{dy}\right)^2

    Derivatives are central differences per pixel (one-sided at the edge of the image), so images are comparable only at
    equal pixel size and scale. Noise raises it as edges do: it does not say which image is better.

    >>> sharpness([[0.0, 1.0], [0.0, 1.0]])
    1.0
    """
    image = _plane("image", image)
    chosen = _chosen(mask, image)
    if min(image.shape) < 2:
        raise ValidationError(f"image: a gradient needs at least 2 x 2 pixels, got {image.shape}")
    along_y, along_x = np.gradient(image)
    return float((along_y**2 + along_x**2)[chosen].mean())


def rmse(image: Any, truth: Any, mask: Any = None) -> float:
    r"""Return the root mean square error, Eq. 23 of [Prakash2019]_.

    .. math:: RMSE = \sqrt{\frac{1}{n} \sum (x - x^{true})^2}

    >>> rmse([[1.0, 5.0]], [[1.0, 2.0]], mask=[[False, True]])
    3.0
    """
    image, truth = _pair(image, truth)
    chosen = _chosen(mask, truth)
    return float(np.sqrt(((image - truth)[chosen] ** 2).mean()))


def psnr(image: Any, truth: Any, mask: Any = None) -> float:
    r"""Return the peak signal-to-noise ratio in dB, Eq. 24 of [Prakash2019]_; the peak is the maximum of the truth.

    .. math:: PSNR = 20 \log_{10} \frac{\max x^{true}}{RMSE}

    Peak and error are both taken over the mask. Infinite for a perfect image.

    >>> psnr([[1.0, 9.0]], [[0.0, 10.0]])
    20.0
    """
    truth = _plane("truth", truth)
    error = rmse(image, truth, mask)
    peak = _peak(truth[_chosen(mask, truth)])
    return float(20 * np.log10(peak / error)) if error > 0 else float("inf")


def ssim(image: Any, truth: Any, mask: Any = None) -> float:
    r"""Return the mean structural similarity of Wang et al., IEEE Trans. Image Process. 13, 600 (2004).

    .. math:: SSIM = \frac{(2 \mu_x \mu_y + C_1)(2 \sigma_{xy} + C_2)}
        {(\mu_x^2 + \mu_y^2 + C_1)(\sigma_x^2 + \sigma_y^2 + C_2)}

    by scikit-image, with the window of that paper (Gaussian, 1.5 pixels, 11 x 11, population covariance) and
    ``C = (0.01 L)^2, (0.03 L)^2``, where the range L is the maximum of the truth (over the whole image). The mean
    leaves out the 5 pixels next to the edge of the image; `mask` says which of the others count.

    >>> ssim(np.eye(11), np.eye(11))
    1.0
    """
    from skimage.metrics import structural_similarity

    image, truth = _pair(image, truth)
    if min(truth.shape) < 11:
        raise ValidationError(f"image: the window of SSIM needs at least 11 x 11 pixels, got {truth.shape}")
    inner = np.zeros(truth.shape, bool)
    inner[5:-5, 5:-5] = True
    chosen = _chosen(inner if mask is None else _chosen(mask, truth) & inner, truth)
    _, similarity = structural_similarity(
        image, truth, data_range=_peak(truth), gaussian_weights=True, use_sample_covariance=False, full=True
    )
    return float(similarity[chosen].mean())


def negative_pixels(image: Any, mask: Any = None) -> NegativePixels:
    """Count the pixels below zero; [Prakash2019]_ counts inside the body only (a mask), without the water.

    >>> negative_pixels([[-1.0, 0.0], [-0.0, 2.0]])
    NegativePixels(count=1, share=0.25)
    """
    image = _plane("image", image)
    chosen = image[_chosen(mask, image)]
    count = int((chosen < 0).sum())
    return NegativePixels(count, count / chosen.size)


def cnr(image: Any, target: Any, background: Any) -> float:
    r"""Return the contrast-to-noise ratio of two regions, given as masks.

    .. math:: CNR = \frac{|\overline{x}_{target} - \overline{x}_{background}|}{\sigma_{background}}

    with the population standard deviation. It does not depend on the scale of the image. Infinite over a constant
    background (0 without any contrast): setting negatives to zero makes it large, with no better image.

    >>> cnr([[0.0, 2.0, 7.0]], target=[[False, False, True]], background=[[True, True, False]])
    6.0
    """
    image = _plane("image", image)
    inside, outside = (image[_chosen(mask, image)] for mask in (target, background))
    contrast = abs(float(inside.mean() - outside.mean()))
    noise = float(outside.std())
    if noise > 0:
        return contrast / noise
    return float("inf") if contrast > 0 else 0.0


def fitted_scale(image: Any, truth: Any, mask: Any = None) -> float:
    r"""Return the factor s for which ``s * image`` is nearest to the truth in least squares.

    .. math:: s = \frac{\sum x \, x^{true}}{\sum x^2}

    Reconstructions by another operator, or of a real scan, have an arbitrary scale; multiply by `s` before `rmse`,
    `psnr` and `ssim`, and say so, for it takes a bias out of the comparison. Raises `ValidationError` for an image that
    is zero everywhere.

    >>> fitted_scale([[1.0, 2.0]], [[10.0, 20.0]])
    10.0
    """
    image, truth = _pair(image, truth)
    chosen = _chosen(mask, truth)
    energy = float((image[chosen] ** 2).sum())
    if not energy > 0:
        raise ValidationError("image: it is zero everywhere, so that no factor fits it to the truth")
    return float((image[chosen] * truth[chosen]).sum()) / energy


def _plane(name: str, values: Any) -> np.ndarray:
    """Return an image as float64, checked."""
    plane = np.asarray(values, dtype=float)
    if plane.ndim != 2 or plane.size == 0:
        raise ValidationError(f"{name}: expected one plane of shape (y, x), got {plane.shape}; take image.values[0]")
    unusable = int((~np.isfinite(plane)).sum())
    if unusable:
        raise ValidationError(f"{name}: {unusable} of {plane.size} pixels are not finite")
    return plane


def _pair(image: Any, truth: Any) -> tuple[np.ndarray, np.ndarray]:
    image, truth = _plane("image", image), _plane("truth", truth)
    if image.shape != truth.shape:
        raise ValidationError(f"image: expected the shape of the truth, {truth.shape}, got {image.shape}")
    return image, truth


def _chosen(mask: Any, plane: np.ndarray) -> np.ndarray:
    """Return which pixels count, as an array of bool; all of them without a mask."""
    chosen = np.ones(plane.shape, bool) if mask is None else np.asarray(mask)
    if chosen.dtype != bool or chosen.shape != plane.shape:
        raise ValidationError(
            f"mask: expected True or False for each pixel of {plane.shape}, got {chosen.dtype} of {chosen.shape}; "
            "of a signed distance, write boundary < 0"
        )
    if not chosen.any():
        raise ValidationError("mask: it leaves no pixel to look at")
    return chosen


def _peak(truth: np.ndarray) -> float:
    peak = float(truth.max())
    if not peak > 0:
        raise ValidationError(f"truth: its maximum is the peak of PSNR and SSIM and must be above 0, got {peak:g}")
    return peak
