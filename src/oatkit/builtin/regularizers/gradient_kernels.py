"""The inner loop of total variation: serial, without the GIL."""

import numpy as np

from oatkit.compiled import fast


@fast
def ascend(
    dual: np.ndarray,
    previous: np.ndarray,
    image: np.ndarray,
    step: float,
    non_negative: bool,
    momentum: float,
    n_steps: int,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Take steps of fast gradient projection; see `Analysis.ascend`. Both duals are overwritten, and returned."""
    ny, nx = image.shape
    ahead = np.empty_like(dual)
    rest = np.empty_like(image)
    for _ in range(n_steps):
        following = (1 + np.sqrt(1 + 4 * momentum * momentum)) / 2
        beta = (momentum - 1) / following
        for i in range(ny):
            for j in range(nx):
                ahead[0, i, j] = dual[0, i, j] + beta * (dual[0, i, j] - previous[0, i, j])
                ahead[1, i, j] = dual[1, i, j] + beta * (dual[1, i, j] - previous[1, i, j])
        for i in range(ny):
            rest[i, 0] = image[i, 0] + ahead[0, i, 0] + ahead[1, i, 0]
            for j in range(1, nx):
                rest[i, j] = image[i, j] + ahead[0, i, j] + ahead[1, i, j] - ahead[1, i, j - 1]
            if i > 0:
                for j in range(nx):
                    rest[i, j] -= ahead[0, i - 1, j]
            if non_negative:
                for j in range(nx):
                    rest[i, j] = max(rest[i, j], 0.0)
        uphill = 0.0
        for i in range(ny):
            for j in range(nx):
                y = ahead[0, i, j] + (rest[i + 1, j] - rest[i, j]) / 8 if i + 1 < ny else 0.0
                x = ahead[1, i, j] + (rest[i, j + 1] - rest[i, j]) / 8 if j + 1 < nx else 0.0
                shrink = step / max(np.sqrt(y * y + x * x), step)
                y *= shrink
                x *= shrink
                uphill += (ahead[0, i, j] - y) * (y - dual[0, i, j]) + (ahead[1, i, j] - x) * (x - dual[1, i, j])
                previous[0, i, j] = y
                previous[1, i, j] = x
        dual, previous = previous, dual
        momentum = 1.0 if uphill > 0 else following
    return dual, previous, momentum
