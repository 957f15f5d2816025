"""What a run says of its result on a terminal."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.result import Result
from oatkit.words import counts_negatives, image_words, plane_words

MOST_LINES = 3
"""An image of more wavelengths gets one line for all of them."""


def summary(result: Result) -> Iterator[str]:
    """Yield lines: where the speed of sound came from, each image, and what deserves attention."""
    scan = result.scan
    yield (
        f"{scan['name']}: {result.frames} frame{'s' if result.frames != 1 else ''}, speed of sound "
        f"{scan['speed_of_sound_m_s']:.1f} m/s ({scan['speed_of_sound_source']})"
    )
    for name, image in result.items():
        yield from image_lines(name, image, result.get("boundary"))
    for note in result.warnings:
        yield f"note: {note}"


def image_lines(name: str, image: Image, boundary: Image | None = None) -> Iterator[str]:
    """Yield a line for each wavelength of an image, or one for more than `MOST_LINES`, with the certificates."""
    count = len(image.wavelengths_nm)
    if count > MOST_LINES:
        lowest, highest = min(image.wavelengths_nm), max(image.wavelengths_nm)
        parts = [*_negatives(image, range(count)), *image_words(image, boundary), *_solution(image, range(count))]
        yield f"{name} at {count} wavelengths, {lowest:g} .. {highest:g} nm: {', '.join(parts)}"
        return
    for index in range(len(image.values)):
        wavelength = f" at {image.wavelengths_nm[index]:g} nm" if image.wavelengths_nm else ""
        parts = [*_negatives(image, [index]), *plane_words(image, index, boundary), *_solution(image, [index])]
        yield f"{name}{wavelength}: {', '.join(parts)}"


def _negatives(image: Image, planes: Sequence[int]) -> Iterator[str]:
    """Yield how many pixels are negative, of several planes in the one with most of them."""
    if not counts_negatives(image):
        return
    negative = [int((image.values[i] < 0).sum()) for i in planes]
    worst = int(np.argmax(negative))
    defined = max(1, int(np.isfinite(image.values[planes[worst]]).sum()))
    most = f"at most {negative[worst]}" if len(negative) > 1 and any(negative) else f"{negative[worst]}"
    yield f"{most} of {defined} pixels negative ({100 * negative[worst] / defined:.1f} %)"


def _solution(image: Image, planes: Sequence[int]) -> Iterator[str]:
    """Yield what the solver took, what it left, and what it promises, of several planes the worst."""
    found = image.diagnostics
    if "products" not in found:
        return
    products = [found["products"][i] for i in planes]
    left = [found["residual_norm"][i] / max(found["data_norm"][i], 1e-300) for i in planes]
    yield f"{_range(f'{min(products)}', f'{max(products)}')} products"
    yield f"residual {_range(f'{min(left):.3f}', f'{max(left):.3f}')} of the data"
    gaps = [gap for i in planes if _is_number(gap := found["relative_gap"][i])]
    if gaps:
        some = "" if len(gaps) == len(planes) else f" at {len(gaps)} of {len(planes)} wavelengths"
        yield f"within {max(gaps):.1e} of the optimum{some}"


def _range(low: str, high: str) -> str:
    return low if low == high else f"{low} .. {high}"


def _is_number(value: Any) -> bool:
    return isinstance(value, float) and math.isfinite(value)
