"""Whether a result can be trusted, at a glance: what was checked, and what was found."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from oatkit.data import Image
from oatkit.report.facts import gap_words, of_plane, plane_name, spaced
from oatkit.result import Result
from oatkit.words import counts_negatives


@dataclass(frozen=True)
class Check:
    """One thing that was looked at."""

    good: bool
    text: str


def checks(result: Result) -> Iterator[Check]:
    """Yield whether solvers converged, how many pixels are negative or undefined, and whether frames failed."""
    for name, image in result.items():
        yield from _convergence(spaced(name), image)
        yield from _passes(spaced(name), image)
    yield from _negative_pixels(result)
    yield from _saturation(result)
    yield from _undefined(result)
    if result.failed:
        yield Check(False, f"{len(result.failed)} of {result.frames} frames failed")


def negative_count(image: Image, index: int | None = None) -> tuple[int, int]:
    """Return how many pixels of one plane, or of all, are negative, and of how many that are defined."""
    values = image.values if index is None else image.values[index]
    return int((values < 0).sum()), int(np.isfinite(values).sum())


def share_words(count: int, total: int) -> str:
    """Write a share, ``"3 negative pixels"`` being the words around it."""
    return f"{100 * count / max(1, total):.1f} %"


def _convergence(name: str, image: Image) -> Iterator[Check]:
    found = image.diagnostics
    planes = range(len(image.values))
    failed = [plane_name(image, i) or name for i in planes if of_plane(found, "converged", i) is False]
    if failed:
        yield Check(False, f"{name}: the solver did not converge at {', '.join(failed)}")
    elif "converged" in found:
        yield Check(True, f"{name}: the solver converged{' at every wavelength' if len(planes) > 1 else ''}")
    if "relative_gap" in found:
        gaps = [of_plane(found, "relative_gap", i) for i in planes]
        uncertified = sum(gap_words(gap) == "uncertified" for gap in gaps)
        if uncertified:
            yield Check(False, f"{name}: {uncertified} of {len(planes)} planes without a certificate of optimality")
        else:
            yield Check(True, f"{name}: certified within {gap_words(max(gaps))} of the optimum")


def _passes(name: str, image: Image) -> Iterator[Check]:
    """Look at an image that was found in passes between absorption and light."""
    if image.diagnostics.get("diverged") is True:
        yield Check(False, f"{name}: the passes between absorption and light ran away")
    elif image.diagnostics.get("settled") is False:
        yield Check(False, f"{name}: the passes between absorption and light had not settled")


def _saturation(result: Result) -> Iterator[Check]:
    if "so2" in result:
        values = result["so2"].values
        beyond = int(((values < 0) | (values > 1)).sum())
        if beyond:
            yield Check(False, f"sO₂: {beyond:,} pixels outside of 0 .. 1, which no blood has")
        else:
            yield Check(True, "sO₂ lies in 0 .. 1 or is undefined in every pixel")


def _negative_pixels(result: Result) -> Iterator[Check]:
    counted = {name: negative_count(image) for name, image in result.items() if counts_negatives(image)}
    for name, (count, total) in counted.items():
        if count:
            yield Check(False, f"{spaced(name)}: {count:,} negative pixels ({share_words(count, total)})")
    if counted and not any(count for count, _ in counted.values()):
        yield Check(True, "no negative pixel in any image")


def _undefined(result: Result) -> Iterator[Check]:
    boundary = result.get("boundary")
    if boundary is None:
        return
    body = boundary.values[0] < 0
    for name, image in result.items():
        if image.grid == boundary.grid and (undefined := int((body & ~np.isfinite(image.values).all(0)).sum())):
            yield Check(False, f"{spaced(name)}: undefined in {share_words(undefined, int(body.sum()))} of the body")
