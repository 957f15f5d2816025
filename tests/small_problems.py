"""Small inverse problems that a dense matrix describes, for every solver to be tried on."""

import numpy as np
from scipy.optimize import minimize

from oatkit import Geometry, Grid, plugin
from oatkit.api import Problem
from oatkit.simulate import arc_detectors, simulate_scan


def noise_like(seed=0, rows=60, shape=(5, 6)):
    """More data than pixels, a matrix and data of random numbers."""
    rng = np.random.default_rng(seed)
    return Problem(rng.standard_normal((rows, shape[0] * shape[1])), rng.standard_normal(rows), shape)


def too_few_data(seed=1):
    """A third as many data as pixels."""
    return noise_like(seed, rows=16, shape=(6, 8))


def blurred(shape=(8, 9), width=1.5, noise=1e-2):
    """A non-negative image behind a strong blur: singular values over many decades."""
    rng = np.random.default_rng(2)
    y, x = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
    matrix = np.exp(-((y[:, None] - y) ** 2 + (x[:, None] - x) ** 2) / (2 * width**2))
    data = matrix @ rng.exponential(size=y.size) ** 2
    return Problem(matrix, data * (1 + noise * rng.standard_normal(y.size)), shape)


def circles(n=20, detectors=16, samples=60, noise=0.02):
    """Derivatives of integrals over circles about detectors on three quarters of a ring, as in optoacoustics."""
    rng = np.random.default_rng(3)
    y, x = (np.mgrid[:n, :n] - (n - 1) / 2).reshape(2, -1)
    radii = np.linspace(0.2, 2.8, samples)[:, None] * n
    rows = []
    for angle in 1.5 * np.pi * np.arange(detectors) / detectors:
        distance = np.hypot(y - 1.5 * n * np.sin(angle), x - 1.5 * n * np.cos(angle))
        offset = (radii - distance) / 1.5
        rows.append(-offset * np.exp(-(offset**2) / 2) / distance)
    matrix = np.concatenate(rows)
    image = sum(np.hypot(y - cy, x - cx) < r for cy, cx, r in [(0, 0, 6), (3, -2, 2), (-4, 3, 1.5), (1, 5, 2)])
    data = matrix @ image
    return Problem(matrix, data + noise * np.sqrt((data**2).mean()) * rng.standard_normal(data.size), (n, n))


def scanned(coverage_deg=270.0):
    """A breast-like body of 64 x 64 pixels behind the arc model, simulated on a finer grid, with noise."""
    geometry = Geometry(arc_detectors(64, coverage_deg=coverage_deg), 20e6, 900, 15e-6, 1500)
    arc = plugin("forward_model", "arc")()
    scan = simulate_scan("breast", arc, geometry=geometry, pixels=151, snr_db=30.0)
    grid = Grid((64, 64), 25e-3 / 64)
    return Problem(arc.operator(geometry, grid), np.ravel(scan.signals[0, 0]), grid.shape, geometry, grid)


def three_pixels():
    """The identity and the data 1, 0, -1: the optimum can be written down pixel by pixel."""
    return Problem(np.eye(3), np.array([1.0, 0.0, -1.0]), (1, 3))


class Counting:
    """The operator of a problem, counting its applications; it has no dtype, as operators need none."""

    def __init__(self, problem):
        self.problem, self.shape = problem, problem.operator.shape
        self.forwards = self.adjoints = 0

    def matvec(self, image):
        self.forwards += 1
        return self.problem.forward(image)

    def rmatvec(self, data):
        self.adjoints += 1
        return self.problem.adjoint(data).ravel()


PROBLEMS = {
    "noise_like": noise_like,
    "too_few_data": too_few_data,
    "blurred": blurred,
    "circles": circles,
    "three_pixels": three_pixels,
}


def dense(problem):
    """The matrix of a problem."""
    return problem.operator.matmat(np.eye(problem.operator.shape[1]))


def scaled(problem, operator=1.0, data=1.0):
    """The same problem with operator and data multiplied by numbers."""
    return Problem(operator * dense(problem), data * problem.data, problem.shape)


def minimised(function, start, lowest):
    """The optimum that scipy's L-BFGS-B finds of a function of value and gradient, above a lowest pixel value."""
    options = {"maxiter": 20000, "maxfun": 100000, "ftol": 0, "gtol": 0, "maxcor": 50}
    found = minimize(
        function, start, jac=True, method="L-BFGS-B", bounds=[(lowest, None)] * start.size, options=options
    )
    return found.x, found.fun
