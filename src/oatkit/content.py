"""Values that hold arrays: read-only, checked against a range, compared and pickled by content."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from oatkit.errors import ValidationError


def read_only(values: Any, dtype: Any = None) -> np.ndarray:
    """Return a copy of `values` that nobody can write to; an array that is such already is returned as it is."""
    alike = isinstance(values, np.ndarray) and dtype in (None, values.dtype)
    if alike and values.base is None and not values.flags.writeable:
        return values
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def check_range(what: str, values: Any, lowest: float, highest: float, hint: str) -> None:
    """Raise `ValidationError` unless every value lies in ``[lowest, highest]``; NaN never does."""
    array = np.asarray(values, dtype=float)
    inside = (array >= lowest) & (array <= highest)
    if not inside.all():
        found = array[~inside].flat[0]
        raise ValidationError(f"{what}: {found:g} is outside {lowest:g} .. {highest:g}; {hint}")


class ByContent:
    """Equality, hash and pickling by content, for frozen dataclasses that hold arrays."""

    texts: ClassVar[frozenset[str]] = frozenset()
    """Fields that say where the content comes from and are no part of it."""

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the content, in hexadecimal."""
        digest = hashlib.sha256(type(self).__name__.encode())
        for entry in fields(self):  # type: ignore[arg-type]
            if entry.name not in self.texts:
                digest.update(entry.name.encode())
                for piece in _pieces(getattr(self, entry.name)):
                    digest.update(piece)
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other.fingerprint == self.fingerprint

    def __hash__(self) -> int:
        return hash(self.fingerprint)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # numpy forgets the write protection on its way through pickle.
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        self.__dict__.update({k: frozen(v) if isinstance(v, dict) else v for k, v in state.items()})

    def __getstate__(self) -> dict[str, Any]:
        return {k: dict(v) if isinstance(v, MappingProxyType) else v for k, v in self.__dict__.items()}


def frozen(mapping: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a read-only copy of a mapping."""
    return MappingProxyType(dict(mapping))


def _pieces(value: Any) -> Iterator[bytes]:
    """Yield the bytes that identify a value; a lazy array answers with its own fingerprint."""
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Mapping):
        for key in sorted(value):
            yield str(key).encode()
            yield from _pieces(value[key])
    elif isinstance(value, tuple | list):
        yield f"{len(value)} items".encode()
        for item in value:
            yield from _pieces(item)
    elif hasattr(value, "fingerprint"):
        yield value.fingerprint.encode()
    elif value is None or isinstance(value, str | bytes | bool | int | float | np.generic):
        yield repr(value).encode()
    else:
        raise TypeError(f"{type(value).__name__} has no content to compare; keep plain values and arrays")
