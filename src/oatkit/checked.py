"""What goes into a problem, and what its operator makes: checked, and in one form."""

from typing import Any

import numpy as np

from oatkit.content import read_only
from oatkit.data import Geometry
from oatkit.errors import SolverError, ValidationError

LARGEST = 1e150
"""Numbers beyond it have no square."""


def as_operator(operator: Any) -> Any:
    """Return something with ``shape``, ``matvec`` and ``rmatvec``: what was given, or scipy's wrap around it."""
    if not all(hasattr(operator, name) for name in ("shape", "matvec", "rmatvec")):
        from scipy.sparse.linalg import aslinearoperator  # slow to import: only for bare matrices

        try:
            if np.ndim(operator) > 2:
                raise ValueError  # newer scipys take stacks of matrices
            operator = aslinearoperator(operator)
        except (TypeError, ValueError):
            raise ValidationError(
                f"problem: the operator is of type {type(operator).__name__}; expected a matrix, or something with "
                "shape, matvec and rmatvec"
            ) from None
    if getattr(getattr(operator, "dtype", None), "kind", "f") == "c":
        raise ValidationError("problem: the operator is complex; expected a real one")
    return operator


def as_data(data: Any) -> np.ndarray:
    """Return the data as float64, raveled and read-only."""
    data = np.asarray(data)
    if data.dtype.kind not in "biuf" or data.size == 0:
        raise ValidationError(f"problem: expected one or more real numbers as data, got {data.size} of {data.dtype}")
    data = read_only(np.asarray(data, dtype=float).ravel())
    if not np.isfinite(data).all():
        raise ValidationError(f"problem: {(~np.isfinite(data)).sum()} of {data.size} data are not finite")
    largest = float(abs(data).max())
    if largest > 0 and not 1 / LARGEST <= largest <= LARGEST:
        raise ValidationError(
            f"problem: the largest of the data is {largest:g}, which has no square in floats; scale them to order 1"
        )
    return data


def as_shape(shape: Any) -> tuple[int, int]:
    """Return the shape of an image as two Python integers."""
    if not (np.shape(shape) == (2,) and all(isinstance(n, int | np.integer) and n >= 1 for n in shape)):
        raise ValidationError(f"problem: expected a shape of two whole numbers above 0, (ny, nx), got {shape}")
    return int(shape[0]), int(shape[1])


def as_start(start: Any, shape: tuple[int, int]) -> np.ndarray | None:
    """Return an image to begin near, read-only."""
    if start is None:
        return None
    start = np.asarray(start, dtype=float)
    if start.shape != tuple(shape) or not np.isfinite(start).all():
        raise ValidationError(f"problem: expected start as an image of shape {tuple(shape)} of finite numbers")
    return read_only(start)


def as_valid(valid: Any, geometry: Geometry | None) -> np.ndarray | None:
    """Return which detectors count, read-only."""
    if valid is None:
        return None
    valid = np.asarray(valid)
    expected = (geometry.detectors.count,) if geometry else valid.shape[:1]
    if valid.dtype != bool or valid.ndim != 1 or valid.shape != expected:
        raise ValidationError(
            f"problem: expected valid as one bool for each detector, shape {expected}, got {valid.dtype} of shape "
            f"{valid.shape}"
        )
    return read_only(valid)


def as_product(product: Any, size: int) -> np.ndarray:
    """Return what an operator made as float64, where it is what an operator makes."""
    product = np.asarray(product)
    if product.size != size or product.dtype.kind not in "biuf":
        raise SolverError(f"operator: its product is {product.size} of {product.dtype}; expected {size} real numbers")
    product = np.asarray(product, dtype=float)
    # NaN passes no comparison. Absolute values would need an array as large again: ten times slower on whole records.
    if not -LARGEST <= product.min() <= product.max() <= LARGEST:
        raise SolverError(
            f"operator: {(~(abs(product) <= LARGEST)).sum()} of {size} values of its product are not finite or beyond "
            f"{LARGEST:g}; the operator is faulty, or the image grew beyond the range of its numbers"
        )
    return product
