"""Values to try on the parameters of a plugin: within their range, at the limits, beyond them."""

import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from oatkit.parameters import Bounds, Parameters, bounds_of

PLAIN = (float, int, bool, str, Path, type(None))
"""What a parameter may hold beside words, tuples and other plugins."""


def foreign_types(annotation: Any) -> Iterator[Any]:
    """Yield the types in an annotation that a pipeline file cannot hold."""
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType, tuple):
        for part in get_args(annotation):
            if part is not Ellipsis:
                yield from foreign_types(part)
    elif origin is Literal:
        yield from (word for word in get_args(annotation) if not isinstance(word, str | int | bool))
    elif annotation not in PLAIN and not (isinstance(annotation, type) and issubclass(annotation, Parameters)):
        yield annotation


def holds(annotation: Any, wanted: type) -> bool:
    """Say whether a type is in an annotation, nested ones included."""
    return annotation is wanted or any(holds(part, wanted) for part in get_args(annotation))


def filled(annotation: Any, number: float) -> Any:
    """Return a value of the form that an annotation asks for with one number everywhere; None where it takes none."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        return next((value for arg in args if (value := filled(arg, number)) is not None), None)
    if origin is tuple:
        items = [filled(arg, number) for arg in args if arg is not Ellipsis]
        return None if None in items else tuple(items)
    if annotation is int:
        return int(number) if float(number).is_integer() else None
    return float(number) if annotation is float else None


def beyond(bounds: Bounds) -> Iterator[float]:
    """Yield numbers that lie outside of a range, next to its limits and far off."""
    for limit, sign in ((bounds.above, -1), (bounds.below, 1)):
        if limit is not None:
            yield from (limit, limit + sign, limit + 1e6 * sign)
    for limit, sign in ((bounds.at_least, -1), (bounds.at_most, 1)):
        if limit is not None:
            yield from (limit + sign, limit + 1e6 * sign)


def others(field: FieldInfo) -> Iterator[Any]:
    """Yield values that a field takes, other than its default; a plugin may still refuse them beside its others."""
    annotation, bounds, default = field.annotation, bounds_of(field), field.default
    for part in _alternatives(annotation):
        if get_origin(part) is Literal:
            yield from (word for word in get_args(part) if word != default)
        elif part is bool:
            yield not default
        elif part is type(None) and default is not None:
            yield None
        elif part is Path:
            yield Path("/elsewhere/file")
        else:
            numbers = (n for n in _inside(bounds) if n != default)
            yield from (value for n in numbers if (value := filled(part, n)) is not None)


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)


def _inside(bounds: Bounds) -> list[float]:
    """Return a few numbers in a range."""
    lowest = bounds.above if bounds.at_least is None else bounds.at_least
    highest = bounds.below if bounds.at_most is None else bounds.at_most
    tried = {0.1 + (lowest or 0.0), 1.0 + (lowest or 0.0), 3.0 + (lowest or 0.0)}
    if highest is not None:
        tried |= {highest - 0.01, 0.5 * ((lowest or 0.0) + highest)}
    return sorted(number for number in tried if bounds.allow(number))
