"""What limits the worth of a result."""

from collections.abc import Iterator

import numpy as np

from oatkit_montecarlo.body import Body


def relative_errors(values: np.ndarray, errors: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return the relative standard error in the body, shape ``(wavelength, pixel)``.

    It is 1 in a pixel that only one batch reached, so it is 1, too, where none did.
    """
    seen, spread = values[:, inside], errors[:, inside]
    return np.divide(spread, seen, out=np.ones_like(seen), where=seen > 0)


def notes(body: Body, relative: np.ndarray, wavelengths_nm: tuple[float, ...], beyond_ring: bool) -> Iterator[str]:
    """Yield sentences on the noise and on what the geometry leaves out."""
    medians = np.median(relative, axis=1)
    worst = int(np.argmax(medians))
    yield (
        f"Monte Carlo noise: the median relative standard error over the body is {medians[worst]:.2%} at "
        f"{wavelengths_nm[worst]:g} nm, the noisiest wavelength, and one pixel in twenty has more than "
        f"{np.quantile(relative[worst], 0.95):.2%}; four times n_photons halve it."
    )
    dark = int((relative >= 1).any(axis=0).sum())
    if dark:
        yield f"{dark} pixels of the body were reached by photons of one batch at most: their fluence is not known."
    if body.n_cut_off:
        yield (
            f"The body is cut off by the edge of the grid at {body.n_cut_off} pixels: no light passes there, as if the "
            "body were mirrored."
        )
    if beyond_ring:
        yield "The body reaches beyond the illumination ring: there, no light was lost in the couplant."
