"""In which colours an image is shown, and between which values."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from napari.utils import Colormap
from napari.utils.colormaps import AVAILABLE_COLORMAPS

from oatkit.data import Image
from oatkit.words import FRACTIONS, SIGNED, counts_negatives

PERCENTILE = 99.9
"""Of the finite values, which gets the brightest colour: single hot pixels do not darken an image."""
FLOOR = 1e-11
"""How far below zero colours begin, relative to the brightest.

napari paints the lowest value itself, and all below it, in the colour for "below": with 0 every pixel that is exactly
zero would be red, which is most of a non-negative image. Single precision still tells the two apart."""


def _colours(name: str, colours: np.ndarray, negative: str | None = None) -> Colormap:
    return Colormap(colours, name=f"oatkit {name}", low_color=negative, nan_color="transparent")


def _rising(*colour: int) -> np.ndarray:
    """Return one colour that begins transparent: where there is little of a substance, the anatomy below is seen."""
    return np.array([[*colour, 0], [*colour, 255]]) / 255


def _known(name: str) -> np.ndarray:
    return np.asarray(AVAILABLE_COLORMAPS[name].colors)


# One object for each: napari keeps every colormap that it has ever seen.
INTENSITY = _colours("intensity", _known("gray"), "red")
CONCENTRATION = _colours("concentration", _rising(0, 255, 255), "red")
# From blue to red, as the field paints saturation, and yet with a lightness that rises evenly: plasma without its end,
# which is yellow. A map with grey or white in its middle could not be told from the grey image below.
FRACTION = _colours("fraction", _known("plasma")[:206])
LIGHT = _colours("light", _known("magma"))
# The five-class RdBu of colorbrewer2.org, blue below zero.
CHANGE = _colours(
    "change", np.array([[5, 113, 176], [146, 197, 222], [247, 247, 247], [244, 165, 130], [202, 0, 32]]) / 255
)
CHROMOPHORES = {
    # Negative pixels of what is red itself are green.
    "oxyhaemoglobin": _colours("oxyhaemoglobin", _rising(255, 60, 50), "lime"),
    "deoxyhaemoglobin": _colours("deoxyhaemoglobin", _rising(70, 120, 255), "red"),
    "melanin": _colours("melanin", _rising(205, 130, 60), "red"),
    "lipid": _colours("lipid", _rising(255, 225, 60), "red"),
    "water": _colours("water", _rising(50, 215, 230), "red"),
    "icg": _colours("icg", _rising(60, 240, 90), "red"),
}
"""Of the concentrations of known chromophores; those of others are `CONCENTRATION`."""


def colours_of(image: Image) -> Colormap:
    """Return the colours of an image: those that count negative pixels as a fault show them in pure red."""
    if image.quantity in SIGNED:
        return CHANGE
    if image.quantity in FRACTIONS:
        return FRACTION
    if image.quantity == "fluence":
        return LIGHT
    if image.quantity in CHROMOPHORES:
        return CHROMOPHORES[image.quantity]
    fitted = "fitted_to" in image.diagnostics or image.quantity == "total_haemoglobin"
    return CONCENTRATION if fitted else INTENSITY


@dataclass(frozen=True)
class Limits:
    """Between which values the colours lie."""

    low: float
    high: float

    @classmethod
    def of(cls, image: Image, plane: int | None = None) -> "Limits":
        """Return limits for one plane of an image, or for all of them together."""
        values = image.values if plane is None else image.values[plane]
        if image.quantity in FRACTIONS:
            return cls(0.0, 1.0)
        finite = values[np.isfinite(values)]
        if image.quantity in SIGNED:
            size = _brightest(abs(finite))
            return cls(-size, size)
        return cls.below(_brightest(finite), counts_negatives(image))

    @classmethod
    def below(cls, high: float, negatives_are_red: bool) -> "Limits":
        """Return limits from zero to `high`; with red negatives, from the `FLOOR`."""
        return cls(-FLOOR * high if negatives_are_red else 0.0, high)

    def __iter__(self) -> Iterator[float]:
        return iter((self.low, self.high))


def _brightest(finite: np.ndarray) -> float:
    """Return the percentile of finite values; where that is not positive, the size of the largest, or 1."""
    if not finite.size:
        return 1.0
    high = float(np.percentile(finite, PERCENTILE))
    return high if high > 0 else float(abs(finite).max()) or 1.0
