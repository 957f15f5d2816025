"""What is worth saying of one plane of an image, or of all of them, by what they show."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from oatkit.data import Image

SENSITIVITIES = {"so2_sensitivity_scattering": "mu_s'", "so2_sensitivity_calibration": "K"}
"""Changes of so2, and of what they are the consequence."""
SIGNED = ("boundary", "difference", "change", "area_under_curve", "wash_in_slope", *SENSITIVITIES)
"""Quantities that are negative by nature."""
FRACTIONS = ("so2",)
"""Quantities that lie in 0 .. 1 and are shown in that range, whatever values they take."""


def counts_negatives(image: Image) -> bool:
    """Say whether negative pixels of this image are a fault worth counting."""
    return image.quantity not in (*SIGNED, "fluence")


def plane_words(image: Image, index: int, boundary: Image | None = None) -> list[str]:
    """Return phrases on plane `index` of an image beyond its negative pixels; none for most quantities.

    With the `boundary` of the body they say how much of it has no value.
    """
    return list(_phrases(image, image.values[index : index + 1], boundary))


def image_words(image: Image, boundary: Image | None = None) -> list[str]:
    """Return such phrases on all planes of an image together."""
    return list(_phrases(image, image.values, boundary))


def _phrases(image: Image, planes: np.ndarray, boundary: Image | None) -> Iterator[str]:
    say = WORDS.get(image.quantity) or (_concentration if "fitted_to" in image.diagnostics else None)
    values = planes[np.isfinite(planes)].astype(float)
    if say and not values.size:
        yield "no pixel has a value"
    elif say:
        yield from say(image, values)
    if image.quantity in FRACTIONS and boundary is not None:
        inside = planes[:, boundary.values[0] < 0]
        yield f"undefined in {100 * np.isnan(inside).mean():.1f} % of the body"


def _body(image: Image, values: np.ndarray) -> Iterator[str]:
    area_mm2 = float((values < 0).sum() * (1e3 * image.grid.pixel_size_m) ** 2)
    yield f"a body of {area_mm2:.0f} mm²"


def _light(image: Image, values: np.ndarray) -> Iterator[str]:
    yield f"{values.min():.3g} .. {values.max():.3g} of the incident light"


def _absorption(image: Image, values: np.ndarray) -> Iterator[str]:
    if image.unit == "a.u.":
        yield "in arbitrary units: no calibration"
    else:
        found = image.diagnostics
        source = f" (by {SOURCES.get(by, by)})" if (by := found.get("calibrated_by")) else ""
        yield f"calibrated by K = {found.get('calibration', float('nan')):.4g} a.u. m{source}"


SOURCES = {"spectra": "the spectra"}
"""What a calibration was found by, in words, where that is not what it is called."""


def _concentration(image: Image, values: np.ndarray) -> Iterator[str]:
    yield f"mean {values.mean():.3g} {image.unit}".rstrip()


def _saturation(image: Image, values: np.ndarray) -> Iterator[str]:
    low, median, high = np.percentile(values, [25, 50, 75])
    yield f"median {median:.3f}, half of the pixels in {low:.3f} .. {high:.3f}"


def _misfit(image: Image, values: np.ndarray) -> Iterator[str]:
    yield f"median {np.median(values):.3f} of the data"


def _sensitivity(image: Image, values: np.ndarray) -> Iterator[str]:
    probe = image.diagnostics.get("probe")
    if probe:
        yield f"for {100 * probe:g} % more {SENSITIVITIES[image.quantity]}"
    median, most = np.percentile(abs(values), [50, 95])
    yield f"|change| {median:.4f} in the median, {most:.4f} at the 95th percentile"


WORDS: Mapping[str, Callable[[Image, np.ndarray], Iterator[str]]] = {
    "boundary": _body, "fluence": _light, "absorption": _absorption, "so2": _saturation, "residual": _misfit,
    **dict.fromkeys(SENSITIVITIES, _sensitivity),
}  # fmt: skip
"""By quantity, from an image and those of its values that are finite; what is fitted to spectra has a mean."""
