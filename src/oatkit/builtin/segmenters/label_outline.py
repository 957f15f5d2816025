"""From pixels to a contour: the outline of the largest piece of a binary image."""

import numpy as np

from oatkit.builtin.segmenters.contours import anticlockwise
from oatkit.builtin.segmenters.walls import no_body

BLUR_PX = 1.0
"""The steps of pixels are blurred by this before the outline is drawn: a circle of radius R shrinks by 1 / 2R."""

MOST_LEFT_OUT = 0.01
"""Share of the area in smaller pieces above which they are mentioned."""


def outline_of(inside: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the outline of the largest piece of `inside` (bool), in pixels, shape ``(n, 2)``, and what was left out.

    Holes are filled. The outline is the level 1/2 of the pixels blurred by one pixel: it is smooth and
    rounds off what is sharper than a pixel.
    Raises `SolverError` where no pixel is inside.
    """
    from scipy import ndimage
    from skimage.measure import find_contours

    labels, count = ndimage.label(inside)
    if count == 0:
        raise no_body("no pixel is inside")
    sizes = np.bincount(labels.ravel())[1:]
    body = ndimage.binary_fill_holes(labels == 1 + int(sizes.argmax()))
    margin = 5
    blurred = ndimage.gaussian_filter(np.pad(body, margin).astype(float), BLUR_PX)
    curves = find_contours(blurred, 0.5)
    if not curves:
        raise no_body("what is inside is smaller than a few pixels")
    longest = max(curves, key=len)[:-1] - margin
    notes: tuple[str, ...] = ()
    left_out = 1 - sizes.max() / sizes.sum()
    if left_out > MOST_LEFT_OUT:
        share = f"{100 * left_out:.2g} % of their area is left out"
        notes = (f"of {count} separate pieces only the largest is kept; {share}",)
    return anticlockwise(longest), notes
