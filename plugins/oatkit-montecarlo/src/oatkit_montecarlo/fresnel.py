"""What the step of the refractive index does to diffuse light at the wall, seen from inside the body."""

from functools import cache

import numpy as np


@cache
def reflected_shares(index_body: float, index_couplant: float) -> tuple[float, float]:
    r"""Return R_phi and R_j of [Haskell1994]_, integrals of Fresnel's reflectance of unpolarised light.

    .. math::
        R_\phi = \int_0^{\pi/2} 2 \sin\theta \cos\theta R(\theta) d\theta, \quad
        R_j = \int_0^{\pi/2} 3 \sin\theta \cos^2\theta R(\theta) d\theta

    References:
        [Haskell1994] Haskell et al., J. Opt. Soc. Am. A 11, 2727 (1994), 10.1364/JOSAA.11.002727.
    """
    nodes, weights = np.polynomial.legendre.leggauss(100)
    angle, weights = np.pi / 4 * (nodes + 1), np.pi / 4 * weights
    # The angle on the side of the lower index is the variable: on the other, R ends with a vertical slope.
    scale = min(index_couplant / index_body, 1.0)
    sin_body = scale * np.sin(angle)
    sin_couplant = sin_body * index_body / index_couplant
    cos_body, cos_couplant = np.sqrt(1 - sin_body**2), np.sqrt(1 - sin_couplant**2)
    body_across, body_along = index_body * cos_body, index_couplant * cos_body
    couplant_across, couplant_along = index_couplant * cos_couplant, index_body * cos_couplant
    across = (body_across - couplant_across) / (body_across + couplant_across)
    along = (body_along - couplant_along) / (body_along + couplant_along)
    step = weights * scale**2 * np.sin(angle) * np.cos(angle) * (across**2 + along**2) / 2
    # Beyond the critical angle everything is reflected.
    cos_critical = np.sqrt(1 - scale**2)
    return float(2 * step.sum() + cos_critical**2), float(3 * (step @ cos_body) + cos_critical**3)
