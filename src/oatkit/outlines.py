"""How near an outline that was found is to the true one."""

import numpy as np

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.polygons import resampled

SPACING_M = 2e-5
"""Of the points that both contours are compared at."""


def dice(boundary: Image, truth: Image) -> float:
    r"""Return the Dice coefficient of the insides of two signed distances on one grid.

    .. math:: \frac{2 |A \cap B|}{|A| + |B|}

    Raises `ValidationError` where grids differ or both are empty.
    """
    if boundary.grid != truth.grid:
        raise ValidationError("dice: both boundaries must lie on one grid")
    found, true = boundary.values[0] < 0, truth.values[0] < 0
    total = int(found.sum() + true.sum())
    if total == 0:
        raise ValidationError("dice: both bodies are empty")
    return 2 * int((found & true).sum()) / total


def hausdorff_m(boundary: Image, outline_m: np.ndarray) -> float:
    """Return the largest distance of either contour from the other one, m.

    `boundary` is a signed distance, whose zero is the contour found; `outline_m` the true one, a closed polygon of
    shape ``(n, 2)``, each ``(y, x)``. Raises `ValidationError` where the boundary has no contour.
    """
    from scipy.spatial import cKDTree
    from skimage.measure import find_contours

    grid = boundary.grid
    curves = [grid.pixel_size_m * curve for curve in find_contours(boundary.values[0], 0.0)]
    if not curves:
        raise ValidationError("hausdorff: the boundary has no contour")
    found = np.array([grid.y_m[0], grid.x_m[0]]) + np.vstack([resampled(curve[:-1], SPACING_M) for curve in curves])
    true = resampled(outline_m, SPACING_M)
    return float(max(cKDTree(found).query(true)[0].max(), cKDTree(true).query(found)[0].max()))
