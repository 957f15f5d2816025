"""The fluence model."""

from typing import Any, ClassVar, Literal

import numpy as np

from oatkit.api import FluenceModel, Image, Optics, ValidationError, param
from oatkit_montecarlo.batches import Estimate, estimate, sizes
from oatkit_montecarlo.body import Body
from oatkit_montecarlo.fresnel import reflected_shares
from oatkit_montecarlo.notes import notes, relative_errors

MOST_WORK = 1e11
"""Pixels and collisions of one run; at 1e8 a second that is a quarter of an hour."""


class MonteCarlo(FluenceModel):
    r"""Follows photons through the body, from event to event, in three dimensions [Wang1995]_.

    It solves the equation of radiative transfer, so that it holds where diffusion does not: within a free path of the
    wall, where absorption is not small beside scattering, and in small or clear bodies. What it answers is what
    `diffusion-fvm` answers: the fluence, relative, in a body that is the same all along z, lit from all around. A body
    without absorption under unattenuated diffuse light has Phi = 1; with the wall's Fresnel integrals R_phi and R_j

    .. math:: J_t = \frac{1 - R_\phi}{4} g \text{ (diffuse)}, \qquad
        J_t = \frac{g}{2 A}, \quad A = \frac{1 + R_j}{1 - R_\phi} \text{ (collimated)}

    enters through each area of wall, g being what the couplant leaves of the light. The second is what `diffusion-fvm`
    buries under the wall; it is 2 / (1 + R_j) times the first. Collimated light enters along the normal of the wall.

    Absorption is continuous along each flight. A pixel shows the mean over its part in the body, of weighted way over
    area; outside of the body the image shows g, in the couplant. Light that has left does not come back. At the edge of
    the grid the body is mirrored. Wavelengths of one mu_s' share one set of paths, with a weight for each.

    The result is noisy and deterministic: photon number n of a seed draws the same numbers whatever the optics and the
    number of threads, so errors are alike from one wavelength to the next. Nothing is smoothed.

    References:
        [Wang1995] Wang, Jacques and Zheng, Comput. Methods Programs Biomed. 47, 131 (1995),
        10.1016/0169-2607(95)01640-F.
    """

    name: ClassVar[str] = "monte-carlo"
    n_photons: int = param(1_000_000, "photons for each set of paths", at_least=1000, at_most=10**10)
    seed: int = param(0, "number that the photons are drawn by", at_least=0, at_most=2**63 - 1)
    illumination: Literal["diffuse", "collimated"] = param("diffuse", "how the light falls onto the body")
    index_body: float = param(1.4, "refractive index of the body", at_least=1, at_most=4)
    index_couplant: float = param(1.33, "refractive index of what the body lies in", at_least=1, at_most=4)
    anisotropy: float = param(
        0.0,
        "mean cosine g of scattering by Henyey and Greenstein; mu_s is mu_s' / (1 - g); dimensionless",
        at_least=0,
        at_most=0.99,
    )
    band_width: float | None = param(
        None,
        "width of the lit band around a body that is the same along z; none: lit all along",
        unit="mm",
        above=0,
    )
    ring_radius: float | None = param(
        None,
        "radius of the ring that the light comes from, through an absorbing couplant; none: it comes unattenuated",
        unit="mm",
        above=0,
    )
    ring_centre: tuple[float, float] = param((0.0, 0.0), "centre of the ring, (y, x)", unit="mm")
    couplant_absorption: tuple[float, ...] = param(
        (0.0,),
        "mu_a of what the body lies in: one number for all wavelengths, or one for each",
        unit="cm^-1",
        at_least=0,
    )
    error_map: bool = param(False, "keep the standard error of every pixel in the diagnostics")

    def fluence(self, boundary: Image, optics: Optics) -> Image:
        """Return the fluence, shape ``(wavelength, y, x)``, relative, at each wavelength of `optics`.

        ``diagnostics`` holds for each wavelength the median and the 95th percentile of the relative standard error
        over the pixels of the body, from the spread of batches of photons (a pixel that no photon reached counts as 1),
        |in - out - absorbed - roulette| / in, and absorbed / in; with ``error_map`` also the standard error of every
        pixel.

        Raises `ValidationError` for images or numbers that do not fit, or a body of so many free paths that it would
        take hours; `SolverError` where there is no body.
        """
        body, grid = Body.of(boundary), boundary.grid
        _check_shapes(optics, grid.shape)
        values = self._incident(grid.y_m[:, None], grid.x_m[None, :], optics.wavelengths_nm)
        y, x = (
            first + (at - 0.5) * grid.pixel_size_m
            for first, at in zip((grid.y_m[0], grid.x_m[0]), body.wall.middle.T, strict=True)
        )
        light = self._incident(y, x, optics.wavelengths_nm)
        errors, (balances, kept) = np.zeros_like(values), np.zeros((2, len(values)))
        for group in _alike(optics.reduced_scattering_per_m):
            found = self._paths(body, grid.pixel_size_m, optics, group, light[group])
            for place, index in enumerate(group):
                values[index][body.inside] = found.mean[body.inside, place]
                errors[index][body.inside] = found.standard_error[body.inside, place]
            launched, absorbed, escaped, roulette, _ = found.totals / np.maximum(found.totals[0], np.finfo(float).tiny)
            balances[group], kept[group] = abs(launched - absorbed - escaped - roulette), absorbed
        relative = relative_errors(values, errors, body.inside)
        diagnostics: dict[str, Any] = {
            "relative_error_median": tuple(np.median(relative, axis=1).tolist()),
            "relative_error_95": tuple(np.quantile(relative, 0.95, axis=1).tolist()),
            "energy_balance": tuple(balances.tolist()),
            "absorbed": tuple(kept.tolist()),
            "n_photons": self.n_photons,
            "notes": tuple(notes(body, relative, optics.wavelengths_nm, self._beyond_ring(y, x))),
        }
        if self.error_map:
            diagnostics["standard_error"] = errors
        return Image(values, "fluence", "", grid, optics.wavelengths_nm, diagnostics=diagnostics)

    def _paths(self, body: Body, pixel_size: float, optics: Optics, group: list[int], light: np.ndarray) -> Estimate:
        """Return the fluence at the wavelengths of a group, shape ``(y, x, wavelength)``, by one set of paths."""
        from oatkit_montecarlo.transport import transport

        absorption = np.stack([_seen(optics.absorption_per_m[k], body) * pixel_size for k in group], axis=-1)
        scattering = _seen(optics.reduced_scattering_per_m[group[0]], body) * pixel_size / (1 - self.anisotropy)
        self._check_work(body, absorption, scattering)
        length = body.wall.length
        wall = (np.cumsum(length), body.wall.cell, body.wall.start, body.wall.end, body.wall.outwards)
        lamp = (self.index_couplant / self.index_body, self.illumination == "collimated")
        half_band = np.inf if self.band_width is None else self.band_width * 1e-3 / (2 * pixel_size)
        medium = (body.centre, body.corner, body.walled, absorption, scattering, half_band)
        brightness = np.ascontiguousarray(light.T)
        power = self._irradiance * length.sum()
        per_way = np.divide(power, body.share, out=np.zeros(body.share.shape), where=body.share > 0)[..., None]

        def run(first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
            tally, totals = np.zeros(absorption.shape), np.zeros((5, len(group)))
            transport(first, count, self.seed, lamp, wall, brightness, medium, self.anisotropy, tally, totals)
            return tally * (per_way / count), totals

        return estimate(run, sizes(self.n_photons))

    @property
    def _irradiance(self) -> float:
        """What enters through the wall for each unit of g."""
        r_phi, r_j = reflected_shares(self.index_body, self.index_couplant)
        return (1 - r_phi) / 4 if self.illumination == "diffuse" else (1 - r_phi) / (2 * (1 + r_j))

    def _check_work(self, body: Body, absorption: np.ndarray, scattering: np.ndarray) -> None:
        """Raise where the photons would take too long, by the mean way of a photon in a body like this.

        Without absorption that is 4 area / circumference over what the wall lets through, and with it no more than a
        dozen lengths 1 / mu_a, after which nothing of a photon is left.
        """
        inside = body.inside
        r_phi, _ = reflected_shares(self.index_body, self.index_couplant)
        clear = 4 * body.share.sum() / (body.wall.length.sum() * (1 - r_phi))
        dark = absorption[inside].min(axis=-1).mean()
        way = min(clear, 12 / dark) if dark > 0 else clear
        work = self.n_photons * way * (1 + scattering[inside].mean())
        if not work <= MOST_WORK:
            raise ValidationError(
                f"monte-carlo: {self.n_photons} photons would pass about {work:.0e} pixels and collisions, more than "
                f"{MOST_WORK:.0e}; take fewer photons, anisotropy 0 or larger pixels (where a body is many free paths "
                "1 / mu_s' wide, 'diffusion-fvm' holds)"
            )

    def _incident(self, y_m: np.ndarray, x_m: np.ndarray, wavelengths_nm: tuple[float, ...]) -> np.ndarray:
        """Return what the couplant leaves of the light at these points, shape ``(wavelength, *points)``."""
        shape = np.broadcast_shapes(y_m.shape, x_m.shape)
        if len(self.couplant_absorption) not in (1, len(wavelengths_nm)):
            raise ValidationError(
                f"couplant_absorption: expected one number, or one for each of {len(wavelengths_nm)} wavelengths, got "
                f"{len(self.couplant_absorption)}"
            )
        absorption = np.broadcast_to(100 * np.array(self.couplant_absorption), len(wavelengths_nm))
        if self.ring_radius is None:
            return np.ones((len(wavelengths_nm), *shape))
        path = np.maximum(self.ring_radius * 1e-3 - self._off_centre(y_m, x_m), 0)
        return np.asarray(np.exp(-absorption.reshape(-1, *[1] * len(shape)) * path))

    def _beyond_ring(self, y_m: np.ndarray, x_m: np.ndarray) -> bool:
        return self.ring_radius is not None and bool((self._off_centre(y_m, x_m) > self.ring_radius * 1e-3).any())

    def _off_centre(self, y_m: np.ndarray, x_m: np.ndarray) -> np.ndarray:
        y, x = self.ring_centre
        return np.hypot(y_m - y * 1e-3, x_m - x * 1e-3)


def _check_shapes(optics: Optics, shape: tuple[int, int]) -> None:
    for name in ("absorption_per_m", "reduced_scattering_per_m"):
        values = getattr(optics, name)
        if values.ndim == 3 and values.shape[1:] != shape:
            raise ValidationError(f"optics.{name}: expected images of shape {shape}, got {values.shape[1:]}")


def _alike(scattering: np.ndarray) -> list[list[int]]:
    """Return the wavelengths in groups of equal mu_s'."""
    groups: dict[bytes, list[int]] = {}
    for index, values in enumerate(scattering):
        groups.setdefault(values.tobytes(), []).append(index)
    return list(groups.values())


def _seen(values: np.ndarray, body: Body) -> np.ndarray:
    """Return an image of a coefficient; pixels with their centre outside have the value of the nearest one inside.

    The wall cuts such pixels, and an image of tissue says nothing there.
    """
    if not np.ndim(values):
        return np.full(body.share.shape, float(values))
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~body.inside, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])
