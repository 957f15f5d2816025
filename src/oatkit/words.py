"""What is worth saying of one plane of an image, by what it shows."""

from collections.abc import Callable, Mapping

import numpy as np

from oatkit.data import Image

SIGNED = ("boundary", "change", "area_under_curve", "wash_in_slope")
"""Quantities that are negative by nature."""


def counts_negatives(image: Image) -> bool:
    """Say whether negative pixels of this image are a fault worth counting."""
    return image.quantity not in (*SIGNED, "fluence")


def plane_words(image: Image, index: int) -> list[str]:
    """Return phrases on plane `index` of an image beyond its negative pixels; none for most quantities."""
    say = WORDS.get(image.quantity)
    return [say(image, image.values[index])] if say else []


def _body(image: Image, plane: np.ndarray) -> str:
    area_mm2 = float((plane < 0).sum() * (1e3 * image.grid.pixel_size_m) ** 2)
    return f"a body of {area_mm2:.0f} mm²"


def _light(image: Image, plane: np.ndarray) -> str:
    return f"{plane.min():.3g} .. {plane.max():.3g} of the incident light"


def _absorption(image: Image, plane: np.ndarray) -> str:
    if image.unit == "a.u.":
        return "in arbitrary units: no calibration"
    return f"calibrated by K = {image.diagnostics.get('calibration', float('nan')):g} a.u. m"


WORDS: Mapping[str, Callable[[Image, np.ndarray], str]] = {
    "boundary": _body, "fluence": _light, "absorption": _absorption,
}  # fmt: skip
"""By quantity."""
