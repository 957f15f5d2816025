r"""How sharp an image is: scores of one plane, larger in focus, by which `oatkit.focus` picks a speed of sound.

Each takes a plane I of shape ``(y, x)``, at least 3 x 3 pixels, and returns a pure number that does not depend on the
scale of the image; 0 for an image of zeros. The classical scores of [Treeby2011]_ grow with the scale, which changes
with the speed of sound, so they are divided by :math:`\overline{|I|}^2` here. Derivatives are per pixel: compare scores
on one grid only. [Mandal2014]_ shows that simple scores may fail on smooth images of whole animals.

.. [Treeby2011] B. E. Treeby, T. K. Varslot, E. Z. Zhang, J. G. Laufer, P. C. Beard, "Automatic sound speed selection in
   photoacoustic image reconstruction using an autofocus approach", J. Biomed. Opt. 16, 090501 (2011),
   doi:10.1117/1.3619139.
.. [Mandal2014] S. Mandal, E. Nasonova, X. L. Dean-Ben, D. Razansky, "Optimal self-calibration of tomographic
   reconstruction parameters in whole-body small animal optoacoustic imaging", Photoacoustics 2, 128 (2014),
   doi:10.1016/j.pacs.2014.09.002.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np


def variance(image: np.ndarray) -> float:
    r"""Return :math:`\mathrm{var}(I) / \overline{|I|}^2`, the normalised variance of [Treeby2011]_.

    With the mean of the absolute values, since back-projected images have both signs.

    >>> variance(np.array([[0.0, 0.0], [0.0, 4.0]]))
    3.0
    """
    plane = np.asarray(image, float)
    return _per_mean_square(plane.var(), plane)


def gradient_variance(image: np.ndarray) -> float:
    r"""Return :math:`\mathrm{var}(g) / \overline{g}^2` with :math:`g = |\nabla I|`: few strong edges.

    >>> gradient_variance(np.array([[0.0, 1.0, 2.0]] * 3))
    0.0
    """
    return variance(_steepness(image))


def brenner(image: np.ndarray) -> float:
    r"""Return the Brenner gradient of [Treeby2011]_ over :math:`\overline{|I|}^2`.

    .. math:: \overline{(I_{y+2,x} - I_{y,x})^2} + \overline{(I_{y,x+2} - I_{y,x})^2}

    >>> brenner(np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]]))
    4.0
    """
    plane = np.asarray(image, float)
    along_y, along_x = plane[2:] - plane[:-2], plane[:, 2:] - plane[:, :-2]
    return _per_mean_square((along_y**2).mean() + (along_x**2).mean(), plane)


def tenengrad(image: np.ndarray) -> float:
    r"""Return the mean of the squared Sobel gradient over :math:`\overline{|I|}^2`, after Tenenbaum [Treeby2011]_.

    >>> tenengrad(np.array([[-1.0, 0.0, 1.0]] * 3)) == (8**2 + 2 * 4**2) / 3 / (2 / 3) ** 2
    True
    """
    from scipy.ndimage import sobel

    plane = np.asarray(image, float)
    return _per_mean_square((sobel(plane, 0) ** 2 + sobel(plane, 1) ** 2).mean(), plane)


def laplacian(image: np.ndarray) -> float:
    r"""Return the mean of :math:`(\Delta I)^2` over :math:`\overline{|I|}^2`, with the Laplacian of five points.

    >>> laplacian(np.array([[0.0, 1.0, 2.0]] * 3)[:, ::-1] - 1) == 2 / 3 / (2 / 3) ** 2
    True
    """
    from scipy.ndimage import laplace

    plane = np.asarray(image, float)
    return _per_mean_square((laplace(plane) ** 2).mean(), plane)


def kurtosis(image: np.ndarray) -> float:
    r"""Return :math:`\overline{(I - \overline{I})^4} / \mathrm{var}(I)^2`, 3 for Gaussian noise.

    >>> kurtosis(np.array([[-1.0, 1.0]]))
    1.0
    """
    plane = np.asarray(image, float)
    spread = plane - plane.mean()
    return _over((spread**4).mean(), (spread**2).mean() ** 2)


def maximum(image: np.ndarray) -> float:
    r"""Return :math:`\max |I| / \overline{|I|}`: right for a few small absorbers, led astray by a single one.

    >>> maximum(np.array([[0.0, 0.0], [0.0, -4.0]]))
    4.0
    """
    size = abs(np.asarray(image, float))
    return _over(size.max(), size.mean())


def total_variation(image: np.ndarray) -> float:
    r"""Return :math:`\overline{|\nabla I|} / \overline{|I|}`.

    >>> total_variation(np.array([[-1.0, 0.0, 1.0]] * 3)) == 1 / (2 / 3)
    True
    """
    return _over(_steepness(image).mean(), abs(np.asarray(image, float)).mean())


def spectral_energy(image: np.ndarray) -> float:
    """Return the share of the image's energy at spatial frequencies above 1/8 cycle per pixel.

    >>> spectral_energy(np.array([[1.0, -1.0], [1.0, -1.0]]))
    1.0
    """
    plane = np.asarray(image, float)
    energy = abs(np.fft.fft2(plane)) ** 2
    frequency = np.hypot(*np.meshgrid(*map(np.fft.fftfreq, plane.shape), indexing="ij"))
    return _over(energy[frequency > 1 / 8].sum(), energy.sum())


METRICS: Mapping[str, Callable[[np.ndarray], float]] = MappingProxyType(
    {
        "variance": variance,
        "gradient-variance": gradient_variance,
        "brenner": brenner,
        "tenengrad": tenengrad,
        "laplacian": laplacian,
        "kurtosis": kurtosis,
        "maximum": maximum,
        "total-variation": total_variation,
        "spectral-energy": spectral_energy,
    }
)
"""The scores by name."""

TRUSTED = ("variance", "gradient-variance", "brenner", "tenengrad")
"""Those that found the true speed of sound of every simulated body; `benchmarks/focus.py` shows how the others fail."""


def _steepness(image: np.ndarray) -> np.ndarray:
    along_y, along_x = np.gradient(np.asarray(image, float))
    return np.hypot(along_y, along_x)


def _per_mean_square(score: float, plane: np.ndarray) -> float:
    return _over(score, abs(plane).mean() ** 2)


def _over(above: float, below: float) -> float:
    return float(above / below) if below > 0 else 0.0
