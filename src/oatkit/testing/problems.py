"""Small problems with known answers, on which plugins are tried."""

import weakref
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from oatkit.api import Detectors, Geometry, Grid, Image, Optics, Problem, Scan
from oatkit.simulate import arc_detectors

DISC_CENTRE_MM = (1.5, -2.5)
"""(y, x) of the disc that segmenters are to find."""
DISC_RADIUS_MM = 7.0
FIELD_OF_VIEW_MM = 25.0
"""Of the images of that disc, square."""


def random(*shape: int, seed: int = 0) -> np.ndarray:
    """Return seeded normal deviates: of both signs, the same on every call."""
    return np.random.default_rng(seed).standard_normal(shape)


class Counting:
    """A dense operator that counts its applications, and whose end can be seen through a weak reference."""

    def __init__(self, matrix: np.ndarray) -> None:
        self.matrix, self.shape = matrix, matrix.shape
        self.forwards = self.adjoints = 0

    @property
    def products(self) -> int:
        """Applications of A and of its adjoint, counted together."""
        return max(self.forwards, self.adjoints)

    def matvec(self, image: np.ndarray) -> np.ndarray:
        """Return A x."""
        self.forwards += 1
        return self.matrix @ image

    def rmatvec(self, data: np.ndarray) -> np.ndarray:
        """Return A^T y."""
        self.adjoints += 1
        return self.matrix.T @ data

    def reference(self) -> "weakref.ref[Counting]":
        """Return a weak reference to this operator."""
        return weakref.ref(self)


def well_posed() -> dict[str, tuple[Problem, np.ndarray]]:
    """Return problems by name whose one solution is positive, each with it: condition numbers up to about 3."""
    shape = (6, 8)
    n = shape[0] * shape[1]
    truth = 1.0 + 0.5 * np.sin(np.arange(n)).reshape(shape)
    matrices = {
        "identity": np.eye(n),
        "diagonal": np.diag(np.linspace(1.0, 2.0, n)),
        "random": random(4 * n, n) / n**0.5,
    }
    problems = {name: (Problem(matrix, matrix @ truth.ravel(), shape), truth) for name, matrix in matrices.items()}
    one = np.array([[2.0], [1.0], [-0.5]])
    return problems | {"one pixel": (Problem(one, 3.0 * one[:, 0], (1, 1)), np.full((1, 1), 3.0))}


RINGS_GRID = Grid((16, 14), 4e-4, (3e-4, -2e-4))
RINGS_PULSE_M = 3e-4


def rings_geometry(detectors: int = 24) -> Geometry:
    """Return an array about `RINGS_GRID` on three quarters of a ring."""
    return Geometry(arc_detectors(detectors, 0.012, 270.0), 10e6, 80, 4e-6, 1500.0)


@cache
def rings_matrix(geometry: Geometry) -> np.ndarray:
    """Return an acoustic model as a matrix: each pixel is heard as the derivative of a Gaussian at its distance."""
    y, x = (axis.ravel() for axis in np.meshgrid(RINGS_GRID.y_m, RINGS_GRID.x_m, indexing="ij"))
    radii = geometry.speed_of_sound_m_s * geometry.times_s
    rows = []
    for at_y, at_x in geometry.detectors.positions_m:
        distance = np.hypot(y - at_y, x - at_x)
        offset = (radii[:, None] - distance) / RINGS_PULSE_M
        rows.append(-offset * np.exp(-(offset**2) / 2) * 0.012 / distance)
    return np.concatenate(rows)


def rings_image() -> np.ndarray:
    """Return what is to be seen there: a bright and a dim disc."""
    y, x = np.meshgrid(RINGS_GRID.y_m, RINGS_GRID.x_m, indexing="ij")
    bright = np.hypot(y - 1e-3, x - 0.5e-3) < 1.1e-3
    dim = np.hypot(y + 1e-3, x + 1e-3) < 1.5e-3
    return 2.0 * bright + 1.0 * dim


def rings(scale: float = 1.0) -> Problem:
    """Return the small acoustic problem: 24 detectors, 16 x 14 pixels, data without noise, times a number.

    Each call returns a problem of its own, of which nothing has been computed yet; its operator is a `Counting`.
    """
    geometry = rings_geometry()
    operator = Counting(rings_matrix(geometry))
    data = scale * (operator.matrix @ rings_image().ravel())
    return Problem(operator, data, RINGS_GRID.shape, geometry, RINGS_GRID)


def rings_without(bad: np.ndarray) -> tuple[Problem, Problem | None]:
    """Return the problem in which some detectors do not count, and the one in which they do not exist.

    The second is None where none is left.
    """
    whole, geometry = rings(), rings_geometry()
    rows = np.repeat(~bad, geometry.n_samples)
    matrix = rings_matrix(geometry)
    masked = Problem(matrix * rows[:, None], whole.data * rows, whole.shape, geometry, RINGS_GRID, ~bad)
    if bad.all():
        return masked, None
    fewer = replace(geometry, detectors=Detectors(geometry.detectors.positions_m[~bad]))
    return masked, Problem(matrix[rows], whole.data[rows], whole.shape, fewer, RINGS_GRID)


