"""How one parameter is edited: the sort of field that suits it, its value to text and back, and its neighbours."""

import math
import tomllib
from enum import Enum, auto
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from oatkit.parameters import bounds_of, expected, part_of

SUFFIXES = {"m/s": "_m_s", "mm": "_mm", "us": "_us", "nm": "_nm", "MHz": "_mhz", "1/cm": "_per_cm"}
"""Ends of names that say the unit."""

RATIO = 10**0.1
"""Ten steps make a decade."""


class Sort(Enum):
    """What a parameter is edited with."""

    SWITCH = auto()
    """A check box."""
    CHOICE = auto()
    """One of some words."""
    NUMBER = auto()
    MIXED = auto()
    """A number, or one of some words."""
    TEXT = auto()
    """A text, or a list with commas."""
    PATH = auto()
    PART = auto()
    """A plugin or a table within the plugin."""
    FIXED = auto()
    """Shown only; to be edited in the file."""


def sort_of(field: FieldInfo) -> Sort:
    """Return what suits a parameter, by its type."""
    options = _options(field)
    if part_of(field):
        return Sort.FIXED if any(get_origin(option) is tuple for option in options) else Sort.PART
    if options == [bool]:
        return Sort.SWITCH
    words, numbers = bool(words_of(field)), any(option in (int, float) for option in options)
    if words:
        return Sort.MIXED if numbers else Sort.CHOICE
    return Sort.NUMBER if numbers else Sort.PATH if Path in options else Sort.TEXT


def words_of(field: FieldInfo) -> list[Any]:
    """Return the words that a parameter takes."""
    return [word for option in _options(field) if get_origin(option) is Literal for word in get_args(option)]


def is_optional(field: FieldInfo) -> bool:
    """Say whether a parameter may be absent."""
    return type(None) in get_args(field.annotation)


def label_of(name: str, field: FieldInfo) -> str:
    """Return the name of a parameter as a label, without the unit that stands beside its value."""
    suffix = SUFFIXES.get(bounds_of(field).unit, "")
    return (name.removesuffix(suffix) if suffix else name).replace("_", " ")


def help_of(name: str, field: FieldInfo) -> str:
    """Return what a parameter means, what it takes, and its default."""
    default = "" if field.default is None or part_of(field) else f"\ndefault: {written(field.default)}"
    return f"{field.description or name}\n{name}: {expected(field)}{default}"


def parsed(field: FieldInfo, text: str) -> Any:
    """Return the value that a text stands for, None for an empty one.

    What cannot be read is returned as text, so that the parameter's own check says what is wrong with it.
    """
    text = text.strip()
    if not text:
        return None
    for word in words_of(field):
        if text == str(word):
            return word
    options = _options(field)
    if any(get_origin(option) is tuple for option in options):
        return _list(text)
    return _number(text) if int in options or float in options else text


def written(value: Any) -> str:
    """Return a value as a text that `parsed` reads."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple | list):
        return ", ".join(f"[{written(item)}]" if isinstance(item, tuple | list) else written(item) for item in value)
    return str(value)


def stepped(field: FieldInfo, text: str, steps: int) -> str:
    """Return the text of the number `steps` further up (or down), the same text where there is none.

    Whole numbers go by ones; positive ones without a unit (weights, tolerances) by tenths of a decade, others by a
    hundredth of their decade.
    """
    value, bounds = parsed(field, text), bounds_of(field)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return text
    new = _neighbour(value, steps, whole=float not in _options(field), by_ratio=bounds.above == 0 and not bounds.unit)
    return written(new) if bounds.allow(new) else text


def _neighbour(value: float, steps: int, whole: bool, by_ratio: bool) -> float:
    if whole:
        return int(value) + steps
    if by_ratio and value > 0:
        return float(f"{value * RATIO**steps:.3g}")
    decade = math.floor(math.log10(abs(value))) if value else 0
    return round(value + steps * 10 ** (decade - 2.0), 2 - decade + 1)


def _options(field: FieldInfo) -> list[Any]:
    annotation = field.annotation
    if isinstance(annotation, type) or get_origin(annotation) in (tuple, Literal):
        return [annotation]
    return [option for option in get_args(annotation) if option is not type(None)]


def _number(text: str) -> Any:
    for read in (int, float):
        try:
            return read(text)
        except ValueError:
            continue
    return text


def _list(text: str) -> Any:
    """Read ``1, 2`` or ``[1, 2], [3, 4]`` or ``water, lipid``, with or without brackets about the whole."""
    for whole in (text, f"[{text}]"):
        try:
            found = tomllib.loads(f"list = {whole}")["list"]
        except (tomllib.TOMLDecodeError, RecursionError):
            continue
        if isinstance(found, list):
            return found
    return [_number(item.strip().strip("\"'")) for item in text.strip("[]").split(",")]
