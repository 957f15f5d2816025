"""Where `l1` and `tv` start."""

import numpy as np

from oatkit.builtin.regularizers.analysis import positive_part
from oatkit.builtin.solvers.sparse_objective import SparseObjective, SparsePoint
from oatkit.vectors import inner

BLUR = 0.1
"""Standard deviation of the blurred image, relative to the shorter side."""


def start(objective: SparseObjective) -> SparsePoint:
    """Return the mix of the reference's base image and of its blurred copy that fits the data best.

    Under x >= 0 of its positive part, with no negative share. What the data tell least about is how bright the body is
    as a whole: the base image, made in few steps, is too dark, and proximal gradients are slow to lift it.
    """
    from scipy.ndimage import gaussian_filter

    problem, non_negative = objective.problem, objective.non_negative
    base = positive_part(problem.reference.base, non_negative)
    images = base, gaussian_filter(base, BLUR * min(base.shape))
    signals = tuple(problem.forward(image) for image in images)
    shares = _shares(signals, problem.data, non_negative)
    image, predicted = (shares[0] * pair[0] + shares[1] * pair[1] for pair in (images, signals))
    misfit = predicted - problem.data
    return SparsePoint(objective, image, misfit, problem.adjoint(misfit))


def _shares(signals: tuple[np.ndarray, ...], data: np.ndarray, non_negative: bool) -> np.ndarray:
    """Return the factors of two signals whose sum is nearest to the data; of the first alone, if one were negative."""
    gram = np.array([[inner(one, other) for other in signals] for one in signals])
    right = np.array([inner(one, data) for one in signals])
    shares = np.linalg.lstsq(gram, right)[0]
    if non_negative and shares.min() < 0:
        return np.array([max(0.0, right[0] / gram[0, 0]) if gram[0, 0] > 0 else 0.0, 0.0])
    return shares
