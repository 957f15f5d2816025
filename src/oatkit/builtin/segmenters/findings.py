"""From a contour to the image that a segmenter returns, with what the user should know about it."""

import numpy as np

from oatkit.api import Grid, Image
from oatkit.builtin.segmenters.contours import spacing
from oatkit.builtin.segmenters.walls import no_body
from oatkit.polygons import area, signed_distance

LEAST_AREA_SHARE, MOST_AREA_SHARE = 0.02, 0.9
"""Share of the field of view below and above which a body is reported as implausible."""
MOST_RIM_SHARE = 0.02
"""Share of the contour along the edge of the field of view above which the body counts as cut."""


def boundary_image(contour_m: np.ndarray, grid: Grid, notes: tuple[str, ...] = (), **measured: float) -> Image:
    """Return the signed distance to a closed contour of shape ``(n, 2)``, m, negative inside.

    What lies beyond the field of view is moved to its edge. The diagnostics hold ``notes``, ``area_mm2``,
    ``length_mm`` and all that is `measured`. Raises `SolverError` where no area is left.
    """
    contour = _within(contour_m, grid)
    size = abs(area(contour))
    if not size > grid.pixel_size_m**2:
        raise no_body("the contour encloses less than a pixel")
    notes = (*notes, *_plausibility(contour, size, grid))
    length = len(contour) * spacing(contour)
    diagnostics = {"notes": notes, "area_mm2": 1e6 * size, "length_mm": 1e3 * length, **measured}
    return Image(signed_distance(contour, grid), "boundary", "m", grid, diagnostics=diagnostics)


def unseen_note(seen: float, least: float, advice: str) -> tuple[str, ...]:
    """Return the note on a contour of which a share `seen`, less than `least`, lies on a visible wall; else none."""
    if seen >= least:
        return ()
    return (f"{100 * (1 - seen):.0f} % of the contour lies on no visible wall{advice}",)


def _within(contour_m: np.ndarray, grid: Grid) -> np.ndarray:
    left, right, bottom, top = grid.extent_m
    return np.clip(contour_m, (bottom, left), (top, right))


def _plausibility(contour: np.ndarray, size: float, grid: Grid) -> tuple[str, ...]:
    """Return a sentence for each thing about the contour that makes it doubtful."""
    notes = []
    cut = _rim_share(contour, grid)
    if cut > MOST_RIM_SHARE:
        notes.append(
            f"the body is cut by the field of view: {100 * cut:.0f} % of the contour follows its edge; "
            "enlarge grid.field_of_view_mm or move grid.centre_mm"
        )
    share = size / (grid.shape[0] * grid.shape[1] * grid.pixel_size_m**2)
    if not LEAST_AREA_SHARE <= share <= MOST_AREA_SHARE:
        size_word = "small" if share < LEAST_AREA_SHARE else "large"
        notes.append(
            f"the body is implausibly {size_word}: {1e6 * size:.3g} mm^2, {100 * share:.2g} % of the field of view"
        )
    return tuple(notes)


def _rim_share(contour: np.ndarray, grid: Grid) -> float:
    """Return the share of the contour's length that lies within a pixel of the edge of the field of view."""
    left, right, bottom, top = grid.extent_m
    y, x = contour.T
    inside = np.minimum(np.minimum(y - bottom, top - y), np.minimum(x - left, right - x))
    lengths = np.hypot(*(np.roll(contour, -1, axis=0) - contour).T)
    near = inside <= grid.pixel_size_m
    return float(lengths[near & np.roll(near, -1)].sum() / lengths.sum())
