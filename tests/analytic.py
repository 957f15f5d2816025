"""Signals known in closed form, in the convention p = dI/dR, I = (1/R) * integral over the arc."""

import numpy as np
from scipy.special import i0e, i1e

from oatkit.data import Geometry, Grid


def distances(geometry: Geometry, centre_m: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the detectors' distances to a point (y, x), shape ``(detector, 1)``, and R = c t, ``(sample,)``; m."""
    r0 = np.hypot(*(geometry.detectors.positions_m - centre_m).T)
    return r0[:, None], geometry.speed_of_sound_m_s * geometry.times_s


def gaussian_pressure(geometry: Geometry, centre_m: tuple[float, float], width_m: float) -> np.ndarray:
    """Return p of exp(-|r|^2 / 2 width^2), shape ``(detector, sample)``; R must be positive."""
    r0, radius = distances(geometry, centre_m)
    argument = r0 * radius / width_m**2
    envelope = 2 * np.pi * np.exp(-((r0 - radius) ** 2) / (2 * width_m**2))
    return envelope * (r0 * i1e(argument) - radius * i0e(argument)) / width_m**2


def gaussian_image(grid: Grid, centre_m: tuple[float, float], width_m: float) -> np.ndarray:
    """Return the values of that Gaussian at the pixel centres."""
    y2 = (grid.y_m[:, None] - centre_m[0]) ** 2
    x2 = (grid.x_m - centre_m[1]) ** 2
    return np.exp(-(y2 + x2) / (2 * width_m**2))


def disc_arc(geometry: Geometry, centre_m: tuple[float, float], radius_m: float) -> np.ndarray:
    """Return I (not its derivative) of a disc of height 1, shape ``(detector, sample)``."""
    r0, radius = distances(geometry, centre_m)
    cosine = (r0**2 + radius**2 - radius_m**2) / (2 * r0 * radius)
    return 2 * np.arccos(np.clip(cosine, -1, 1))


def disc_image(grid: Grid, centre_m: tuple[float, float], radius_m: float, per_pixel: int) -> np.ndarray:
    """Return the share of each pixel that the disc covers, from ``per_pixel^2`` points."""
    steps = (np.arange(per_pixel) - (per_pixel - 1) / 2) / per_pixel * grid.pixel_size_m
    y = (grid.y_m[:, None] + steps).ravel() - centre_m[0]
    x = (grid.x_m[:, None] + steps).ravel() - centre_m[1]
    inside = (y[:, None] ** 2 + x**2 <= radius_m**2).astype(float)
    ny, nx = grid.shape
    return inside.reshape(ny, per_pixel, nx, per_pixel).mean(axis=(1, 3))


def low_pass(geometry: Geometry, signals: np.ndarray, edge_hz: float) -> np.ndarray:
    """Return signals without what lies above `edge_hz`, by a cosine that falls over the last fifth below it."""
    spectrum = np.fft.rfft(signals, axis=-1)
    frequencies = np.fft.rfftfreq(signals.shape[-1], 1 / geometry.sampling_rate_hz)
    fall = np.clip((frequencies - 0.8 * edge_hz) / (0.2 * edge_hz), 0, 1)
    return np.fft.irfft(spectrum * 0.5 * (1 + np.cos(np.pi * fall)), signals.shape[-1], axis=-1)


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    """Return |found - expected| / |expected|."""
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))
