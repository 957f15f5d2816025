"""What is said of the picture that is looked at."""

import numpy as np

from oatkit.data import Image
from oatkit.words import FRACTIONS, counts_negatives, plane_words


def caption(image: Image | str, plane: int, frame: int | None = None) -> str:
    """Return wavelength, share of negative pixels, and what else is worth saying of a plane; `frame` if it has many."""
    start = [] if frame is None else [f"frame {frame}"]
    if isinstance(image, str):
        return " · ".join([*start, image])
    if len(image.values) == 1:
        plane = 0
    if not plane < len(image.values):
        return " · ".join([*start, "this image has no such wavelength"])
    wavelength = [f"{image.wavelengths_nm[plane]:g} nm"] if image.wavelengths_nm else []
    more = [words.partition(",")[0] for words in plane_words(image, plane)]  # windows may be small
    return "\n".join(filter(None, [" · ".join([*start, *wavelength, *_negatives(image, plane)]), *more]))


def _negatives(image: Image, plane: int) -> list[str]:
    if not counts_negatives(image) or image.quantity in FRACTIONS:
        return []
    values = image.values[plane]
    negative, finite = int((values < 0).sum()), int(np.isfinite(values).sum())
    return [f"{100 * negative / finite:.1f} % negative" if negative else "no negative pixels"]
