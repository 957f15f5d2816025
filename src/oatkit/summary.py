"""What a run says of its result on a terminal."""

from collections.abc import Iterator

import numpy as np

from oatkit.data import Image
from oatkit.result import Result
from oatkit.words import counts_negatives, plane_words


def summary(result: Result) -> Iterator[str]:
    """Yield lines: where the speed of sound came from, each image, and what deserves attention."""
    scan = result.scan
    yield (
        f"{scan['name']}: {result.frames} frame{'s' if result.frames != 1 else ''}, speed of sound "
        f"{scan['speed_of_sound_m_s']:.1f} m/s ({scan['speed_of_sound_source']})"
    )
    for name, image in result.items():
        yield from image_lines(name, image)
    for note in result.warnings:
        yield f"note: {note}"


def image_lines(name: str, image: Image) -> Iterator[str]:
    """Yield one line for each wavelength of an image, with the certificate where there is one."""
    found = image.diagnostics
    for index, plane in enumerate(image.values):
        wavelength = f" at {image.wavelengths_nm[index]:g} nm" if image.wavelengths_nm else ""
        negative = int((plane < 0).sum())
        parts = plane_words(image, index)
        if counts_negatives(image):
            defined = max(1, int(np.isfinite(plane).sum()))
            parts.insert(0, f"{negative} of {defined} pixels negative ({100 * negative / defined:.1f} %)")
        if "products" in found:
            parts.append(f"{found['products'][index]} products")
            parts.append(
                f"residual {found['residual_norm'][index] / max(found['data_norm'][index], 1e-300):.3f} of the data"
            )
            gap = found["relative_gap"][index]
            if isinstance(gap, float) and gap == gap:
                parts.append(f"within {gap:.1e} of the optimum")
        yield f"{name}{wavelength}: {', '.join(parts)}"
