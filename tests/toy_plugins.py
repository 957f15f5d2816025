"""One plugin of each kind, as small as it can be and right: what the conformance suite must not find fault with."""

from dataclasses import replace
from typing import ClassVar

import numpy as np

from oatkit.api import (
    Detectors,
    FluenceModel,
    ForwardModel,
    Geometry,
    Image,
    Iterate,
    Preprocessor,
    Quadratic,
    Reader,
    ReadError,
    Scan,
    Segmenter,
    Smooth,
    Solver,
    SolverError,
    Unmixer,
    param,
)
from oatkit.spectra import chromophore


class Matrix(ForwardModel):
    """Each pixel is heard as the derivative of a Gaussian, as wide as a pixel, over its distance [Ding2017]_."""

    name: ClassVar[str] = "toy-matrix"

    def operator(self, geometry, grid):
        """Return the dense matrix as a scipy operator."""
        geometry.check_grid(grid)
        from scipy.sparse.linalg import aslinearoperator

        return aslinearoperator(self.matrix(geometry, grid))

    def matrix(self, geometry, grid):
        """Return the matrix, the impulse response applied."""
        response = np.ones(1) if geometry.impulse_response is None else geometry.impulse_response
        before = len(response) // 2
        after = len(response) - 1 - before
        samples = np.arange(-after, geometry.n_samples + before)
        radii = geometry.speed_of_sound_m_s * (geometry.start_time_s + samples / geometry.sampling_rate_hz)
        y, x = (axis.ravel() for axis in np.meshgrid(grid.y_m, grid.x_m, indexing="ij"))
        blocks = []
        for at_y, at_x in geometry.detectors.positions_m:
            distance = np.hypot(y - at_y, x - at_x)
            offset = (radii[:, None] - distance) / grid.pixel_size_m
            ideal = -offset * np.exp(-(offset**2) / 2) / distance
            blocks.append(sum(r * ideal[len(response) - 1 - j :][: geometry.n_samples] for j, r in enumerate(response)))
        return np.concatenate(blocks)


class Landweber(Solver):
    """Projected gradients x <- max(0, x + A^T (b - A x) / |A|^2), after Landweber (1951)."""

    name: ClassVar[str] = "toy-landweber"
    n_iterations: int = param(150, "largest number of steps", at_least=1)
    tolerance: float = param(1e-6, "stop where a step moves the image by this part of it", above=0, below=1)

    def iterate(self, problem):
        """Yield the image after each step."""
        for products, _ in enumerate(problem.settle_norm(), 1):
            yield Iterate(np.zeros(problem.shape), 0, products=products)
        x = np.zeros(problem.shape)
        misfit = -problem.data
        for i in range(self.n_iterations):
            new = np.maximum(x - problem.adjoint(misfit) / (1.02 * problem.norm**2 or 1.0), 0)
            still = np.linalg.norm(new - x) <= self.tolerance * np.linalg.norm(new)
            x, misfit = new, problem.forward(new) - problem.data
            yield self.state(x, misfit, i + 1, problem.norm_products, still)
            if still:
                return

    def state(self, x, misfit, i, spent, still):
        """Return the state after i steps."""
        residual = float(np.linalg.norm(misfit))
        reason = f"stopped after {i} steps; raise n_iterations" if i == self.n_iterations and not still else ""
        return Iterate(x, i, residual**2, residual, products=spent + i, converged=still, reason=reason)


class Ridge(Quadratic, Smooth):
    """|x|^2, Tikhonov's penalty (1963)."""

    name: ClassVar[str] = "toy-ridge"

    def value(self, image):
        """Return |x|^2."""
        return float((image**2).sum())

    def gradient(self, image):
        """Return 2 x."""
        return 2.0 * image

    def operator(self, shape):
        """Return the identity."""
        from scipy.sparse.linalg import aslinearoperator

        return aslinearoperator(np.eye(shape[0] * shape[1]))


