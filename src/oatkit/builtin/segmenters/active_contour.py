"""A deformable contour that starts as the radial path and creeps into hollows."""

from typing import ClassVar

import numpy as np

from oatkit.api import Grid, Image, Segmenter, param
from oatkit.builtin.segmenters.contours import distances, smoothed, strip_around
from oatkit.builtin.segmenters.findings import boundary_image, unseen_note
from oatkit.builtin.segmenters.radial_path import SPACING_M, STEP_PX, radial_contour, seen_share
from oatkit.builtin.segmenters.walls import Walls
from oatkit.polygons import without_loops

BENDING = 1.0
MAX_SLOPE = 1.0
SETTLED_PX = 0.25
SETTLED_SHARE = 0.95
"""The contour is at rest when all but 5 % of its points move by less than a quarter of a pixel."""
WELL_SEEN = 0.9
"""Share of the contour on a visible wall below which a note says how much is on none."""
STRAYED = 0.05
"""Loss of visible wall against the radial path above which the contour is given up."""


class ActiveContour(Segmenter):
    """A snake [Kass1988]_ whose energy is minimised by dynamic programming [Amini1990]_.

    [Prakash2019]_ names active contours, without saying which. This one starts from the outline that `radial` finds.
    In each round a strip of width `reach` on both sides is searched along the contour's normals for the cheapest closed
    path (see `Strip.wall`): drawn to the outermost wall, held straight by its bending, pressed inwards where there is
    no wall. The new contour is spaced evenly, freed of loops and smoothed by its rigidity. Round by round it enters
    hollows that no ray from the centre sees. Where much less of it ends on a visible wall than of the radial path, that
    path is returned, and a note says so.

    References:
        [Kass1988] Kass, Witkin and Terzopoulos, Int. J. Comput. Vis. 1, 321 (1988), 10.1007/BF00133570.
        [Amini1990] Amini, Weymouth and Jain, IEEE Trans. Pattern Anal. Mach. Intell. 12, 855 (1990), 10.1109/34.57681.
        [Prakash2019] Prakash et al., IEEE Trans. Biomed. Eng. (2019), 10.1109/TBME.2019.2892842.
    """

    name: ClassVar[str] = "active-contour"
    blur: float = param(0.12, "standard deviation of the smoothing Gaussian", unit="mm", at_least=0, at_most=2)
    sensitivity: float = param(0.15, "slope of the dimmest wall, relative to a typical one", above=0, at_most=1)
    rigidity: float = param(
        0.3, "stiffness of the contour: waves shorter than six times it vanish", unit="mm", at_least=0, at_most=5
    )
    reach: float = param(0.75, "how far the contour sees to either side", unit="mm", above=0, at_most=5)
    pressure: float = param(0.3, "pull inwards where there is no wall, relative to that of a wall", at_least=0, below=1)
    n_rounds: int = param(12, "largest number of rounds", at_least=0, at_most=1000)

    def segment(self, image: Image) -> Image:
        """Return the signed distance to the outline, m. Raises `SolverError` where no body stands out."""
        walls = Walls.of(image, self.blur, self.sensitivity)
        start = radial_contour(walls, image.grid, self.rigidity)
        contour, rounds, moving = self._settle(start, walls, image.grid)
        seen, seen_before = (seen_share(c, walls) for c in (contour, start))
        notes: tuple[str, ...] = ()
        if seen < seen_before - STRAYED:
            contour, seen = start, seen_before
            notes = ("the contour strayed from the wall; the radial path that it started from is returned instead",)
        notes += unseen_note(seen, WELL_SEEN, "; look at it before relying on it there, or raise blur")
        return boundary_image(contour, image.grid, notes, seen_share=seen, rounds=rounds, moving_share=moving)

    def _settle(self, contour: np.ndarray, walls: Walls, grid: Grid) -> tuple[np.ndarray, int, float]:
        """Return the contour at rest or after the last round, the number of rounds, and the share that still moves."""
        moving, rounds = 1.0, 0
        while rounds < self.n_rounds and moving > 1 - SETTLED_SHARE:
            strip = strip_around(contour, 1e-3 * self.reach, 1e-3 * self.reach, STEP_PX * grid.pixel_size_m)
            wall = strip.wall(walls, BENDING, MAX_SLOPE, self.pressure)
            moved = smoothed(without_loops(wall), SPACING_M, self.rigidity)
            moving = float((distances(moved, contour) > SETTLED_PX * grid.pixel_size_m).mean())
            contour = moved
            rounds += 1
        return contour, rounds, moving
