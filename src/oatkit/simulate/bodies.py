"""Bodies that are known in full: what they absorb and where they end, as functions of the plane.

A phantom (`oatkit.simulate.phantoms`) is an initial pressure as if the light were the same everywhere; a body is what
the light meets. Segmentation, fluence and absorption are tested on bodies.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from oatkit.api import FluenceModel
from oatkit.content import read_only
from oatkit.data import Grid, Image, Optics
from oatkit.polygons import signed_distance
from oatkit.simulate.anatomy import Anatomy
from oatkit.simulate.mouse import Mouse
from oatkit.simulate.phantoms import check_radius, star_density, star_outline
from oatkit.simulate.raster import Density, area_average

LIGHT_NM = 700.0
"""The wavelength that the light of `Body.lit` is labelled with."""
PER_CM = 100.0
"""1/cm in 1/m."""
ANGLES = np.arange(4096) * (2 * np.pi / 4096)
"""Directions in which an outline given by its radius is sampled: within 0.1 um of a curve of 10 mm radius."""


@dataclass(frozen=True, eq=False)
class Body:
    """An absorbing body in clear water. Each quantity exists on any grid, so data and image need not share one."""

    name: str
    density: Density
    """mu_a, 1/m, of y of shape ``(ny, 1)`` and x of shape ``(1, nx)``, m; zero outside of the outline."""
    outline_m: np.ndarray
    """Closed polygon that follows the outline, shape ``(n, 2)``, each ``(y, x)``, m."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline_m", read_only(self.outline_m, float))

    def absorption(self, grid: Grid) -> Image:
        """Return mu_a, 1/m, averaged over the area of each pixel; zero outside the body."""
        return Image(area_average(self.density, grid), "absorption", "1/m", grid)

    def boundary(self, grid: Grid) -> Image:
        """Return the true signed distance of each pixel's centre from the outline, m, negative inside."""
        return Image(signed_distance(self.outline_m, grid), "boundary", "m", grid)

    def lit(
        self,
        grid: Grid,
        fluence_model: FluenceModel,
        reduced_scattering_per_m: float,
        background_absorption_per_m: float,
    ) -> tuple[Image, Image]:
        """Return the initial pressure mu_a * Phi (Grueneisen parameter 1, unit light: "a.u.") and the fluence Phi.

        The light is that of `fluence_model` in a homogeneous body of this outline with the absorption
        `background_absorption_per_m`, the average that one would assume of the body, and `reduced_scattering_per_m`,
        both 1/m; the body's own absorption is not fed back into the light. Raises what the model raises.
        """
        optics = Optics(
            (LIGHT_NM,), np.array([background_absorption_per_m]), np.array([reduced_scattering_per_m])
        )  # fmt: skip
        fluence = fluence_model.fluence(self.boundary(grid), optics)
        pressure = self.absorption(grid).values * fluence.values
        return Image(pressure, "initial_pressure", "a.u.", grid, fluence.wavelengths_nm), fluence


def disc_body(radius_m: float = 9e-3, centre_m: tuple[float, float] = (0.0, 0.0)) -> Body:
    """Return a homogeneous disc of mu_a = 0.25 / cm about `centre_m` (y, x)."""
    check_radius(radius_m)
    circle = radius_m * np.column_stack([np.sin(ANGLES), np.cos(ANGLES)]) + centre_m

    def density(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return np.where(np.hypot(y - centre_m[0], x - centre_m[1]) <= radius_m, 0.25 * PER_CM, 0.0)

    return Body("disc", density, circle)


def star_body(radius_m: float = 9e-3) -> Body:
    """Return the star phantom of [Prakash2019]_: agar of mu_a = 0.25 / cm and two tubes of 2.5 / cm.

    The optical densities of the paper are read as natural absorption coefficients per cm. Outline and tubes are those
    of `oatkit.simulate.star`.
    """
    check_radius(radius_m)
    return Body("star", _scaled(star_density, radius_m), _polar(radius_m * star_outline(ANGLES)))


def breast_body(seed: int = 0, radius_m: float = 9e-3) -> Body:
    """Return the breast-like body of `oatkit.simulate.breast`; its values are mu_a in 1/cm (tumours: 1 .. 0.6)."""
    check_radius(radius_m)
    anatomy = Anatomy.draw(seed)
    return Body("breast", _scaled(anatomy.density, radius_m), _polar(radius_m * anatomy.reach(ANGLES)))


def mouse_body(seed: int = 0, legs: bool = False) -> Body:
    """Return an invented slice through a mouse's belly, about 20 x 17 mm: see `oatkit.simulate.mouse`.

    `seed` varies the outline, moves the organs and scatters small vessels. With `legs`, two thighs stand out at the
    lower corners, with creases beside them that no ray from the centre sees.
    """
    mouse = Mouse.draw(seed, legs)

    def density(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return PER_CM * mouse.absorption(1e3 * y, 1e3 * x)

    return Body("mouse", density, 1e-3 * mouse.outline_mm())


BODIES: Mapping[str, Callable[[], Body]] = {
    "breast": breast_body, "star": star_body, "disc": disc_body, "mouse": mouse_body,
}  # fmt: skip
"""What makes each body, by name."""


def _scaled(density_per_cm: Density, radius_m: float) -> Density:
    """Return mu_a in 1/m of points in m, from one in 1/cm of points relative to a radius."""
    return lambda y, x: PER_CM * density_per_cm(y / radius_m, x / radius_m)


def _polar(radius_m: np.ndarray) -> np.ndarray:
    return radius_m[:, None] * np.column_stack([np.sin(ANGLES), np.cos(ANGLES)])
