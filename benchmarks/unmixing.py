"""Time non-negative unmixing of all pixels at once against `scipy.optimize.nnls` in a loop over them.

    python benchmarks/unmixing.py

200 x 200 pixels at 12 wavelengths of 680 .. 900 nm, with noise of 5 % of the mean; both solve the same scaled problem.
Runs of the two alternate; times are those of the processor, over all threads, and the shortest of each count.
"""

import argparse
import os
import platform
from collections.abc import Callable
from time import process_time

import numpy as np
import scipy
from scipy.optimize import nnls

import oatkit
from fluence import cpu_model
from oatkit.spectra import CHROMOPHORES

WAVELENGTHS_NM = tuple(range(680, 901, 20))
SHAPE = (200, 200)
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
    names = tuple(CHROMOPHORES)[:count]
    unmixer = oatkit.plugin("unmixer", "nnls")(chromophores=names)
    mixture = unmixer.mixture(WAVELENGTHS_NM)
    size = np.linalg.norm(mixture.spectra, axis=0)
    absorption = mixed(mixture.spectra / size)
    pixels = absorption.reshape(len(WAVELENGTHS_NM), -1).T
    fast, slow, found, expected = np.inf, np.inf, np.zeros(0), np.zeros(0)
    for _ in range(repeats):
        seconds, found = timed(lambda: unmixer.fit(mixture, absorption))
        fast = min(fast, seconds)
        seconds, expected = timed(lambda: np.array([nnls(mixture.spectra / size, pixel)[0] for pixel in pixels]))
        slow = min(slow, seconds)
    scaled = found.reshape(count, -1).T * size
    return fast, slow, float(abs(scaled - expected).max() / expected.max())


def mixed(spectra: np.ndarray) -> np.ndarray:
    """Return noisy mixtures of spectra ``(wavelength, chromophore)``, shape ``(wavelength, y, x)``.

    In each pixel, half of the chromophores are absent on average, so that bounds are met.
    """
    rng = np.random.default_rng(spectra.shape[1])
    shape = (spectra.shape[1], *SHAPE)
    clean = np.tensordot(spectra, rng.uniform(0, 1, shape) * rng.integers(0, 2, shape), 1)
    return clean + NOISE * clean.mean() * rng.standard_normal(clean.shape)


def timed(call: Callable[[], np.ndarray]) -> tuple[float, np.ndarray]:
    """Return how much processor time a call takes, s, and what it returns."""
    start = process_time()
    made = call()
    return process_time() - start, made


if __name__ == "__main__":
    main()
