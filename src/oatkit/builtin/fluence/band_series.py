"""Light in a band around the body, as a series of problems in the image plane."""

import numpy as np


def band_series(width_m: float, period_m: float, n_terms: int) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the wave numbers k_n (1/m) and weights of the fluence in the middle plane of a lit band.

    A band of width W, repeated with period L along z, is the Fourier series

    .. math:: 1 = \frac{W}{L} + \sum_{n \ge 1} \frac{2 \sin(\pi n W / L)}{\pi n} \cos(k_n z), \quad k_n = 2 \pi n / L

    and in a body that is the same for all z each term is a problem in the plane, with mu_a + D k_n^2 for mu_a. At z = 0
    the weights sum up to 1; what those of n >= `n_terms` lack of it goes to the last term, since at large k_n the
    solutions are alike: next to nothing but at the wall.
    """
    n = np.arange(n_terms)
    # np.sinc(t) is sin(pi t) / (pi t).
    weights = np.where(n == 0, 1, 2) * (width_m / period_m) * np.sinc(n * width_m / period_m)
    weights[-1] += 1 - weights.sum()
    return 2 * np.pi * n / period_m, weights
