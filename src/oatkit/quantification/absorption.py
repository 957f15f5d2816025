"""From initial pressure to absorption, once it is known how much light reached each pixel."""

from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.tables import AbsorptionTable

UNCALIBRATED = "in arbitrary units: the calibration of the scanner is not known (absorption.calibration)"


def absorption(table: AbsorptionTable, pressure: Image, fluence: Image, boundary: Image) -> Image:
    r"""Return the absorption coefficient inside the boundary; NaN outside, where it is not defined.

    .. math:: \mu_a = \frac{p_0}{K \, \Gamma \, \Phi}

    with the calibration K, the Grueneisen parameter Gamma and the fluence Phi, after Eq. 20 of [Prakash2019]_, which
    drops the first two. Phi is not taken below ``floor`` times its largest value in the body, so that noise is not
    multiplied without end; ``diagnostics`` says of how many pixels. The unit is 1/m, or "a.u." where K is not known.

    Raises `ValidationError` where grids or wavelengths of the images differ.

    References:
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """
    if not pressure.grid == fluence.grid == boundary.grid or pressure.wavelengths_nm != fluence.wavelengths_nm:
        raise ValidationError("absorption: pressure, fluence and boundary must share grid and wavelengths")
    inside = boundary.values[0] < 0
    light = np.where(inside, fluence.values, 0)
    lowest = table.floor * light.max(axis=(1, 2), keepdims=True)
    scale = table.grueneisen * (1.0 if table.calibration is None else table.calibration)
    divisor = scale * np.maximum(light, lowest)
    values = np.divide(pressure.values, divisor, out=np.full(light.shape, np.nan), where=inside & (divisor > 0))
    unit = "a.u." if table.calibration is None else "1/m"
    found = _diagnose(table, inside, light < lowest)
    return Image(
        values.astype(np.float32), "absorption", unit, pressure.grid, pressure.wavelengths_nm, diagnostics=found
    )


def _diagnose(table: AbsorptionTable, inside: np.ndarray, dim: np.ndarray) -> dict[str, Any]:
    return {
        "calibration": "unknown" if table.calibration is None else table.calibration,
        "calibrated_by": "nothing" if table.calibration is None else table.calibrated_by,
        "grueneisen": table.grueneisen,
        "floor": table.floor,
        "floored_pixels": tuple(int(plane[inside].sum()) for plane in dim),
        "mask": "inside the boundary",
        "pixels": int(inside.sum()),
        "notes": (UNCALIBRATED,) if table.calibration is None else (),
    }
