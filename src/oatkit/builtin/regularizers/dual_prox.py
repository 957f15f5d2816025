"""Proximal maps of |K x|_1, with or without x >= 0."""

from dataclasses import dataclass

import numpy as np

from oatkit.builtin.regularizers.analysis import Analysis, Ascent, clipped, magnitudes, positive_part
from oatkit.vectors import inner

STEPS_BETWEEN_CHECKS = 10
"""The gap of the dual iteration is looked at after so many steps: it costs as much as one of them."""

ROUNDING = 1e-15
"""Part of step |K u|_1 to which a gap can be known."""


@dataclass(frozen=True, eq=False)
class Proximal:
    """A proximal point and its certificate."""

    image: np.ndarray
    """u = v - K^T y, or its positive part."""
    dual: np.ndarray
    """y, of magnitudes up to the step."""
    gap: float
    """An upper bound on how far |u - v|^2 / 2 + step |K u|_1 lies above its minimum, and on |u - u*|^2 / 2."""


def proximal(
    analysis: Analysis,
    image: np.ndarray,
    step: float,
    non_negative: bool,
    largest_gap: float,
    n_steps: int,
    start: np.ndarray | None = None,
) -> Proximal:
    """Return the u that minimises |u - v|^2 / 2 + step |K u|_1 for an image v of shape ``(y, x)``, perhaps over u >= 0.

    In closed form where there is one, and where the step is so long that K sees nothing of u. Else by fast gradient
    projection on the dual [Beck2009b]_, from the dual variable `start` where one is given, until the gap is at most
    `largest_gap` or the rounding of its terms, or `n_steps` are done.

    References:
        [Beck2009b] Beck and Teboulle, IEEE Trans. Image Process. 18, 2419 (2009), 10.1109/TIP.2009.2028250.
    """
    if analysis.has_closed_form(non_negative):
        dual = clipped(analysis.analyse(image), step)
        return Proximal(positive_part(image - analysis.adjoint(dual), non_negative), dual, 0.0)
    if start is None or magnitudes(start).max() < step:
        start = analysis.preimage(image)
        if magnitudes(start).max() <= step:
            return Proximal(positive_part(analysis.unseen(image), non_negative), start, 0.0)
    first = clipped(start, step)
    ascent = Ascent(first, first)
    for _ in range(0, n_steps, STEPS_BETWEEN_CHECKS):
        ascent = analysis.ascend(ascent, image, step, non_negative, STEPS_BETWEEN_CHECKS)
        shift = analysis.adjoint(ascent.dual)
        found = positive_part(image - shift, non_negative)
        cost = step * analysis.value(found)
        gap = max(0.0, cost - inner(shift, found))
        if gap <= max(largest_gap, ROUNDING * cost):
            break
    return Proximal(found, ascent.dual, gap)
