"""Light on a coarser grid than the image's: it is smooth, and it is computed over and over."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from oatkit.data import Grid, Image, Optics


@dataclass(frozen=True)
class CoarseLight:
    """A model of light for a body whose absorption changes.

    The light of any absorption is that of the homogeneous body of `optics`, which is known on the grid of the image,
    times the ratio of the two lights, which is computed on blocks of `factor` x `factor` pixels and interpolated. With
    a factor of 1 it is that of the model as it is.
    """

    model: Any
    """A `FluenceModel`."""
    boundary: Image
    optics: Optics
    """Of the homogeneous body."""
    homogeneous: np.ndarray
    """Its light, shape ``(wavelength, y, x)``."""
    factor: int

    @cached_property
    def inside(self) -> np.ndarray:
        """Which pixels of the image lie in the body."""
        return np.asarray(self.boundary.values[0] < 0)

    def light(self, absorption_per_m: np.ndarray, scattering: float = 1.0) -> np.ndarray:
        """Return the light in a body of this mu_a, shape ``(wavelength, y, x)``; outside of it that of `homogeneous`.

        `scattering` multiplies mu_s'. mu_a is kept between 0 and mu_s', where the diffusion of light ends.
        """
        scattering_per_m = scattering * self.optics.reduced_scattering_per_m
        known = np.clip(absorption_per_m, 0, self.limit(scattering))
        found = self._coarse_light(known, scattering_per_m)
        if self.factor > 1:
            found = self.homogeneous * self._fine(found / self._coarse_homogeneous)
        return np.where(self.inside, found, self.homogeneous)

    def limit(self, scattering: float = 1.0) -> np.ndarray:
        """Return the largest mu_a that the light is given, mu_s' times `scattering`, 1/m, as planes."""
        return scattering * _planes(self.optics.reduced_scattering_per_m)

    @cached_property
    def _coarse_homogeneous(self) -> np.ndarray:
        return self._coarse_light(self.optics.absorption_per_m, self.optics.reduced_scattering_per_m)

    def _coarse_light(self, absorption_per_m: np.ndarray, scattering_per_m: np.ndarray) -> np.ndarray:
        optics = Optics(self.optics.wavelengths_nm, self._coarse(absorption_per_m), self._coarse(scattering_per_m))
        return np.asarray(self.model.fluence(self._coarse_boundary, optics).values)

    @cached_property
    def _coarse_boundary(self) -> Image:
        """The signed distance at the middle of each block: nearly linear, so the mean of its pixels."""
        grid, size = self.boundary.grid, self.factor * self.boundary.grid.pixel_size_m
        blocks = _blocks(_padded(self.boundary.values, self.factor, "edge"), self.factor).mean((2, 4))
        middle = [
            first + (size - grid.pixel_size_m) / 2 + size * (n - 1) / 2
            for first, n in zip((grid.y_m[0], grid.x_m[0]), blocks.shape[1:], strict=True)
        ]
        return Image(blocks, "boundary", "m", Grid(blocks.shape[1:], size, tuple(middle)))

    def _coarse(self, values: np.ndarray) -> np.ndarray:
        """Return the mean over the pixels of each block that lie in the body, or where none does, over the body."""
        if values.ndim == 1:
            return values
        weights = _blocks(_padded(self.inside[None].astype(float), self.factor, "constant"), self.factor).sum((2, 4))
        sums = _blocks(_padded(np.where(self.inside, values, 0.0), self.factor, "constant"), self.factor).sum((2, 4))
        everywhere = values[:, self.inside].mean(1)[:, None, None]
        return np.where(weights > 0, sums / np.maximum(weights, 1), everywhere)

    def _fine(self, ratio: np.ndarray) -> np.ndarray:
        """Return values of the blocks at the pixels, linear between the blocks' middles."""
        from scipy.ndimage import map_coordinates

        ratio = self._continued(ratio)
        rows, columns = ((np.arange(n) - (self.factor - 1) / 2) / self.factor for n in self.boundary.grid.shape)
        at = np.meshgrid(rows, columns, indexing="ij")
        return np.stack([map_coordinates(plane, at, order=1, mode="nearest") for plane in ratio])

    def _continued(self, ratio: np.ndarray) -> np.ndarray:
        """Return the ratio with that of the nearest block in the body wherever there is no body."""
        from scipy.ndimage import distance_transform_edt

        outside = self._coarse_boundary.values[0] >= 0
        nearest = distance_transform_edt(outside, return_distances=False, return_indices=True)
        return np.asarray(ratio[:, nearest[0], nearest[1]])


def _planes(values: np.ndarray) -> np.ndarray:
    return values[:, None, None] if values.ndim == 1 else values


def _padded(values: np.ndarray, factor: int, mode: Any) -> np.ndarray:
    return np.pad(values, [(0, 0), *((0, -n % factor) for n in values.shape[1:])], mode=mode)


def _blocks(values: np.ndarray, factor: int) -> np.ndarray:
    """Return pixels as ``(plane, block row, row in it, block column, column in it)``."""
    planes, rows, columns = values.shape
    return values.reshape(planes, rows // factor, factor, columns // factor, factor)
