"""A body with vessels of known oxygen saturation, drawn by a seed.

It is invented, no animal was measured for it; what its tissues are made of is that of `oatkit.spectra.TISSUES`, with
one scattering everywhere, so that a light model can be given the true one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import Self

import numpy as np

from oatkit.content import check_range
from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.polygons import signed_distance
from oatkit.shapes import EllipseRegion
from oatkit.simulate.raster import SAMPLE_M
from oatkit.spectra import TISSUES, Tissue
from oatkit.spectra.tables import GRAM_PER_LITRE, GRAM_PER_MOL

WHOLE_BLOOD_MOL_PER_M3 = 1e3 * GRAM_PER_LITRE / GRAM_PER_MOL
"""Haemoglobin in whole blood, mol/m^3."""
MEAN_REACH_M = 10.2e-3
SKIN_M = 0.4e-3
"""Thickness of the skin along the way to the origin, m."""
SKIN_INDEX = 1
"""Where the skin stands in `OxygenBody.tissues`."""
GAP_M = 0.4e-3
"""Least distance between the walls of two vessels, m."""
DEPTHS_M = (1.5e-3, 9e-3)
SATURATIONS = (0.4, 0.98)
"""Of the vessels, in equal steps, in an order that does not depend on that of the depths."""
ANGLES = np.arange(4096) * (2 * np.pi / 4096)
"""Directions in which the outline is sampled: within 0.1 um of the curve."""


@dataclass(frozen=True)
class Inclusion:
    """An ellipse of one tissue: an organ or a vessel."""

    name: str
    centre_m: tuple[float, float]
    """(y, x), m."""
    half_axes_m: tuple[float, float]
    """Along y and x before it is turned, m."""
    tissue: Tissue
    angle_rad: float = 0.0
    """Turn, anticlockwise."""

    def contains(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Say which points (m) lie inside."""
        y, x = y - self.centre_m[0], x - self.centre_m[1]
        c, s = np.cos(self.angle_rad), np.sin(self.angle_rad)
        return ((c * y - s * x) / self.half_axes_m[0]) ** 2 + ((s * y + c * x) / self.half_axes_m[1]) ** 2 <= 1

    def region(self, erode_m: float = 0.0) -> EllipseRegion:
        """Return it as a region of interest, its half axes shorter by `erode_m`.

        Raises `ValidationError` where nothing would be left.
        """
        check_range("erode_m", erode_m, 0.0, min(self.half_axes_m) - 1e-6, "nothing of the inclusion would be left")
        y, x = (half - erode_m for half in self.half_axes_m)
        return EllipseRegion(self.name, self.centre_m, (y, x), self.angle_rad)


