"""Plain values: what provenance is made of, to strict JSON and back.

A number that JSON does not know is an object, ``{"$float": "nan"}``; a key that begins with ``$`` is stored with one
more, so that no mapping is taken for such a number.
"""

import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from oatkit.errors import ResultError

NUMBER = "$float"
"""Key of a number that is not finite."""
NOT_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
"""One object for each, so that tables that were read twice compare as equal though nan does not."""


def encode(value: Any, where: str = "value") -> Any:
    """Return what strict JSON can hold: numpy numbers and arrays as numbers and lists, nan and inf as objects.

    Raises `ResultError` for a type that has no such form, saying `where` it was.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {NUMBER: str(value)}
    if isinstance(value, str | os.PathLike):
        # A file name may hold bytes that are no text.
        return os.fspath(value).encode("utf-8", "backslashreplace").decode()
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return {_escaped(key): encode(item, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [encode(item, f"{where}[{i}]") for i, item in enumerate(value)]
    raise ResultError(
        f"{where}: a {type(value).__name__} cannot be stored; use numbers, text, lists, dicts with text keys"
    )


def decode(value: Any) -> Any:
    """Undo `encode`, as far as can be: lists become tuples. Raises `ValueError` for what `encode` never returns."""
    if isinstance(value, dict):
        if value.keys() == {NUMBER}:
            return _number(value[NUMBER])
        return {_unescaped(key): decode(item) for key, item in value.items()}
    return tuple(map(decode, value)) if isinstance(value, list) else value


def _escaped(key: str) -> str:
    return f"${key}" if key.startswith("$") else key


def _unescaped(key: str) -> str:
    return key.removeprefix("$")


def _number(word: Any) -> float:
    if not isinstance(word, str) or word not in NOT_FINITE:
        raise ValueError(f"{NUMBER}: expected one of {', '.join(NOT_FINITE)}, found {word!r:.60}")
    return NOT_FINITE[word]
