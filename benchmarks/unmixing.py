"""Time non-negative unmixing of all pixels at once against `scipy.optimize.nnls` in a loop over them.

    python benchmarks/unmixing.py

200 x 200 pixels at 12 wavelengths of 680 .. 900 nm, with noise of 5 % of the mean; both solve the same scaled problem.
Runs of the two alternate; the ratio is that of the shortest ones.
"""

import argparse
import os
import platform
from collections.abc import Callable
from time import perf_counter

import numpy as np
import scipy
from scipy.optimize import nnls

from fluence import cpu_model
from oatkit.builtin.unmixers.nonnegative import nonnegative
from oatkit.spectra import CHROMOPHORES

NAMES = ("oxyhaemoglobin", "deoxyhaemoglobin", "water", "lipid", "melanin", "ICG")
WAVELENGTHS_NM = tuple(range(680, 901, 20))
PIXELS = 200 * 200
NOISE = 0.05


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the best is taken")
    repeats = parser.parse_args().repeats
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    print(f"{cpu_model()}, {os.cpu_count()} cores, {versions}, best of {repeats}\n")
    print("200 x 200 pixels x 12 wavelengths")
    print("chromophores   all at once, ms   scipy loop, ms   ratio   largest difference")
    for count in (2, 3, 4, 6):
        fast, slow, difference = compare(count, repeats)
        print(f"{count:12}   {1e3 * fast:15.1f}   {1e3 * slow:14.0f}   {slow / fast:5.0f}   {difference:18.0e}")


def compare(count: int, repeats: int) -> tuple[float, float, float]:
    """Return the seconds of both, and their largest difference over the largest concentration."""
    spectra, data = problem(count)
    fast, slow, found, expected = np.inf, np.inf, np.zeros(0), np.zeros(0)
    for _ in range(repeats):
        seconds, found = timed(lambda: nonnegative(spectra, data))
        fast = min(fast, seconds)
        seconds, expected = timed(lambda: np.stack([nnls(spectra, pixel)[0] for pixel in data]))
        slow = min(slow, seconds)
    return fast, slow, float(abs(found - expected).max() / expected.max())


def problem(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return spectra of length one, ``(wavelength, chromophore)``, and noisy mixtures, ``(pixel, wavelength)``.

    In each pixel, half of the chromophores are absent on average, so that bounds are met.
    """
    rng = np.random.default_rng(count)
    spectra = np.stack([CHROMOPHORES[name].spectrum(WAVELENGTHS_NM) for name in NAMES[:count]], axis=1)
    spectra = spectra / np.linalg.norm(spectra, axis=0)
    concentrations = rng.uniform(0, 1, (PIXELS, count)) * rng.integers(0, 2, (PIXELS, count))
    clean = concentrations @ spectra.T
    return spectra, clean + NOISE * clean.mean() * rng.standard_normal(clean.shape)


def timed(call: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    """Return how long a call takes, s, and what it returns."""
    start = perf_counter()
    made = call()
    return perf_counter() - start, made


if __name__ == "__main__":
    main()