@dataclass(frozen=True, eq=False)
class OxygenBody:
    """Tissue with a skin, organs and vessels in clear water; of two that overlap, the later one counts.

    All quantities exist on any grid, as means over the area of each pixel, so data and truth need not share one.
    """

    waves: np.ndarray
    """Amplitude and phase of the waves around the circle, of 2, 3, ... periods, shape ``(2, n)``."""
    tissue: Tissue
    skin: Tissue
    organs: tuple[Inclusion, ...]
    vessels: tuple[Inclusion, ...]

    @classmethod
    def draw(cls, seed: int, n_vessels: int = 7) -> Self:
        """Draw a body about 20 mm across with vessels of 0.6 to 1.5 mm and three organs.

        Depths and saturations of the vessels are spread evenly over `DEPTHS_M` and `SATURATIONS`; a vessel holds 30
        to 100 % of whole blood. The tissue holds 2 to 4 % of blood, 60 to 70 % saturated.

        Raises `ValidationError` unless there are 1 to 10 vessels: more do not fit.
        """
        check_range("n_vessels", n_vessels, 1, 10, "more vessels do not fit")
        rng = np.random.default_rng(seed)
        waves = np.stack([[0.04, 0.025, 0.015, 0.01] * rng.uniform(0.5, 1, 4), rng.uniform(0, 2 * np.pi, 4)])
        soft = TISSUES["soft-tissue"]
        tissue = replace(soft, blood_volume=rng.uniform(0.02, 0.04), oxygen_saturation=rng.uniform(0.6, 0.7))
        body = cls(waves, tissue, _scattering_as(soft, TISSUES["skin"]), _draw_organs(rng, soft), ())
        drawn = body._draw_vessels(rng, n_vessels)
        while not _apart(drawn):
            drawn = body._draw_vessels(rng, n_vessels)
        return replace(body, vessels=drawn)

    def with_saturations(self, saturations: Mapping[str, float]) -> Self:
        """Return the body with other saturations in the vessels that are named, as in a gas challenge.

        Raises `ValidationError` for an unknown name or a saturation outside 0 .. 1.
        """
        names = [vessel.name for vessel in self.vessels]
        for name, value in saturations.items():
            if name not in names:
                raise ValidationError(f"no vessel named '{name}'{did_you_mean(name, names)}")
            check_range(f"saturation of {name}", value, 0.0, 1.0, "a share of the haemoglobin")
        changed = (
            replace(v, tissue=replace(v.tissue, oxygen_saturation=saturations.get(v.name, v.tissue.oxygen_saturation)))
            for v in self.vessels
        )
        return replace(self, vessels=tuple(changed))

    def reach(self, angle: np.ndarray) -> np.ndarray:
        """Return how far the outline is from the origin in each direction, m."""
        amplitudes, phases = self.waves
        waves = (a * np.cos(k * angle + p) for k, (a, p) in enumerate(zip(amplitudes, phases, strict=True), 2))
        return MEAN_REACH_M * (1 + sum(waves))

    @cached_property
    def outline_m(self) -> np.ndarray:
        """Closed polygon that follows the outline, shape ``(n, 2)``, each ``(y, x)``, m."""
        return self.reach(ANGLES)[:, None] * np.column_stack([np.sin(ANGLES), np.cos(ANGLES)])

    def boundary(self, grid: Grid) -> Image:
        """Return the true signed distance of each pixel's centre from the outline, m, negative inside."""
        return Image(signed_distance(self.outline_m, grid), "boundary", "m", grid)

    def depth_m(self, point_m: np.ndarray | tuple[float, float]) -> float:
        """Return the distance of a point ``(y, x)`` inside of the body from its outline, m."""
        return float(np.hypot(*(self.outline_m - point_m).T).min())

    @property
    def tissues(self) -> tuple[Tissue, ...]:
        """All tissues: of the body, the skin, each organ and each vessel."""
        return (self.tissue, self.skin, *(inclusion.tissue for inclusion in self.organs + self.vessels))

    def which(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the place in `tissues` of the tissue at each point (m), int8; -1 outside of the body."""
        depth = self.reach(np.arctan2(y, x)) - np.hypot(y, x)
        index = np.where(depth > SKIN_M, 0, np.where(depth >= 0, SKIN_INDEX, -1)).astype(np.int8)
        for number, inclusion in enumerate(self.organs + self.vessels, 2):
            index[inclusion.contains(y, x) & (depth > SKIN_M)] = number
        return index

    def shares(self, grid: Grid) -> np.ndarray:
        """Return which share of each pixel's area each of `tissues` fills, shape ``(tissue, ny, nx)``.

        Each pixel is sampled in the middles of equal squares of at most `SAMPLE_M`, at least two a side.
        """
        parts = max(2, ceil(grid.pixel_size_m / SAMPLE_M - 1e-9))
        ny, nx = grid.shape
        fine = Grid((ny * parts, nx * parts), grid.pixel_size_m / parts, grid.centre_m)
        found = self.which(fine.y_m[:, None], fine.x_m[None, :]).reshape(ny, parts, nx, parts)
        return np.stack([(found == number).mean(axis=(1, 3)) for number in range(len(self.tissues))])

    def absorption_of_tissues(self, wavelengths_nm: Sequence[float]) -> np.ndarray:
        """Return mu_a of each of `tissues`, shape ``(wavelength, tissue)``, 1/m."""
        return np.stack([tissue.optics(wavelengths_nm).absorption_per_m for tissue in self.tissues], axis=1)

    def scattering_of_tissues(self, wavelengths_nm: Sequence[float]) -> np.ndarray:
        """Return mu_s' of each of `tissues`, shape ``(wavelength, tissue)``, 1/m."""
        return np.stack([tissue.optics(wavelengths_nm).reduced_scattering_per_m for tissue in self.tissues], axis=1)

    def absorption(self, grid: Grid, wavelengths_nm: Sequence[float]) -> Image:
        """Return mu_a, 1/m; zero outside of the body. Raises `ValidationError` beyond the range of the spectra."""
        values = np.tensordot(self.absorption_of_tissues(wavelengths_nm), self.shares(grid), axes=1)
        return Image(values, "absorption", "1/m", grid, tuple(wavelengths_nm))

    def total_haemoglobin(self, grid: Grid) -> Image:
        """Return the concentration of haemoglobin, mol/m^3; zero outside of the body."""
        values = np.tensordot(self._haemoglobin, self.shares(grid), axes=1)
        return Image(values, "total_haemoglobin", "mol/m^3", grid)

    def so2(self, grid: Grid) -> Image:
        """Return which share of the haemoglobin in each pixel is oxygenated; NaN outside of the body."""
        shares = self.shares(grid)
        total = np.tensordot(self._haemoglobin, shares, axes=1)
        saturations = np.array([tissue.oxygen_saturation for tissue in self.tissues])
        oxygenated = np.tensordot(self._haemoglobin * saturations, shares, axes=1)
        return Image(np.divide(oxygenated, total, np.full(grid.shape, np.nan), where=total > 0), "so2", "", grid)

    @property
    def _haemoglobin(self) -> np.ndarray:
        """mol/m^3, shape ``(tissue,)``."""
        return WHOLE_BLOOD_MOL_PER_M3 * np.array([tissue.blood_volume for tissue in self.tissues])

    def _draw_vessels(self, rng: np.random.Generator, n: int) -> tuple[Inclusion, ...]:
        depths, saturations = rng.permutation(np.linspace(*DEPTHS_M, n)), rng.permutation(np.linspace(*SATURATIONS, n))
        angles = rng.uniform(0, 2 * np.pi) + 2 * np.pi / n * (np.arange(n) + rng.uniform(-0.25, 0.25, n))
        radii, blood = rng.uniform(0.3e-3, 0.75e-3, n), rng.uniform(0.3, 1.0, n)
        return tuple(
            Inclusion(
                f"vessel-{number}",
                self._below(angle, depth),
                (radius, radius),
                replace(TISSUES["soft-tissue"], blood_volume=share, oxygen_saturation=saturation),
            )
            for number, (angle, depth, radius, share, saturation) in enumerate(
                zip(*np.array([angles, depths, radii, blood, saturations]).tolist(), strict=True), 1
            )
        )

    def _below(self, angle: float, depth_m: float) -> tuple[float, float]:
        """Return the outermost point ``(y, x)`` in a direction that is `depth_m` from the outline, to 1 um."""
        direction = np.array([np.sin(angle), np.cos(angle)])
        point = direction * self.reach(np.array(angle))
        # A step changes the distance from the outline by no more than its length, so none goes too far.
        while (missing := depth_m - self.depth_m(point)) > 1e-6:
            point = point - missing * direction
        return (float(point[0]), float(point[1]))


def _scattering_as(tissue: Tissue, other: Tissue) -> Tissue:
    """Return `other` with the scattering of `tissue`."""
    return replace(other, scattering_per_m=tissue.scattering_per_m, scattering_power=tissue.scattering_power)


def _draw_organs(rng: np.random.Generator, soft: Tissue) -> tuple[Inclusion, ...]:
    """Return organs of three tissues, each in its third of a turn."""
    around = rng.uniform(0, 2 * np.pi) + 2 * np.pi / 3 * (np.arange(3) + rng.uniform(-0.15, 0.15, 3))
    away, turns = rng.uniform(4.2e-3, 5.2e-3, 3), rng.uniform(0, np.pi, 3)
    return tuple(
        Inclusion(
            name,
            (float(r * np.sin(angle)), float(r * np.cos(angle))),
            tuple(rng.uniform(1.4e-3, 2.4e-3, 2).tolist()),
            _scattering_as(soft, TISSUES[name]),
            float(turn),
        )
        for name, angle, r, turn in zip(("kidney", "bowel", "muscle"), around, away, turns, strict=True)
    )


def _apart(vessels: tuple[Inclusion, ...]) -> bool:
    """Say whether no two circular vessels come closer than `GAP_M`."""
    centres, radii = np.array([v.centre_m for v in vessels]), np.array([v.half_axes_m[0] for v in vessels])
    between = np.hypot(*(centres[:, None] - centres).transpose(2, 0, 1)) - radii[:, None] - radii
    return bool((between[np.triu_indices(len(vessels), 1)] >= GAP_M).all())
