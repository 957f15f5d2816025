"""Whether the absorption of a body is one that it can have."""

from collections.abc import Iterator, Mapping

import numpy as np

from oatkit.data import Optics

OFF = 2.0
"""Factor between the mean absorption found and the one stated that is worth no note."""


def implausible(absorption_per_m: np.ndarray, optics: Optics, inside: np.ndarray) -> Iterator[str]:
    """Say where mu_a, shape ``(wavelength, y, x)``, is none that the body can have: a wrong calibration settles, too.

    That is: above mu_s', where the diffusion of light ends, or with a mean over the body, `inside`, that is far from
    the one that `optics` states.
    """
    beyond, means, stated = {}, {}, {}
    for index, wavelength in enumerate(optics.wavelengths_nm):
        mu_a = absorption_per_m[index][inside]
        pixels = int((mu_a > _of_body(optics.reduced_scattering_per_m[index], inside)).sum())
        mean, expected = float(mu_a.mean()), float(np.mean(_of_body(optics.absorption_per_m[index], inside)))
        if pixels:
            beyond[wavelength] = pixels
        if not expected / OFF <= mean <= expected * OFF:
            means[wavelength], stated[wavelength] = mean, expected
    if beyond:
        yield (
            f"{_listed(beyond)} nm: in {max(beyond.values())} pixels the absorption passed mu_s', where the diffusion "
            "of light ends; a calibration that is too low does that"
        )
    if means:
        yield (
            f"{_listed(means)} nm: the mean absorption of the body is {_range(means)} 1/m, but [optics] says "
            f"{_range(stated)}; check the calibration"
        )


def _of_body(values: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return the pixels of an image that lie in the body; a number for all of them stays one."""
    return values[inside] if np.ndim(values) else values


def _listed(by_wavelength: Mapping[float, float]) -> str:
    return ", ".join(f"{w:g}" for w in by_wavelength)


def _range(by_wavelength: Mapping[float, float]) -> str:
    lowest, highest = min(by_wavelength.values()), max(by_wavelength.values())
    return f"{lowest:.3g}" if len(by_wavelength) == 1 else f"{lowest:.3g} .. {highest:.3g}"
