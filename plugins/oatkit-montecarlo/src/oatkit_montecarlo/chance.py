"""Random numbers: a stream for each photon, so that nothing depends on who follows it.

References:
    [Steele2014] Steele, Lea and Flood, ACM SIGPLAN Notices 49, 453 (2014), 10.1145/2714064.2660195.
    [Marsaglia1972] Marsaglia, Ann. Math. Stat. 43, 645 (1972), 10.1214/aoms/1177692644.
"""

from typing import Any

import numpy as np

from oatkit_montecarlo.compiled import kernel, part


@kernel
def mixed(z: Any) -> Any:
    """Return the finaliser of SplitMix64 [Steele2014]_ of 64 bits."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@part
def seeded(stream: np.ndarray, seed: int, photon: int) -> None:
    """Begin the stream of a photon, which depends on nothing but its number and the seed."""
    stream[0] = mixed(mixed(np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15)) + np.uint64(photon))


@part
def uniform(stream: np.ndarray) -> float:
    """Return the next number of a stream, above 0 and below 1: SplitMix64, a counter and its hash."""
    stream[0] += np.uint64(0x9E3779B97F4A7C15)
    return (np.float64(mixed(stream[0]) >> np.uint64(11)) + 0.5) * 2.0**-53


@part
def in_circle(stream: np.ndarray) -> tuple[float, float, float]:
    """Return a point in the unit circle [Marsaglia1972]_, and the square of its distance from the centre."""
    size = 2.0
    while size >= 1 or size == 0:
        a, b = 2 * uniform(stream) - 1, 2 * uniform(stream) - 1
        size = a * a + b * b
    return a, b, size
