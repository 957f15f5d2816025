"""Figures of results: side by side in one scale of grey, negative pixels in pure red and counted, y upwards.

Importing this module needs matplotlib, the extra ``report``.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.atomic import write_file
from oatkit.data import Image
from oatkit.drawing.page import Figure, png
from oatkit.drawing.sheet import Panel, sheet
from oatkit.errors import ValidationError
from oatkit.result import Result
from oatkit.words import counts_negatives, plane_words


def compare(panels: Sequence[tuple[str, Image, Sequence[str]]], title: str = "", caption: str = "") -> Figure:
    """Draw the first planes of images side by side in one colour scale.

    A panel is its title, its image, and the lines of text beneath: figures of merit, the number of negative pixels.
    """
    if not panels:
        raise ValidationError("a figure needs at least one panel")
    return sheet([[Panel(name, image, tuple(lines)) for name, image, lines in panels]], (), title, caption)


def write_comparison(
    path: Path,
    panels: Sequence[tuple[str, Image, Sequence[str]]],
    title: str = "",
    caption: str = "",
    overwrite: bool = False,
) -> None:
    """Write `compare` as a PNG file. Raises `ResultError` where it exists already, unless `overwrite`."""
    write_file(path, png(compare(panels, title, caption)), overwrite)


def image_figure(result: Result) -> Figure:
    """Draw all images of a result's (first) frame, one panel for each wavelength, with how they came about.

    Those of many wavelengths come first, so that the others share rows.
    """
    boundary = result.get("boundary")
    groups = [
        [
            Panel(_title(image, i), image, tuple(_lines(image, i, boundary)), i, _outline(image, boundary))
            for i, _ in enumerate(image.values)
        ]
        for image in sorted(result.values(), key=lambda image: len(image.values) == 1)
    ]
    name = result.scan.get("name") or "Reconstruction"
    return sheet(groups, (), f"{name}, frame {result.frame_index}", " · ".join(_provenance(result)))


def _outline(image: Image, boundary: Image | None) -> Image | None:
    """Return the outline of the body for the pictures that are about it: where it lies, and the light in it."""
    return boundary if image.quantity in ("boundary", "fluence") else None


def _title(image: Image, index: int) -> str:
    quantity = image.quantity.replace("_", " ")
    return f"{quantity}, {image.wavelengths_nm[index]:g} nm" if image.wavelengths_nm else quantity


def _lines(image: Image, index: int, boundary: Image | None) -> Iterator[str]:
    """Yield how many pixels of one wavelength are negative, what else is worth saying, what its solver promises."""
    plane, found = image.values[index], image.diagnostics
    negative = int((plane < 0).sum())
    if counts_negatives(image):
        share = 100 * negative / max(1, int(np.isfinite(plane).sum()))
        yield f"{negative:,} negative pixel{'s' * (negative > 1)} ({share:.1f} %)" if negative else "no negative pixels"
    yield from plane_words(image, index, boundary)
    gap = _of_wavelength(found.get("relative_gap"), index)
    if gap is not None and math.isfinite(gap):
        yield f"certified within {gap:.1e} of the optimum"
    elif gap is not None and math.isinf(gap):
        yield "uncertified"
    if _of_wavelength(found.get("converged"), index) is False:
        yield "did not converge"


def _of_wavelength(value: Any, index: int) -> Any:
    return value[index] if isinstance(value, tuple | list | np.ndarray) else value


def _provenance(result: Result) -> Iterator[str]:
    """Yield solver with weight, speed of sound and version, as far as they are known."""
    solver, asked = result.pipeline.get("reconstruct") or {}, result.requested.get("reconstruct") or {}
    if "use" in solver:
        yield str(solver["use"])
    if isinstance(solver.get("weight"), int | float):
        rule = f" (by {asked['weight']})" if isinstance(asked.get("weight"), str) else ""
        yield f"weight {solver['weight']:.3g}{rule}"
    if "speed_of_sound_m_s" in result.scan:
        origin = result.scan.get("speed_of_sound_source")
        yield f"speed of sound {result.scan['speed_of_sound_m_s']:.1f} m/s" + (f" ({origin})" if origin else "")
    if "oatkit" in result.versions:
        yield f"oatkit {result.versions['oatkit']}"
