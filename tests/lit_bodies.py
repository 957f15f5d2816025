"""Bodies under light whose fluence is known, for the tests of fluence models."""

from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import ive

from oatkit.builtin.fluence.diffusion_fvm import DiffusionFvm
from oatkit.builtin.fluence.fresnel import wall_factor
from oatkit.data import Grid, Image, Optics

RADIUS = 10e-3
BREAST = Optics((800,), [20.0], [1200.0])
D = 1 / (3 * 1220)
MU_EFF = np.sqrt(20 / D)
A_WATER = wall_factor(1.4, 1.33)
REFERENCE_A = 1.167158407413248
"""With this A the reference values of disc and slab were computed; the exact integrals give 1.167158364575317."""
OFF_CENTRE = (0.13e-3, -0.21e-3)


def body(distance, h):
    """The boundary image of a signed distance, about the origin."""
    return Image(distance, "boundary", "m", Grid(distance.shape, h))


def radii(h, centre=(0, 0), n=None):
    """The distance from `centre` on a square grid about the origin, 24 mm wide unless `n` pixels are asked for."""
    n = n or int(np.ceil(24e-3 / h))
    at = (np.arange(n) - (n - 1) / 2) * h
    return np.hypot(at[:, None] - centre[0], at - centre[1])


@cache
def star(h, n=None):
    """The distance of pixels from r = R (1 + 0.2 cos 5 t), m, negative inside."""
    from scipy.spatial import cKDTree

    n = n or int(np.ceil(26e-3 / h))
    y, x = np.meshgrid(*[(np.arange(n) - (n - 1) / 2) * h] * 2, indexing="ij")
    angle = np.linspace(0, 2 * np.pi, 50_001)
    outline = 0.8 * RADIUS * (1 + 0.2 * np.cos(5 * angle))
    tree = cKDTree(np.column_stack([outline * np.sin(angle), outline * np.cos(angle)]))
    away = tree.query(np.column_stack([y.ravel(), x.ravel()]))[0].reshape(n, n)
    inside = np.hypot(y, x) < 0.8 * RADIUS * (1 + 0.2 * np.cos(5 * np.arctan2(y, x)))
    return np.where(inside, -away, away)


def solved(distance, h, optics=BREAST, model=None):
    """The fluence, shape (y, x), at the only wavelength."""
    return (model or DiffusionFvm()).fluence(body(distance, h), optics).values[0]


def relative(found, exact, where):
    """The relative L2 distance."""
    return np.linalg.norm((found - exact)[where]) / np.linalg.norm(exact[where])


def disc_solution(r, a, wave_number=0.0):
    """Phi in a lit disc of the breast's optics, with mu_a + D k^2 for mu_a."""
    kappa = np.hypot(MU_EFF, wave_number)
    ends = ive(0, kappa * RADIUS) + 2 * a * D * kappa * ive(1, kappa * RADIUS)
    return ive(0, kappa * r) * np.exp(kappa * (np.minimum(r, RADIUS) - RADIUS)) / ends


def patchy(shape, seed=0):
    """Optics at two wavelengths that vary from place to place by an order of magnitude."""
    rng = np.random.default_rng(seed)
    noise = gaussian_filter(rng.standard_normal((4, *shape)), (0, 3, 3))
    return Optics((700, 800), 20 * np.exp(8 * noise[:2]), 1200 * np.exp(4 * noise[2:]))


MODELS = {
    "diffuse": DiffusionFvm(ring_radius=15.0),
    "collimated": DiffusionFvm(illumination="collimated", ring_radius=15.0),
    "band": DiffusionFvm(band_width=8.0),
    "collimated band": DiffusionFvm(illumination="collimated", band_width=8.0),
}
