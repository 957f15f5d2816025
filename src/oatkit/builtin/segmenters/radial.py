"""The outline as the shortest closed path around a centre."""

from typing import ClassVar

from oatkit.api import Image, Segmenter, param
from oatkit.builtin.segmenters.findings import boundary_image, unseen_note
from oatkit.builtin.segmenters.radial_path import radial_contour, seen_share
from oatkit.builtin.segmenters.walls import Walls

LEAST_SEEN_STAR = 0.96
"""Share of the contour on a visible wall below which the body may not be star-shaped."""
ADVICE = (
    ": the body may be dim there or not star-shaped from its centre; try the segmenter 'active-contour' or 'geodesic'"
)


class Radial(Segmenter):
    """Follows the outermost wall along rays from the centre of the body, by dynamic programming.

    The slope of the smoothed image is sampled on 360 rays at a quarter of a pixel; of all closed paths in these polar
    coordinates the cheapest is taken [Sun2003]_ (see `Strip.wall`), refined below a step and smoothed. The wall lies
    where the image, not its logarithm, rises most: for a sharp edge in a band-limited image this is the edge itself.
    The body must be star-shaped: each ray from its centroid leaves it once. Where it is not, the path bridges the
    hollow; a note then says how much of the contour lies on no wall and names the way out.

    References:
        [Sun2003] Sun and Pallottino, Pattern Recognition 36, 709 (2003), 10.1016/S0031-3203(02)00085-7.
    """

    name: ClassVar[str] = "radial"
    blur: float = param(0.12, "standard deviation of the smoothing Gaussian", unit="mm", at_least=0, at_most=2)
    sensitivity: float = param(0.15, "slope of the dimmest wall, relative to a typical one", above=0, at_most=1)
    rigidity: float = param(
        0.2, "stiffness of the contour: waves shorter than six times it vanish", unit="mm", at_least=0, at_most=5
    )

    def segment(self, image: Image) -> Image:
        """Return the signed distance to the outline, m. Raises `SolverError` where no body stands out."""
        walls = Walls.of(image, self.blur, self.sensitivity)
        contour = radial_contour(walls, image.grid, self.rigidity)
        seen = seen_share(contour, walls)
        notes = unseen_note(seen, LEAST_SEEN_STAR, ADVICE)
        return boundary_image(contour, image.grid, notes, seen_share=seen)
