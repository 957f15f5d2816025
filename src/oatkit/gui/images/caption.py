"""What is said of the picture that is looked at."""

from collections.abc import Mapping, Sequence, Sized

import numpy as np

from oatkit.data import Image
from oatkit.words import FRACTIONS, counts_negatives, plane_words

SHOWN_WHERE = "shown_where"
"""Of the diagnostics of an image made to be looked at: in words, which pixels of it are shown."""
PREVIEW = "preview"
"""Of the diagnostics of an image that no run has made: what it is, in words."""


def caption(image: Image | str, plane: int, frame: int | None = None) -> str:
    """Return wavelength, share of negative pixels, and what else is worth saying of a plane; `frame` if it has many."""
    first, *more = _said(image, plane)
    return "\n".join(filter(None, [" · ".join(filter(None, [*_where([image], plane, frame), first])), *more]))


def captions(images: Mapping[str, Image | str], plane: int, frame: int | None = None) -> str:
    """Return what is said of pictures side by side: where the sliders are, and a line for each by its name."""
    lines = [f"{name}: {' · '.join(filter(None, _said(image, plane)))}" for name, image in images.items()]
    return "\n".join(filter(None, [" · ".join(_where(list(images.values()), plane, frame)), *lines]))


def _where(images: Sequence[Image | str], plane: int, frame: int | None) -> list[str]:
    """Return the frame, if it has many, and the wavelength of the first image that knows it."""
    known = [image.wavelengths_nm for image in images if isinstance(image, Image)]
    nm = next((of[_index(of, plane)] for of in known if _index(of, plane) < len(of)), None)
    return [*([] if frame is None else [f"frame {frame}"]), *([] if nm is None else [f"{nm:g} nm"])]


def _said(image: Image | str, plane: int) -> list[str]:
    """Return the share of negative pixels, "" where it is of no matter, and what else there is to say."""
    if isinstance(image, str):
        return [image]
    plane = _index(image.values, plane)
    if not plane < len(image.values):
        return ["this image has no such wavelength"]
    words = [words.partition(",")[0] for words in plane_words(image, plane)]  # windows may be small
    return [_negatives(image, plane), *words, *(str(image.diagnostics.get(key, "")) for key in (PREVIEW, SHOWN_WHERE))]


def _index(planes: Sized, plane: int) -> int:
    """Return which plane is seen: what has one is seen at each wavelength."""
    return 0 if len(planes) == 1 else plane


def _negatives(image: Image, plane: int) -> str:
    if not counts_negatives(image) or image.quantity in FRACTIONS:
        return ""
    values = image.values[plane]
    negative, finite = int((values < 0).sum()), int(np.isfinite(values).sum())
    return f"{100 * negative / finite:.1f} % negative" if negative else "no negative pixels"
