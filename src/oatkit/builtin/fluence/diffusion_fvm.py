"""Diffusion of light by finite volumes on cut cells."""

from collections.abc import Sequence
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator
from pydantic_core import PydanticCustomError

from oatkit.api import Image, Optics, SolverError, ValidationError, param
from oatkit.builtin.fluence.band_series import band_series
from oatkit.builtin.fluence.body import signed_distance
from oatkit.builtin.fluence.cut_cells import CutCells
from oatkit.builtin.fluence.diffusion import Medium, buried, diffusion_matrix, factorized, imbalance, wall_conductance
from oatkit.builtin.fluence.fresnel import wall_factor
from oatkit.builtin.fluence.shifted import shifted
from oatkit.builtin.fluence.through_water import ThroughWater
from oatkit.threads import for_each


class DiffusionFvm(ThroughWater):
    r"""Solves the diffusion equation with a Robin wall [Haskell1994]_ by finite volumes.

    .. math::
        -\nabla \cdot D \nabla \Phi + \mu_a \Phi = 0, \quad D = \frac{1}{3 (\mu_a + \mu_s')}, \qquad
        \Phi + 2 A D \, \partial \Phi / \partial n = g

    A = (1 + R_eff) / (1 - R_eff) comes from the refractive indices. Fluence is relative: g is the attenuation in the
    water, so that a body without absorption under unattenuated light has Phi = 1. In absolute units
    g = 4 J_t / (1 - R_phi), with J_t the irradiance transmitted into the body and R_phi as in
    `oatkit.builtin.fluence.fresnel`. ``illumination = "collimated"`` brings what the wall lets in where Phi = 0,
    g / (2 A) per area of it, in a source buried at 1 / mu_s' under a wall with g = 0.

    The wall cuts pixels where the signed distance says. The error falls with the square of the pixel once that is below
    the free path 1 / (mu_a + mu_s'); where D jumps between pixels, with the pixel. At the edge of the grid no light
    passes, as if the body were mirrored there.

    Outside of the body the image shows g itself, in the water.

    References:
        [Haskell1994] Haskell et al., J. Opt. Soc. Am. A 11, 2727 (1994), 10.1364/JOSAA.11.002727.
    """

    name: ClassVar[str] = "diffusion-fvm"
    illumination: Literal["diffuse", "collimated"] = param("diffuse", "how the light falls onto the body")
    index_body: float = param(1.4, "refractive index of the body", at_least=1, at_most=4)
    index_couplant: float = param(1.33, "refractive index of what the body lies in", at_least=1, at_most=4)
    band_width: float | None = param(
        None,
        "width of the lit band around a body that is the same along z; none: lit all along (2-D)",
        unit="mm",
        above=0,
    )
    band_period: float = param(40.0, "the band is repeated along z with this period", unit="mm", above=0)
    n_harmonics: int = param(8, "terms of the series of the band, the constant one counted", at_least=2, at_most=1000)

    @model_validator(mode="after")
    def _band_fits(self) -> Self:
        if self.band_width is not None and not self.band_width <= self.band_period:
            raise PydanticCustomError(
                "oatkit",
                "band_width must not be above band_period, got {width} and {period} mm",
                {"width": self.band_width, "period": self.band_period},
            )
        return self

    def fluence(self, boundary: Image, optics: Optics) -> Image:
        """Return the fluence, shape ``(wavelength, y, x)``, relative, at each wavelength of `optics`.

        ``diagnostics["energy_balance"]`` holds |in - out - absorbed| / in for each wavelength. Raises `ValidationError`
        for optics without a diffusion coefficient, `SolverError` where there is no body.
        """
        grid = boundary.grid
        distance = signed_distance(boundary)
        inside = distance < 0
        cells = CutCells.of(distance, grid.pixel_size_m)
        y, x = cells.wall_points(grid)
        at_wall = self.incident(y, x, optics.wavelengths_nm)
        values = self.incident(grid.y_m[:, None], grid.x_m[None, :], optics.wavelengths_nm)
        media = [Medium.of(cells, optics, index, inside) for index in range(len(values))]
        imbalances = np.zeros(len(values))

        def solve(index: int) -> None:
            solution, imbalances[index] = self._solve(cells, media[index], at_wall[index])
            shown = inside.ravel()[cells.cells]
            values[index].ravel()[cells.cells[shown]] = solution[shown]

        for_each(solve, range(len(values)))
        if not np.isfinite(values).all():
            raise SolverError("fluence: the diffusion equation gave values that are not finite")
        diagnostics = {
            "energy_balance": tuple(imbalances.tolist()),
            "wall_factor": self._wall_factor,
            "notes": self.beyond_ring(y, x) + _notes(cells, media, optics.wavelengths_nm),
        }
        return Image(values, "fluence", "", grid, optics.wavelengths_nm, diagnostics=diagnostics)

    @property
    def _wall_factor(self) -> float:
        return wall_factor(self.index_body, self.index_couplant)

    def _solve(self, cells: CutCells, medium: Medium, light: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the fluence of the cells where `light` is g at each piece of wall, and the worst imbalance."""
        conductance = wall_conductance(cells, medium.diffusion, self._wall_factor)
        source = self._source(cells, medium, light, conductance)
        wave_numbers, weights = self._series()
        along = medium.diffusion * cells.volume
        plane = diffusion_matrix(cells, medium.diffusion, medium.absorption, conductance)
        if len(weights) == 1:
            terms = factorized(plane)(source)[None]
        else:
            terms = shifted(plane, along, source, wave_numbers**2, medium.slowest_decay(cells))
        worst = max(
            imbalance(cells, source, medium.absorption + medium.diffusion * k**2, conductance, term)
            for k, term in zip(wave_numbers, terms, strict=True)
        )
        return np.asarray(weights @ terms), worst

    def _source(self, cells: CutCells, medium: Medium, light: np.ndarray, conductance: np.ndarray) -> np.ndarray:
        """Return what comes into each cell, shape ``(cell,)``."""
        if self.illumination == "diffuse":
            return np.bincount(cells.wall_cell, conductance * light, len(cells.cells))
        scattering = medium.scattering[cells.wall_cell]
        if not (scattering > 0).all():
            raise ValidationError("optics: collimated light needs mu_s' above 0 1/m all along the wall")
        return buried(cells, cells.wall_length * light / (2 * self._wall_factor), 1 / scattering)

    def _series(self) -> tuple[np.ndarray, np.ndarray]:
        if self.band_width is None:
            return np.zeros(1), np.ones(1)
        return band_series(self.band_width * 1e-3, self.band_period * 1e-3, self.n_harmonics)


def _notes(cells: CutCells, media: Sequence[Medium], wavelengths_nm: Sequence[float]) -> tuple[str, ...]:
    """Return sentences on what limits the worth of the result."""
    notes = []
    if cells.n_cut_off:
        notes.append(
            f"The body is cut off by the edge of the grid at {cells.n_cut_off} pixels: no light passes there, as if "
            "the body were mirrored."
        )
    strong = [w for w, m in zip(wavelengths_nm, media, strict=True) if (m.absorption > m.scattering).any()]
    if strong:
        notes.append(
            f"At {', '.join(f'{w:g}' for w in strong)} nm the body absorbs more than it scatters (mu_a above mu_s'), "
            "where the diffusion equation does not hold."
        )
    free_path = min(3 * m.diffusion[cells.wall_cell].min() for m in media)
    if free_path < cells.pixel_size / 2:
        notes.append(
            f"Pixels of {1e3 * cells.pixel_size:.3g} mm are large for light that goes {1e3 * free_path:.3g} mm between "
            "two collisions, 1 / (mu_a + mu_s'): the error can be several percent."
        )
    return tuple(notes)
