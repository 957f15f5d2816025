"""An invented breast-like body, drawn by a seed; all lengths relative to its largest radius."""

from dataclasses import dataclass
from typing import Self

import numpy as np

SKIN, FAT, GLAND, VESSEL = 0.8, 0.2, 0.45, 0.7
TUMOURS = (1.0, 0.75, 0.6)
"""Initial pressure of the tissues; that of fat and gland is modulated by the texture."""
SKIN_DEPTH = 0.045
N_VESSELS = 8
N_WAVES = 12


@dataclass(frozen=True, eq=False)
class Waves:
    """A smooth random field of mean 0 and variance 1: cosine waves of random direction, length and phase."""

    across_y: np.ndarray
    across_x: np.ndarray
    """Wave vectors, shape ``(n,)``."""
    phase: np.ndarray

    @classmethod
    def draw(cls, rng: np.random.Generator, shortest: float, longest: float) -> Self:
        """Draw waves with lengths between `shortest` and `longest`."""
        wave_number = 2 * np.pi / rng.uniform(shortest, longest, N_WAVES)
        direction, phase = rng.uniform(0, 2 * np.pi, (2, N_WAVES))
        return cls(wave_number * np.sin(direction), wave_number * np.cos(direction), phase)

    def __call__(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the field for y of shape ``(ny, 1)`` and x of shape ``(1, nx)``; never beyond sqrt(2 n)."""
        # cos(a + b) by its parts: two matrix products instead of a cosine for every wave and pixel.
        along_y, along_x = y * self.across_y + self.phase, x.T * self.across_x
        return np.sqrt(2 / N_WAVES) * (np.cos(along_y) @ np.cos(along_x).T - np.sin(along_y) @ np.sin(along_x).T)


@dataclass(frozen=True)
class Vessel:
    """A wavy vessel that starts below the skin, leads inwards and tapers to half its width."""

    start: tuple[float, float]
    direction: float
    """Angle of its axis, radians."""
    length: float
    half_width: float
    sway: float
    phase: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a vessel."""
        around = rng.uniform(0, 2 * np.pi)
        return cls(
            start=(0.8 * np.sin(around), 0.8 * np.cos(around)),
            direction=around + np.pi + rng.uniform(-0.7, 0.7),
            length=rng.uniform(0.5, 1.1),
            half_width=rng.uniform(0.006, 0.025),
            sway=rng.uniform(0.03, 0.08),
            phase=rng.uniform(0, 2 * np.pi),
        )

    def contains(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Say which points lie inside."""
        y, x = y - self.start[0], x - self.start[1]
        along = np.cos(self.direction) * x + np.sin(self.direction) * y
        across = np.cos(self.direction) * y - np.sin(self.direction) * x
        angle = 2 * np.pi * along / 0.6 + self.phase
        slope = self.sway * 2 * np.pi / 0.6 * np.cos(angle)
        # To first order, the distance from a sloped line is smaller than the distance across.
        distance = abs(across - self.sway * (np.sin(angle) - np.sin(self.phase))) / np.hypot(1, slope)
        return (along >= 0) & (along <= self.length) & (distance <= self.half_width * (1 - 0.5 * along / self.length))


@dataclass(frozen=True, eq=False)
class Anatomy:
    """One body: skin 0.8, fat about 0.2, fibroglandular tissue about 0.45, vessels 0.7, tumours 1, 0.75 and 0.6."""

    outline: np.ndarray
    """Amplitude and phase of the waves around the circle, two to five of them, shape ``(2, 4)``."""
    texture: Waves
    gland: Waves
    vessels: tuple[Vessel, ...]
    tumours: np.ndarray
    """Centre (y, x) and radius of each, shape ``(3, 3)``."""

    @classmethod
    def draw(cls, seed: int) -> Self:
        """Draw a body."""
        rng = np.random.default_rng(seed)
        outline = np.stack([[0.05, 0.03, 0.015, 0.01] * rng.uniform(0.5, 1, 4), rng.uniform(0, 2 * np.pi, 4)])
        # A third of the circle for each, so that they never touch.
        around = rng.uniform(0, 2 * np.pi) + 2 * np.pi / 3 * (np.arange(3) + rng.uniform(-0.2, 0.2, 3))
        away = rng.uniform(0.25, 0.6, 3)
        return cls(
            outline=outline,
            texture=Waves.draw(rng, 0.08, 0.3),
            gland=Waves.draw(rng, 0.5, 1.2),
            vessels=tuple(Vessel.draw(rng) for _ in range(N_VESSELS)),
            tumours=np.stack([away * np.sin(around), away * np.cos(around), rng.uniform(0.06, 0.13, 3)], axis=1),
        )

    def density(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the initial pressure for y of shape ``(ny, 1)`` and x of shape ``(1, nx)``, within 0 .. 1."""
        depth = self.depth(y, x)
        inside = depth > SKIN_DEPTH
        values = self._tissue(y, x)
        for vessel in self.vessels:
            values[inside & vessel.contains(y, x)] = VESSEL
        for (centre_y, centre_x, radius), value in zip(self.tumours, TUMOURS, strict=True):
            values[np.hypot(y - centre_y, x - centre_x) <= radius] = value
        return np.where(inside, values, np.where(depth > 0, SKIN, 0.0))

    def depth(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the radial distance below the outline, which is at most 1 from the origin."""
        return self.reach(np.arctan2(y, x)) - np.hypot(y, x)

    def reach(self, angle: np.ndarray) -> np.ndarray:
        """Return how far the outline is from the origin in each direction, at most 1."""
        amplitude, phase = self.outline
        bumps = sum(a * np.cos(k * angle + p) for k, a, p in zip(range(2, 6), amplitude, phase, strict=True))
        return (1 + bumps) / (1 + amplitude.sum())

    def _tissue(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return fat and fibroglandular tissue, more of the latter towards the middle, with their texture."""
        share = 1 / (1 + np.exp(-12 * (self.gland(y, x) + 0.9 - 2.5 * (y**2 + x**2))))
        return (FAT + (GLAND - FAT) * share) * (1 + 0.15 * self.texture(y, x))
