"""What follows from the two forms of haemoglobin."""

from collections.abc import Iterator, Mapping

import numpy as np

OXY, DEOXY = "oxyhaemoglobin", "deoxyhaemoglobin"
PERCENTILE = 99.0


def total_and_saturation(
    concentrations: Mapping[str, np.ndarray], floor: float
) -> Iterator[tuple[str, np.ndarray, float]]:
    r"""Yield ``total_haemoglobin`` and ``so2`` where both forms are known, each with the total below which so2 is NaN.

    .. math:: sO_2 = \frac{HbO_2}{HbO_2 + Hb}

    lies in [0, 1] where neither is negative. Where there is little haemoglobin it is the ratio of two noises: it is NaN
    unless the total exceeds `floor` times its 99th percentile over the defined pixels.
    """
    if not {OXY, DEOXY} <= concentrations.keys():
        return
    total = concentrations[OXY] + concentrations[DEOXY]
    defined = total[np.isfinite(total)]
    least = max(floor * float(np.percentile(defined, PERCENTILE)), 0.0) if defined.size else 0.0
    enough = total > least
    saturation = np.divide(concentrations[OXY], total, out=np.full(total.shape, np.nan), where=enough)
    yield "total_haemoglobin", total, least
    yield "so2", saturation, least
