"""Plain values: what provenance is made of, to strict JSON and back."""

import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from oatkit.errors import ResultError

_NUMBERS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def encode(value: Any, where: str = "value") -> Any:
    """Return what strict JSON can hold: numpy numbers and arrays as numbers and lists, nan and inf as words.

    Raises `ResultError` for a type that has no such form, saying `where` it was.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str | os.PathLike):
        # A file name may hold bytes that are no text.
        return os.fspath(value).encode("utf-8", "backslashreplace").decode()
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {key: encode(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [encode(item, f"{where}[{i}]") for i, item in enumerate(value)]
    raise ResultError(
        f"{where}: a {type(value).__name__} cannot be stored; use numbers, text, lists, dicts with text keys"
    )


def decode(value: Any) -> Any:
    """Undo `encode`, as far as can be: lists become tuples, the words nan, inf and -inf numbers."""
    if isinstance(value, str):
        return _NUMBERS.get(value, value)
    if isinstance(value, dict):
        return {key: decode(item) for key, item in value.items()}
    return tuple(map(decode, value)) if isinstance(value, list) else value
