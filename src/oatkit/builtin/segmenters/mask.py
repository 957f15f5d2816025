"""An outline drawn elsewhere: a picture of labels."""

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Image, Segmenter, ValidationError, param
from oatkit.builtin.segmenters.findings import boundary_image
from oatkit.builtin.segmenters.label_outline import outline_of
from oatkit.label_files import PICTURES, read_labels


class Mask(Segmenter):
    """The signed distance to the outline of a labelled region, stretched over the whole field of view.

    The picture may have any number of pixels, as long as its aspect is that of the image to within a pixel. Row 0 is
    at the top in pictures and at the bottom in ``.npy`` files, as in the arrays of `Image`, unless `row_0` says
    otherwise. The largest piece counts, its holes filled. Its outline is the level 1/2 of the pixels blurred by one
    pixel: on a disc of 56 pixels' radius no point of it is further than 0.35 pixel from the circle.
    """

    name: ClassVar[str] = "mask"
    path: Path | None = param(None, "file with the labels: .npy, .png, .tif or .tiff; must be given")
    label: int | None = param(None, "label of the body; without it, whatever is not zero")
    row_0: Literal["auto", "top", "bottom"] = param("auto", "where the first row lies; auto: top in pictures")

    def segment(self, image: Image) -> Image:
        """Return the signed distance to the mask's outline, m.

        Raises `ReadError` where the file cannot be read, `ValidationError` where it does not fit or holds no body.
        """
        if self.path is None:
            raise ValidationError('segment: the segmenter "mask" needs the file with the mask, path = "..."')
        inside = self._inside(self.path)
        if not _same_aspect(inside.shape, image.grid.shape):
            raise ValidationError(
                f"{self.path}: the mask has {_text(inside.shape)} pixels, the image {_text(image.grid.shape)}; "
                "their aspects differ"
            )
        pixels, notes = outline_of(inside)
        left, right, bottom, top = image.grid.extent_m
        side = np.array([top - bottom, right - left]) / inside.shape
        return boundary_image(np.array([bottom, left]) + (pixels + 0.5) * side, image.grid, notes)

    def _inside(self, path: Path) -> np.ndarray:
        """Return which pixels belong to the body, row 0 at the bottom."""
        labels = read_labels(path)
        if not np.isfinite(labels).all():
            raise ValidationError(f"{path}: the mask holds values that are not finite")
        inside = labels != 0 if self.label is None else labels == self.label
        if not inside.any():
            what = "only zeros" if self.label is None else f"no pixel of label {self.label}"
            raise ValidationError(f"{path}: the mask holds {what}; where is the body?")
        if inside.all():
            raise ValidationError(f"{path}: the mask covers the whole field of view; where does the body end?")
        at_top = self.row_0 == "top" or (self.row_0 == "auto" and path.suffix.lower() in PICTURES)
        return inside[::-1] if at_top else inside


def _same_aspect(mask: tuple[int, ...], image: tuple[int, int]) -> bool:
    """Say whether a mask has the aspect of an image, to within a pixel of the mask."""
    return abs(mask[1] - mask[0] * image[1] / image[0]) <= 1


def _text(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
