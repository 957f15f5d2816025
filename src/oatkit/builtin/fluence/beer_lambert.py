"""Exponential decay with depth."""

from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Image, Optics, param
from oatkit.builtin.fluence.body import properties, signed_distance
from oatkit.builtin.fluence.cut_cells import CutCells
from oatkit.builtin.fluence.through_water import ThroughWater


class BeerLambert(ThroughWater):
    r"""Lets the light fall exponentially with the depth under the nearest wall.

    .. math:: \Phi = g \, e^{-\mu d}, \qquad \mu = \mu_{eff} = \sqrt{3 \mu_a (\mu_a + \mu_s')} \text{ or } \mu_a

    g is the light that the water lets through to the nearest point of the wall, 1 without water. There is one mu for
    the body at each wavelength: where the optics are images, the mean of mu over the pixels of the body, since the
    way of the light through them is not defined. What this model leaves out: light from other sides, which matters in
    a body not much thicker than 1 / mu, and the step at the wall; `diffusion-fvm` has both.
    """

    name: ClassVar[str] = "beer-lambert"
    attenuation: Literal["effective", "absorption"] = param("effective", "mu of the exponential: mu_eff or mu_a")

    def fluence(self, boundary: Image, optics: Optics) -> Image:
        """Return the fluence, shape ``(wavelength, y, x)``, relative; outside of the body g in the water.

        Raises `ValidationError` for optics that do not fit, `SolverError` where there is no body.
        """
        from scipy.spatial import cKDTree

        grid = boundary.grid
        distance = signed_distance(boundary)
        inside = distance < 0
        y, x = CutCells.of(distance, grid.pixel_size_m).wall_points(grid)
        values = self.incident(grid.y_m[:, None], grid.x_m[None, :], optics.wavelengths_nm)
        at_wall = self.incident(y, x, optics.wavelengths_nm)
        rows, columns = np.nonzero(inside)
        _, nearest = cKDTree(np.column_stack([y, x])).query(np.column_stack([grid.y_m[rows], grid.x_m[columns]]))
        for index in range(len(values)):
            mu = self._attenuation(*properties(optics, index, inside), inside)
            values[index][inside] = at_wall[index, nearest] * np.exp(mu * distance[inside])
        return Image(values, "fluence", "", grid, optics.wavelengths_nm, diagnostics={"notes": self.beyond_ring(y, x)})

    def _attenuation(self, absorption: np.ndarray, scattering: np.ndarray, inside: np.ndarray) -> float:
        """Return the mean of mu over the body, 1/m."""
        effective = np.sqrt(3 * absorption * (absorption + scattering))
        mu = effective if self.attenuation == "effective" else absorption
        return float(np.broadcast_to(mu, inside.shape)[inside].mean())
