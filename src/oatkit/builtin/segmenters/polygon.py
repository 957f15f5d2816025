"""An outline given by its corners."""

from typing import ClassVar, Self

import numpy as np
from pydantic import model_validator
from pydantic_core import PydanticCustomError

from oatkit.api import Image, Segmenter, ValidationError, param
from oatkit.builtin.segmenters.contours import anticlockwise
from oatkit.builtin.segmenters.findings import boundary_image
from oatkit.polygons import area, crossings

MOST_VERTICES = 2000


class Polygon(Segmenter):
    """The signed distance to a polygon, whatever the image shows; the last corner is joined to the first.

    What lies beyond the field of view is moved to its edge.
    """

    name: ClassVar[str] = "polygon"
    vertices: tuple[tuple[float, float], ...] = param(
        (), "corners in order, each (y, x), y pointing up; must be given", unit="mm", at_least=-1000, at_most=1000
    )

    @model_validator(mode="after")
    def _simple(self) -> Self:
        points = np.array(self.vertices)
        if len(points) == 0:
            return self
        if not 3 <= len(points) <= MOST_VERTICES:
            text = "vertices: expected 3 .. {most} corners, got {n}"
            raise PydanticCustomError("oatkit", text, {"most": MOST_VERTICES, "n": len(points)})
        if not abs(area(points)) > 0:
            raise PydanticCustomError("oatkit", "vertices: the corners lie on one line and enclose no area")
        crossed = crossings(points)
        if len(crossed):
            text = "vertices: the side from corner {i} crosses the one from corner {j} (counted from 0)"
            raise PydanticCustomError("oatkit", text, {"i": int(crossed[0, 0]), "j": int(crossed[0, 1])})
        return self

    def segment(self, image: Image) -> Image:
        """Return the signed distance to the polygon, m. Raises `SolverError` where it misses the field of view."""
        if not self.vertices:
            raise ValidationError('segment: the segmenter "polygon" needs its corners, vertices = [[y, x], ...] in mm')
        return boundary_image(anticlockwise(1e-3 * np.array(self.vertices)), image.grid)