class Threshold(Segmenter):
    """The body is what is brighter than a share of the brightest pixel."""

    name: ClassVar[str] = "toy-threshold"
    share: float = param(0.5, "least brightness, relative to the brightest pixel", above=0, below=1)

    def segment(self, image):
        """Return the distance to the rim of what is bright."""
        plane = image.values.sum(axis=0)
        inside = plane > self.share * plane.max()
        if not inside.any():
            raise SolverError("nothing is bright")
        return self.distance(inside, image.grid)

    def distance(self, inside, grid):
        """Return the signed distance to the rim of a mask."""
        from scipy.ndimage import distance_transform_edt as edt

        pixels = np.where(inside, 0.5 - edt(inside), edt(~inside) - 0.5)
        return Image(grid.pixel_size_m * pixels, "boundary", "m", grid)


class Exponential(FluenceModel):
    """exp(-mu_eff d) below the nearest wall, after Beer and Lambert."""

    name: ClassVar[str] = "toy-exponential"

    def fluence(self, boundary, optics):
        """Return the light at each wavelength."""
        distance = boundary.values[0]
        if not (distance < 0).any():
            raise SolverError("no body")
        mu_a, scattering = (
            v if v.ndim == 3 else v[:, None, None] for v in (optics.absorption_per_m, optics.reduced_scattering_per_m)
        )
        light = np.exp(-np.sqrt(3 * mu_a * (mu_a + scattering)) * np.maximum(-distance, 0))
        return Image(light, "fluence", "", boundary.grid, optics.wavelengths_nm)


class Pseudoinverse(Unmixer):
    """c = E^+ mu_a in each pixel, by least squares."""

    name: ClassVar[str] = "toy-pseudoinverse"
    chromophores: tuple[str, ...] = param(("oxyhaemoglobin", "deoxyhaemoglobin"), "what is fitted")

    def unmix(self, problem):
        """Return an image of each chromophore."""
        data = problem.absorption or problem.initial_pressure
        spectra = np.stack([chromophore(name).spectrum(data.wavelengths_nm) for name in self.chromophores], axis=1)
        found = np.tensordot(np.linalg.pinv(spectra), data.values, 1)
        pairs = zip(self.chromophores, found, strict=True)
        return {name: Image(plane, name, "mol/m^3", data.grid) for name, plane in pairs}


class Smoothing(Preprocessor):
    """Convolves the records with a triangle, and tells the model."""

    name: ClassVar[str] = "toy-smoothing"
    length: int = param(9, "samples of the triangle, an odd number", at_least=1, at_most=99)

    def process(self, scan):
        """Return the smoothed scan."""
        kernel = np.bartlett(self.length + 2)[1:-1]
        kernel = kernel / kernel.sum()
        signals = np.apply_along_axis(np.convolve, 3, np.asarray(scan.signals, float), kernel, "same")
        given = scan.geometry.impulse_response
        response = np.convolve(np.ones(1) if given is None else given, kernel)
        valid = scan.valid & np.isfinite(signals).all(axis=3)
        told = replace(scan.geometry, impulse_response=response)
        return replace(scan, signals=signals, valid=valid, geometry=told, notes=(*scan.notes, "smoothed"))


MAGIC = b"TOY1"


class Toy(Reader):
    """Reads files of 4 bytes "TOY1" and 5 x 20 numbers of 8 bytes."""

    name: ClassVar[str] = "toy-file"

    def can_read(self, path):
        """Claim a file by its first bytes."""
        try:
            with open(path, "rb") as file:
                return file.read(4) == MAGIC
        except (OSError, ValueError):
            return False

    def read(self, path):
        """Return the scan."""
        content = path.read_bytes()
        if content[:4] != MAGIC or len(content) != 804:
            raise ReadError(f"{path}: expected TOY1 and 800 bytes")
        detectors = Detectors(0.02 * np.column_stack([np.sin(np.arange(5)), np.cos(np.arange(5))]))
        signals = np.frombuffer(content[4:]).reshape(1, 1, 5, 20)
        return Scan(signals, Geometry(detectors, 40e6, 20), (700.0,), source=str(path), reader=self.name)


def write_toy(path):
    """Write a file for `Toy`."""
    path.write_bytes(MAGIC + np.random.default_rng(0).standard_normal(100).tobytes())
    return path


TOYS = (Matrix, Landweber, Ridge, Threshold, Exponential, Pseudoinverse, Smoothing, Toy)
