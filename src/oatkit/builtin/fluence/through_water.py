"""The light that reaches the body through what it lies in."""

import numpy as np

from oatkit.api import FluenceModel, param
from oatkit.spectra import Couplant, water_absorption_per_m


class ThroughWater(FluenceModel):
    """A model of light that comes from a ring through water, I = I_0 exp(-mu_a d), straight towards the centre."""

    ring_radius: float | None = param(
        None,
        "radius of the ring that the light comes from; none: it reaches the body unattenuated",
        unit="mm",
        above=0,
    )
    ring_centre: tuple[float, float] = param((0.0, 0.0), "centre of the ring, (y, x)", unit="mm")
    couplant: Couplant = param("h2o", "what the body lies in: water or heavy water")

    def incident(self, y_m: np.ndarray, x_m: np.ndarray, wavelengths_nm: tuple[float, ...]) -> np.ndarray:
        """Return what is left of the light at points in the water, shape ``(wavelength, *points)``.

        The way through the water is the radius of the ring less the distance from its centre, and 0 beyond the ring.
        Raises `ValidationError` for a wavelength at which the absorption of the couplant is not known.
        """
        shape = np.broadcast_shapes(y_m.shape, x_m.shape)
        if self.ring_radius is None:
            return np.ones((len(wavelengths_nm), *shape))
        absorption = water_absorption_per_m(wavelengths_nm, self.couplant)
        path = np.maximum(self.ring_radius * 1e-3 - self._off_centre(y_m, x_m), 0)
        return np.exp(-absorption.reshape(-1, *[1] * len(shape)) * path)

    def beyond_ring(self, y_m: np.ndarray, x_m: np.ndarray) -> tuple[str, ...]:
        """Return a sentence where points of the body lie beyond the ring, none otherwise."""
        if self.ring_radius is None or not len(y_m):
            return ()
        reach = 1e3 * self._off_centre(y_m, x_m).max()
        if reach <= self.ring_radius:
            return ()
        return (
            f"The body reaches {reach:.3g} mm from the centre of the illumination ring of {self.ring_radius:g} mm: "
            "beyond the ring, no light was lost in the water.",
        )

    def _off_centre(self, y_m: np.ndarray, x_m: np.ndarray) -> np.ndarray:
        y, x = self.ring_centre
        return np.hypot(y_m - y * 1e-3, x_m - x * 1e-3)
