"""A level set that shrinks onto the body from the edge of the image."""

from typing import ClassVar

import numpy as np

from oatkit.api import Image, Segmenter, param
from oatkit.builtin.segmenters.contours import smoothed, strip_around
from oatkit.builtin.segmenters.findings import boundary_image
from oatkit.builtin.segmenters.label_outline import outline_of
from oatkit.builtin.segmenters.radial_path import SPACING_M, STEP_PX, check_seen, seen_share
from oatkit.builtin.segmenters.walls import Walls
from oatkit.polygons import without_loops

SNAP_MM = 0.4
"""How far from the level set's pixels the wall is looked for, to either side."""


class Geodesic(Segmenter):
    """Morphological geodesic active contour [Marquez2014]_, shrunk onto the outermost walls.

    It starts as the whole field of view, so it needs no centre and no star-shaped body. The largest piece that is left
    is outlined and moved once to the steepest slope within 0.4 mm, as the other segmenters do. Where noise
    interrupts the wall it leaks inwards, and it cuts off what is thinner than about 0.5 mm over a bright vessel.

    References:
        [Marquez2014] Marquez-Neila, Baumela and Alvarez, IEEE Trans. Pattern Anal. Mach. Intell. 36, 2 (2014),
        10.1109/TPAMI.2013.106.
    """

    name: ClassVar[str] = "geodesic"
    blur: float = param(0.12, "standard deviation of the smoothing Gaussian", unit="mm", at_least=0, at_most=2)
    sensitivity: float = param(0.15, "slope of the dimmest wall, relative to a typical one", above=0, at_most=1)
    rigidity: float = param(
        0.2, "stiffness of the contour: waves shorter than six times it vanish", unit="mm", at_least=0, at_most=5
    )
    smoothing: int = param(1, "smoothing passes of the level set in each step", at_least=0, at_most=10)

    def segment(self, image: Image) -> Image:
        """Return the signed distance to the outline, m. Raises `SolverError` where no body stands out."""
        walls = Walls.of(image, self.blur, self.sensitivity)
        pixels, notes = outline_of(self._shrunk(walls))
        outline = np.array([walls.grid.y_m[0], walls.grid.x_m[0]]) + walls.grid.pixel_size_m * pixels
        step = STEP_PX * image.grid.pixel_size_m
        strip = strip_around(smoothed(outline, SPACING_M, self.rigidity), 1e-3 * SNAP_MM, 1e-3 * SNAP_MM, step)
        contour = smoothed(without_loops(strip.wall(walls, bending=1.0, max_slope=1.0)), SPACING_M, self.rigidity)
        seen = seen_share(contour, walls)
        check_seen(seen)
        return boundary_image(contour, image.grid, notes, seen_share=seen)

    def _shrunk(self, walls: Walls) -> np.ndarray:
        """Return the level set at the end, bool, on the grid of the walls."""
        from skimage.segmentation import morphological_geodesic_active_contour

        stop = 1 - walls.evidence(np.hypot(walls.slope_y, walls.slope_x))
        start = np.zeros(stop.shape, np.int8)
        start[1:-1, 1:-1] = 1
        # It moves by a pixel in a step, so this leads to the middle and back out of any hollow.
        level_set = morphological_geodesic_active_contour(
            stop, max(stop.shape), init_level_set=start, smoothing=self.smoothing, threshold=0.5, balloon=-1
        )
        return level_set > 0
