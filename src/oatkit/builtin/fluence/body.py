"""What every model of light asks of the boundary and of the optics."""

import numpy as np

from oatkit.api import Image, Optics, SolverError, ValidationError


def signed_distance(boundary: Image) -> np.ndarray:
    """Return the signed distance, shape ``(y, x)``, m, float64.

    Raises `ValidationError` where it is no such image, `SolverError` where no pixel lies in the body.
    """
    if boundary.unit != "m" or len(boundary.values) != 1:
        raise ValidationError(
            f"boundary: expected one plane of signed distance in m, negative inside, got {len(boundary.values)} "
            f"planes of {boundary.quantity} in '{boundary.unit}'"
        )
    distance = boundary.values[0].astype(float)
    if not np.isfinite(distance).all():
        raise ValidationError("boundary: the signed distance must be finite in every pixel")
    if not (distance < 0).any():
        raise SolverError("fluence: no pixel lies inside the boundary (signed distance below 0 m); there is no body")
    return distance


def properties(optics: Optics, index: int, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mu_a and mu_s' at one wavelength, each a scalar array or one of the shape of `inside` (y, x), 1/m.

    Raises `ValidationError` where an image has another shape, or a pixel of the body neither absorbs nor scatters.
    """
    absorption, scattering = (np.asarray(v[index]) for v in (optics.absorption_per_m, optics.reduced_scattering_per_m))
    for name, values in (("absorption_per_m", absorption), ("reduced_scattering_per_m", scattering)):
        if values.ndim and values.shape != inside.shape:
            raise ValidationError(f"optics.{name}: expected images of shape {inside.shape}, got {values.shape}")
    total = np.broadcast_to(absorption + scattering, inside.shape)[inside]
    if not (total > 0).all():
        raise ValidationError(
            f"optics at {optics.wavelengths_nm[index]:g} nm: mu_a and mu_s' are both 0 1/m in the body, where "
            "diffusion has no meaning"
        )
    return absorption, scattering


CROSS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]])
DIAGONALS = np.array([[1, 0, 1], [0, 0, 0], [1, 0, 1]])


def spread(values: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return an image in which a pixel outside has the mean of the nearest ones inside, if any touches it.

    Cells that the wall cuts may have their centre outside, where an image of tissue says nothing. A scalar stays one.
    """
    if not values.ndim:
        return values
    from scipy.ndimage import correlate

    filled, known = np.where(inside, values, 1.0), inside
    for neighbours in (CROSS, DIAGONALS):
        count = correlate(inside.astype(float), neighbours, mode="constant")
        total = correlate(np.where(inside, values, 0.0), neighbours, mode="constant")
        filled = np.where(~known & (count > 0), total / np.maximum(count, 1), filled)
        known = known | (count > 0)
    return filled
