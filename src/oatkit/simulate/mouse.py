"""An invented slice through the belly of a mouse-like body, drawn by a seed; lengths in mm, absorption in 1/cm.

No animal was measured for it. The absorption values are of the order of those of soft tissue and of blood in the near
infrared, chosen so that organs stand out by factors of two to five and vessels by ten.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from oatkit.simulate.anatomy import Waves

SKIN, FAT, MUSCLE, BONE = 0.9, 0.25, 0.45, 0.3
LIVER, KIDNEY, SPLEEN, GUT = 1.1, 1.4, 1.5, 0.6
SPINAL_MUSCLE = 0.8
AORTA, VEIN, SMALL_VESSEL = 4.0, 3.5, 3.0
"""Absorption of the tissues, 1/cm; that of all but skin and vessels is modulated by a texture of at most 50 %."""
SKIN_DEPTH = 0.4
WALL_DEPTH = 1.0
"""How thick the skin, and skin and muscular wall together, are, mm."""
N_VESSELS = 16
HALF_WIDTH, HALF_HEIGHT = 9.8, 8.3
"""Half axes of the ellipse that the outline varies, mm."""


@dataclass(frozen=True)
class Organ:
    """An ellipse of one tissue."""

    centre: tuple[float, float]
    """(y, x), mm."""
    half_axes: tuple[float, float]
    """Along y and x before it is turned, mm."""
    absorption: float
    turn: float = 0.0
    """Radians, anticlockwise."""

    def contains(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Say which points lie inside."""
        y, x = y - self.centre[0], x - self.centre[1]
        c, s = np.cos(self.turn), np.sin(self.turn)
        return ((c * y - s * x) / self.half_axes[0]) ** 2 + ((s * y + c * x) / self.half_axes[1]) ** 2 <= 1


ORGANS = (
    Organ((4.4, 0.0), (2.2, 4.6), SPINAL_MUSCLE),
    Organ((4.3, 0.0), (1.3, 1.6), BONE),
    Organ((1.2, 4.8), (1.7, 2.3), KIDNEY, 0.4),
    Organ((0.9, -4.9), (1.7, 2.3), KIDNEY, -0.4),
    Organ((-3.4, 3.2), (2.2, 3.6), LIVER, -0.3),
    Organ((-2.3, -6.2), (1.9, 1.0), SPLEEN, -0.3),
    Organ((-4.2, -2.3), (1.7, 2.4), GUT, 0.2),
    Organ((1.9, 0.5), (0.45, 0.45), AORTA),
    Organ((1.3, -0.8), (0.6, 0.7), VEIN),
)
"""What every mouse has; a seed moves each by up to 0.3 mm. A later one covers an earlier one."""

LEGS = (((-5.6, 6.8), (-9.2, 5.9)), ((-5.6, -6.8), (-9.2, -5.9)))
"""Axes of the legs, from hip to knee, (y, x)."""
LEG_RADIUS = 1.7
CREASE = 0.5
"""How far the skin rounds off the crease between leg and belly, mm."""


@dataclass(frozen=True, eq=False)
class Mouse:
    """One body: outline, skin, muscular wall, fat, organs and vessels."""

    bumps: np.ndarray
    """Amplitude and phase of three to five waves around the ellipse, shape ``(2, 3)``."""
    texture: Waves
    organs: tuple[Organ, ...]
    legs: bool = False

    @classmethod
    def draw(cls, seed: int, legs: bool = False) -> Self:
        """Draw a body."""
        rng = np.random.default_rng(seed)
        bumps = np.stack([[0.02, 0.015, 0.01] * rng.uniform(-1, 1, 3), rng.uniform(0, 2 * np.pi, 3)])
        moved = tuple(
            Organ((o.centre[0] + dy, o.centre[1] + dx), o.half_axes, o.absorption, o.turn)
            for o, (dy, dx) in zip(ORGANS, rng.uniform(-0.3, 0.3, (len(ORGANS), 2)), strict=True)
        )
        vessels = tuple(_small_vessel(rng) for _ in range(N_VESSELS))
        return cls(bumps, Waves.draw(rng, 0.8, 4.0), moved + vessels, legs)

    def depth(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return how far below the skin a point is, about, mm: exactly zero on the outline, negative outside."""
        radius, angle = np.hypot(y, x), np.arctan2(y, x)
        depth = self._trunk(angle) - radius
        if not self.legs:
            return depth
        for axis in LEGS:
            depth = CREASE * np.logaddexp(depth / CREASE, _depth_in_capsule(y, x, *axis) / CREASE)
        return depth

    def absorption(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return mu_a in 1/cm for y of shape ``(ny, 1)`` and x of shape ``(1, nx)``, mm; zero outside."""
        depth = self.depth(y, x)
        values = np.where(depth > WALL_DEPTH, FAT, MUSCLE) * np.ones(np.broadcast(y, x).shape)
        vascular = np.zeros(values.shape, bool)
        for organ in self.organs:
            within = organ.contains(y, x) & (depth > SKIN_DEPTH)
            values[within] = organ.absorption
            vascular = np.where(within, organ.absorption >= SMALL_VESSEL, vascular)
        # The texture has a bounded amplitude: at most 0.1 sqrt(2 n) = 0.49 with the 12 waves of `Waves`.
        values = np.where(vascular, values, values * (1 + 0.1 * self.texture(y, x)))
        return np.where(depth > SKIN_DEPTH, values, np.where(depth > 0, SKIN, 0.0))

    def outline_mm(self) -> np.ndarray:
        """Return points along the outline, shape ``(n, 2)``, (y, x), at most 0.06 mm apart and within 1 um of it."""
        from skimage.measure import find_contours

        step = 0.04
        side = step * (np.arange(601) - 300)
        (outline,) = find_contours(self.depth(side[:, None], side[None, :]), 0.0)
        return step * (outline[:-1] - 300)

    def _trunk(self, angle: np.ndarray) -> np.ndarray:
        """Return how far the trunk reaches in each direction, mm: an ellipse with bumps, hollow at back and flanks."""
        ellipse = 1 / np.hypot(np.sin(angle) / HALF_HEIGHT, np.cos(angle) / HALF_WIDTH)
        waves = sum(a * np.cos(k * angle + p) for k, a, p in zip((3, 4, 5), *self.bumps, strict=True))
        hollows = sum(depth * np.exp((np.cos(angle - at) - 1) / 0.03) for at, depth in HOLLOWS)
        return ellipse * (1 + waves - hollows)


HOLLOWS = ((np.pi / 2, 0.05), (-np.pi * 0.28, 0.07), (-np.pi * 0.72, 0.07))
"""Direction and relative depth of the hollows in the outline: along the spine and between belly and thighs."""


def _small_vessel(rng: np.random.Generator) -> Organ:
    around, away = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 0.9)
    centre = (7.2 * away * np.sin(around), 8.6 * away * np.cos(around))
    return Organ(centre, tuple(rng.uniform(0.12, 0.35, 2)), SMALL_VESSEL, rng.uniform(0, np.pi))


def _depth_in_capsule(y: np.ndarray, x: np.ndarray, start: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    """Return the depth below the surface of all points within the leg's radius of a straight axis, mm."""
    dy, dx = end[0] - start[0], end[1] - start[1]
    share = np.clip(((y - start[0]) * dy + (x - start[1]) * dx) / (dy**2 + dx**2), 0, 1)
    return LEG_RADIUS - np.hypot(y - start[0] - share * dy, x - start[1] - share * dx)
