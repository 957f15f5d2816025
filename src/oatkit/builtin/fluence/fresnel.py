"""What the step of the refractive index does to diffuse light at the wall of the body."""

from functools import cache

import numpy as np


@cache
def wall_factor(index_body: float, index_couplant: float) -> float:
    r"""Return A = (1 + R_eff) / (1 - R_eff) of the Robin condition, from the Fresnel integrals of [Haskell1994]_.

    .. math::
        R_{eff} = \frac{R_\phi + R_j}{2 - R_\phi + R_j}, \quad
        R_\phi = \int_0^{\pi/2} 2 \sin\theta \cos\theta R(\theta) d\theta, \quad
        R_j = \int_0^{\pi/2} 3 \sin\theta \cos^2\theta R(\theta) d\theta

    R is the reflectance of unpolarised light inside the body; equal indices give 1.

    References:
        [Haskell1994] Haskell et al., J. Opt. Soc. Am. A 11, 2727 (1994), 10.1364/JOSAA.11.002727.
    """
    ratio = index_couplant / index_body
    nodes, weights = np.polynomial.legendre.leggauss(100)
    angle, weights = np.pi / 4 * (nodes + 1), np.pi / 4 * weights
    # The angle on the side of the lower index is the variable: on the other, R ends with a vertical slope.
    scale = min(ratio, 1.0)
    sin_body = np.sin(angle) * scale
    sin_couplant = np.sin(angle) * scale / ratio
    cos_body, cos_couplant = np.sqrt(1 - sin_body**2), np.sqrt(1 - sin_couplant**2)
    reflected = _reflectance(cos_body, cos_couplant, ratio)
    step = weights * scale**2 * np.sin(angle) * np.cos(angle) * reflected
    # Beyond the critical angle everything is reflected.
    cos_critical = np.sqrt(1 - scale**2)
    r_fluence = 2 * step.sum() + cos_critical**2
    r_current = 3 * (step * cos_body).sum() + cos_critical**3
    effective = (r_fluence + r_current) / (2 - r_fluence + r_current)
    return float((1 + effective) / (1 - effective))


def _reflectance(cos_body: np.ndarray, cos_couplant: np.ndarray, ratio: float) -> np.ndarray:
    across = (cos_body - ratio * cos_couplant) / (cos_body + ratio * cos_couplant)
    along = (ratio * cos_body - cos_couplant) / (ratio * cos_body + cos_couplant)
    return (across**2 + along**2) / 2
