"""Phantoms: known images of initial pressure, the same object on any grid.

All are non-negative and zero outside the body, in arbitrary units, and averaged over the area of each pixel. Lengths
are chosen to fit a field of view of 20 mm.
"""

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from oatkit.content import check_range, read_only
from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.simulate.anatomy import Anatomy
from oatkit.simulate.raster import Density, area_average

Phantom = Callable[[Grid], Image]
"""What makes the true image on any grid."""


def disc(grid: Grid, *, radius_m: float = 5e-3, centre_m: tuple[float, float] = (0.0, 0.0)) -> Image:
    """Return a homogeneous disc of value 1 about `centre_m` (y, x)."""
    check_radius(radius_m)

    def density(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return (np.hypot(y - centre_m[0], x - centre_m[1]) <= radius_m).astype(float)

    return _image(density, grid)


def star(grid: Grid, *, radius_m: float = 9e-3) -> Image:
    """Return an irregular five-pointed star of value 0.25 with two tubes of value 2.5, after [Prakash2019]_.

    The values are the optical densities of the paper's agar phantom, as if the light were the same everywhere. The
    tubes have a radius of 0.11 `radius_m`; one is at the centre, one near the edge. The outline and the tubes' size are
    ours: the paper gives neither. Nothing lies further than `radius_m` from the origin.
    """
    check_radius(radius_m)
    return _image(lambda y, x: star_density(y / radius_m, x / radius_m), grid)


def star_outline(angle: np.ndarray) -> np.ndarray:
    """Return how far the star reaches in each direction, relative to its `radius_m`."""
    return 0.76 + 0.16 * np.sin(5 * angle) + 0.05 * np.cos(2 * angle + 0.7) + 0.03 * np.sin(3 * angle)


def star_density(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the star's value at points of the plane, their coordinates relative to its `radius_m`."""
    tubes = (np.hypot(y, x) <= 0.11) | (np.hypot(y - 0.68, x) <= 0.11)
    inside = np.hypot(y, x) <= star_outline(np.arctan2(y, x))
    return np.where(tubes, 2.5, np.where(inside, 0.25, 0.0))


def breast(grid: Grid, *, radius_m: float = 9e-3, seed: int = 0) -> Image:
    """Return a breast-like body: outline, skin, fat, fibroglandular tissue, vessels and three tumours.

    It is invented, not taken from a patient. `seed` draws another body of the same kind; nothing lies further than
    `radius_m` from the origin. See `oatkit.simulate.anatomy.Anatomy` for the values of the tissues.
    """
    check_radius(radius_m)
    anatomy = Anatomy.draw(seed)
    return _image(lambda y, x: anatomy.density(y / radius_m, x / radius_m), grid)


def vessel(grid: Grid, *, picture: np.ndarray | None = None, side_m: float = 19e-3) -> Image:
    """Return a tree of blood vessels of values 0 .. 1: those of scikit-image's picture of a retina, by a Frangi filter.

    Any other `picture` of shape ``(rows, columns)``, row 0 at the top, takes its place (of a ``.npy`` file: give what
    `numpy.load` returns). It fills a square of `side_m`, is interpolated linearly and zero beyond.

    Raises `ValidationError` where the picture is not two-dimensional, or holds negative or non-finite values.
    """
    check_radius(side_m / 2)
    values = _retina_vessels() if picture is None else np.asarray(picture)
    if values.ndim != 2 or values.dtype.kind not in "iufb":
        raise ValidationError(f"picture: expected numbers of shape (rows, columns), got {values.dtype} {values.shape}")
    check_range("picture", values, 0.0, np.finfo(float).max, "an initial pressure is finite and not negative")
    return _image(_interpolated(values[::-1].astype(float), side_m), grid)


PHANTOMS: Mapping[str, Phantom] = {"breast": breast, "star": star, "vessel": vessel, "disc": disc}
"""The phantoms by name; each is called with a grid alone."""


def truth(phantom: str | Phantom, grid: Grid) -> Image:
    """Return the true image of a phantom, or of the name of one in `PHANTOMS`, on `grid`.

    Raises `ValidationError` for an unknown name and for an image that is not finite or lies on another grid.
    """
    if isinstance(phantom, str):
        if phantom not in PHANTOMS:
            raise ValidationError(f"no phantom named '{phantom}'{did_you_mean(phantom, PHANTOMS)}")
        phantom = PHANTOMS[phantom]
    image = phantom(grid)
    if image.grid != grid or not np.isfinite(image.values).all():
        raise ValidationError("phantom: expected a finite image on the grid that was asked for")
    return image


def check_radius(radius_m: float) -> None:
    """Raise `ValidationError` unless a phantom's radius is a length that could be meant."""
    check_range("phantom radius", radius_m, 1e-5, 1.0, "the unit is m, so 5 mm is 5e-3")


def _image(density: Density, grid: Grid) -> Image:
    return Image(area_average(density, grid), "initial_pressure", "a.u.", grid)


def _interpolated(values: np.ndarray, side_m: float) -> Density:
    """Return a picture (row 0 at the bottom) as a function of the plane; its longer side is `side_m`."""
    from scipy.ndimage import map_coordinates

    rows, columns = values.shape
    pixel = side_m / max(rows, columns)

    def density(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        at = np.broadcast_arrays(y / pixel + (rows - 1) / 2, x / pixel + (columns - 1) / 2)
        return map_coordinates(values, at, order=1, mode="constant", cval=0.0)

    return density


@cache
def _retina_vessels() -> np.ndarray:
    """Return the vessels in scikit-image's picture of a retina, 0 .. 1, shape ``(471, 471)``, row 0 at the top."""
    from skimage.data import retina
    from skimage.filters import frangi
    from skimage.transform import downscale_local_mean

    green = downscale_local_mean(retina()[..., 1] / 255, (3, 3))
    strength = frangi(green, sigmas=(1.5, 2.5, 3.5), black_ridges=True)
    row, column = np.ogrid[: green.shape[0], : green.shape[1]]
    # The rim of the picture is a ridge too, and no vessel.
    inside = np.hypot(row - green.shape[0] / 2, column - green.shape[1] / 2) < 0.457 * green.shape[0]
    return read_only(np.where(inside, np.clip(strength / np.percentile(strength[inside], 99), 0, 1), 0))