def disc_grid(pixels: int) -> Grid:
    """Return a grid of so many pixels on a side over the field of view of the disc."""
    return Grid((pixels, pixels), 1e-3 * FIELD_OF_VIEW_MM / pixels)


def disc_distance_m(grid: Grid) -> np.ndarray:
    """Return the signed distance to the disc, shape ``(y, x)``, m, negative inside."""
    y, x = DISC_CENTRE_MM
    return np.hypot(grid.y_m[:, None] - 1e-3 * y, grid.x_m - 1e-3 * x) - 1e-3 * DISC_RADIUS_MM


def disc_image(pixels: int, wavelengths_nm: tuple[float, ...] = (700.0,)) -> Image:
    """Return a disc of brightness 1 and edges one pixel wide, in a background of 0, with noise of 1 %."""
    grid = disc_grid(pixels)
    plane = np.clip(0.5 - disc_distance_m(grid) / grid.pixel_size_m, 0, 1)
    planes = [plane + 0.01 * random(*plane.shape, seed=index) for index in range(len(wavelengths_nm))]
    return Image(np.stack(planes), "initial_pressure", "a.u.", grid, wavelengths_nm)


def boundary_of(distance_m: np.ndarray, grid: Grid) -> Image:
    """Return a signed distance as a segmenter does."""
    return Image(np.asarray(distance_m, dtype=float), "boundary", "m", grid)


def body(pixels: int = 60, radius_m: float = 8e-3) -> Image:
    """Return the boundary of a round body about the origin, in a field of view of 20 mm."""
    grid = Grid((pixels, pixels), 0.02 / pixels)
    return boundary_of(np.hypot(grid.y_m[:, None], grid.x_m) - radius_m, grid)


def slab(half_width_m: float = 5e-3) -> Image:
    """Return the boundary of a body between two walls along x, which the field of view cuts."""
    grid = Grid((60, 24), 0.02 / 60)
    return boundary_of(np.abs(grid.y_m[:, None]) - half_width_m + np.zeros(grid.shape), grid)


def tissue(absorption_per_m: tuple[float, ...], scattering_per_m: float = 1000.0) -> Optics:
    """Return a homogeneous body at as many wavelengths as there are values of mu_a."""
    wavelengths = tuple(700.0 + 50.0 * index for index in range(len(absorption_per_m)))
    return Optics(wavelengths, np.array(absorption_per_m), np.full(len(absorption_per_m), scattering_per_m))


PULSES_GEOMETRY = Geometry(arc_detectors(6, 0.02, 200.0), 40e6, 1024, 2e-6, 1500.0)
"""Its records reach distances of 3 to 41 mm."""
SOURCES_M = ((1e-3, 2e-3, 4.5e-5, 6.0), (-2e-3, 0.5e-3, 2e-4, 3.0), (0.5e-3, -3e-3, 6e-4, 1.5))
"""(y, x, width, strength) of round sources of about equal energy, loudest at 5.3, 1.2 and 0.4 MHz."""


def pulses(geometry: Geometry, sources: Any = SOURCES_M) -> np.ndarray:
    """Return what a few Gaussian sources sound like, ``(detector, sample)``, the impulse response applied.

    Each is heard as the derivative of a Gaussian in distance, over the distance.
    """
    response = np.ones(1) if geometry.impulse_response is None else geometry.impulse_response
    before, after = len(response) // 2, len(response) - 1 - len(response) // 2
    first = geometry.start_time_s - after / geometry.sampling_rate_hz
    times = first + np.arange(geometry.n_samples + before + after) / geometry.sampling_rate_hz
    ideal = np.zeros((geometry.detectors.count, len(times)))
    for y, x, width, strength in sources:
        distance = np.hypot(*(geometry.detectors.positions_m - (y, x)).T)[:, None]
        offset = (geometry.speed_of_sound_m_s * times - distance) / width
        ideal -= strength * offset * np.exp(-(offset**2) / 2) * 0.02 / distance
    # "valid" leaves sample k = sum of response[j] * ideal[k + before - j], counted from the time zero of the response.
    return np.stack([np.convolve(row, response, "valid") for row in ideal])


def pulses_scan(scale: float = 1.0, sources: Any = SOURCES_M, geometry: Geometry = PULSES_GEOMETRY) -> Scan:
    """Return a scan of one frame at two wavelengths, the second one twice as loud, with pulse energies."""
    one = scale * pulses(geometry, sources)
    return Scan(
        np.stack([one, 2 * one])[None], geometry, (700.0, 800.0), pulse_energy=np.array([[0.8, 1.25]]),
        notes=("made for a check",),
    )  # fmt: skip
