"""What a segmenter promises: the outline of a body that stands out, as a signed distance."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from oatkit.api import Image, Segmenter, SolverError
from oatkit.testing.problems import disc_distance_m, disc_image

PIXELS = (100, 150)
"""On a side of the images, over the same field of view."""
WORST_PX, MEAN_PX = 2.0, 1.0
"""How far, in pixels, the outline of a disc may be off: anywhere, and on the mean."""
SLOPE = 0.1
"""How far the median length of the gradient of a distance may be from 1 near the outline."""


def disc(plugin: Segmenter) -> Iterator[str]:
    """A bright disc off the centre is found to within two pixels everywhere and one on the mean, on each grid.

    Where it is and how large say `DISC_CENTRE_MM`, `DISC_RADIUS_MM` and `FIELD_OF_VIEW_MM` of
    `oatkit.testing.problems`: a segmenter whose outline is given must be given this one.
    """
    for pixels in PIXELS:
        image = disc_image(pixels)
        found, true = plugin.segment(image).values[0], disc_distance_m(image.grid)
        near = np.abs(true) < 3 * image.grid.pixel_size_m
        off = np.abs(found - true)[near] / image.grid.pixel_size_m
        if not (off.max() <= WORST_PX and off.mean() <= MEAN_PX):
            yield f"on {pixels} x {pixels} pixels the outline is off by {off.max():.1f}, on the mean {off.mean():.1f}"


def distance(plugin: Segmenter) -> Iterator[str]:
    """The values are a distance in m: negative inside, positive outside, with a gradient of length 1 at the outline."""
    image = disc_image(PIXELS[0])
    found, true = plugin.segment(image).values[0], disc_distance_m(image.grid)
    far = np.abs(true) > 4 * image.grid.pixel_size_m
    wrong = (np.sign(found) != np.sign(true))[far].mean()
    if not wrong <= 0.01:
        yield f"{wrong:.0%} of the pixels have the wrong sign; it is negative inside, positive outside"
    slope = float(np.median(np.hypot(*np.gradient(found.astype(float), image.grid.pixel_size_m))[np.abs(true) < 1e-3]))
    if not abs(slope - 1) <= SLOPE:
        yield f"near the outline it grows by {slope:.2f} m in a m; it is a distance in m"


def form_of_image(plugin: Segmenter) -> Iterator[str]:
    """It returns one finite plane named ``boundary``, in m, on the grid of the image; the same each time."""
    image = disc_image(PIXELS[0])
    found = plugin.segment(image)
    if not isinstance(found, Image) or found.grid != image.grid:
        yield "it returns no image on the grid of its image"
    elif (found.quantity, found.unit, len(found.values)) != ("boundary", "m", 1):
        what = f"{len(found.values)} planes of '{found.quantity}' in '{found.unit}'"
        yield f"it returns {what}, not one of 'boundary' in 'm'"
    elif not np.isfinite(found.values).all():
        yield f"{(~np.isfinite(found.values)).sum()} pixels are not finite"
    elif plugin.segment(image) != found:
        yield "it returns something else the second time"


def brightness(plugin: Segmenter) -> Iterator[str]:
    """The unit of the image does not matter, nor whether it comes at one wavelength or at two."""
    image = disc_image(PIXELS[0])
    usual = plugin.segment(image).values
    limit = WORST_PX * image.grid.pixel_size_m
    near = np.abs(usual) < 3 * image.grid.pixel_size_m
    if not near.any():
        yield "no pixel lies near the outline"
        return
    for name, other in (
        ("a million times as bright", replace(image, values=1e6 * image.values)),
        ("a millionth as bright", replace(image, values=1e-6 * image.values)),
        ("at two wavelengths", disc_image(PIXELS[0], (700.0, 800.0))),
    ):
        moved = np.abs(plugin.segment(other).values - usual)[near].max()
        if not moved <= limit:
            yield f"{name}, the outline moves by {1e3 * moved:.2g} mm"


def nothing(plugin: Segmenter) -> Iterator[str]:
    """An image without a body is a `SolverError`, unless the outline does not come from the image."""
    image = disc_image(PIXELS[0])
    empty = replace(image, values=np.zeros_like(image.values))
    try:
        found = plugin.segment(empty)
    except SolverError:
        return
    if found.values.tobytes() != plugin.segment(image).values.tobytes():
        yield "it finds a body in an image of zeros; raise SolverError"


CHECKS = (disc, distance, form_of_image, brightness, nothing)
