"""How a parameter is declared, checked and described: once, beside its field.

A plugin class is a frozen pydantic model whose fields are its parameters. From the one declaration made with `param`
come validation, the keys of a pipeline file, ``oatkit describe``, ``--set``, the tables in the docs and the GUI's form.
"""

import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, Union, get_args, get_origin

import pydantic
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_serializer
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from oatkit.errors import ValidationError


@dataclass(frozen=True)
class Bounds:
    """Unit and range of a parameter; the range holds for its numbers, not for its words."""

    unit: str = ""
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None

    def allow(self, number: float) -> bool:
        """Say whether `number` lies in the range; NaN never does."""
        return (
            (self.above is None or number > self.above)
            and (self.at_least is None or number >= self.at_least)
            and (self.below is None or number < self.below)
            and (self.at_most is None or number <= self.at_most)
        )

    def __str__(self) -> str:
        named = {"above": self.above, "at least": self.at_least, "below": self.below, "at most": self.at_most}
        unit = f" {self.unit}" if self.unit else ""
        return " and ".join(f"{word} {limit:g}{unit}" for word, limit in named.items() if limit is not None)


def param(
    default: Any,
    text: str,
    *,
    unit: str = "",
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
) -> Any:
    """Declare a parameter: its default, what it means, its unit and its range.

    The value is held in `unit` everywhere (Python, pipeline file, GUI); the method converts to SI. Bounds apply to
    numbers, each one of a tuple; where a field also takes words, they are left alone.
    """
    bounds = Bounds(unit, above, at_least, below, at_most)
    return Field(default, description=text, json_schema_extra={"oatkit": bounds})


def bounds_of(field: FieldInfo) -> Bounds:
    """Return unit and range of a field; none for one not declared with `param`."""
    extra = field.json_schema_extra
    bounds = extra.get("oatkit") if isinstance(extra, dict) else None
    return bounds if isinstance(bounds, Bounds) else Bounds()


def expected(field: FieldInfo) -> str:
    """Say in words what a field takes, with range and unit: ``a number above 0 mm``."""
    return _describe(field.annotation, bounds_of(field))


def _describe(annotation: Any, bounds: Bounds) -> str:
    limits = f" {bounds}" if str(bounds) else (f" ({bounds.unit})" if bounds.unit else "")
    origin, args = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        return " or ".join(_describe(arg, bounds) for arg in args)
    if origin is Literal:
        return " or ".join(f'"{word}"' for word in args)
    if origin is tuple:
        count = "a list of" if Ellipsis in args else f"a list of {len(args)}"
        return f"{count} {'whole ' if args[0] is int else ''}numbers{limits}"
    if isinstance(annotation, type) and issubclass(annotation, Parameters):
        return f"a {annotation.__name__} plugin"
    words = {bool: "true or false", str: "a text", Path: "a path"}
    numbers = {float: "a number", int: "a whole number"}
    return words.get(annotation) or numbers.get(annotation, str(annotation)) + limits


def part_of(field: FieldInfo) -> "type[Parameters] | None":
    """Return the ability that a field asks of a plugin put into it; None for an ordinary parameter."""
    for annotation in (field.annotation, *get_args(field.annotation)):
        if isinstance(annotation, type) and issubclass(annotation, Parameters):
            return annotation
    return None


@dataclass(frozen=True)
class Context:
    """What a table of a pipeline file needs to become an object, handed down by pydantic."""

    find: "Callable[[str, str], type[Parameters]]"
    """The class of a kind and a name; raises `PluginError`, or `ValidationError` for a name that is nowhere."""
    folder: Path = Path()
    """Paths are relative to this one."""


class _OurErrors(type(BaseModel)):  # type: ignore[misc]
    """Turns what pydantic raises on ``Plugin(...)`` into the one exception tree of this package."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        try:
            return super().__call__(*args, **kwargs)
        except pydantic.ValidationError as error:
            raise ValidationError("\n".join(f"{cls.__name__}{p}" for p in problems(error, cls))) from None  # type: ignore[arg-type]


class Parameters(BaseModel, metaclass=_OurErrors):
    """A frozen set of parameters; strict about types, unknown names and numbers that are not finite."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    kind: ClassVar[str] = ""
    name: ClassVar[str] = ""

    @field_validator("*", mode="wrap")
    @classmethod
    def _check(cls, value: Any, handler: Any, info: ValidationInfo) -> Any:
        field = cls.model_fields[info.field_name or ""]
        context: Context | None = info.context
        if isinstance(value, list):
            value = tuple(value)
        if (ability := part_of(field)) and isinstance(value, Mapping):
            value = _part(ability, field.default, value, context)
        elif field.annotation is Path and isinstance(value, str):
            value = (context.folder if context else Path()) / value
        try:
            checked = handler(value)
        except pydantic.ValidationError:
            raise _not_what_was_expected(field, value) from None
        numbers = checked if isinstance(checked, tuple) else (checked,)
        bounds = bounds_of(field)
        if not all(bounds.allow(n) for n in numbers if isinstance(n, int | float)):
            raise _not_what_was_expected(field, value)
        return checked

    @model_serializer
    def _table(self) -> dict[str, Any]:
        """Return the parameters as a table of a pipeline file, with the plugin's name under ``use``."""
        head = {"use": self.name} if self.name else {}
        return head | {name: _plain(getattr(self, name)) for name in type(self).model_fields}


def _plain(value: Any) -> Any:
    if isinstance(value, Parameters):
        return value.model_dump()
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return str(value) if isinstance(value, Path) else value


def _part(ability: type[Parameters], default: Any, table: Mapping[str, Any], context: Context | None) -> Parameters:
    """Make the plugin that a nested table describes; without ``use`` it is the field's own."""
    parameters = {k: v for k, v in table.items() if k != "use"}
    use = table.get("use")
    if use is None:
        chosen, parameters = type(default), {**default.model_dump(exclude={"use"}), **parameters}
        parameters.pop("use", None)
    elif context is None:
        raise PydanticCustomError("oatkit", "must be a plugin object here, got a table")
    else:
        try:
            chosen = context.find(ability.kind, use)
        except Exception as error:
            raise PydanticCustomError("oatkit", "{text}", {"text": str(error)}) from None
    return chosen.model_validate(parameters, context=context)


def _not_what_was_expected(field: FieldInfo, value: Any) -> PydanticCustomError:
    got = f"the {value.kind} '{value.name}'" if isinstance(value, Parameters) else _shown(value)
    return PydanticCustomError("oatkit", "must be {expected}, got {got}", {"expected": expected(field), "got": got})


def _shown(value: Any) -> str:
    """Write a value as a pipeline file would, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def problems(error: pydantic.ValidationError, cls: type[Parameters]) -> list[str]:
    """Write each error of a failed validation as ``.key: sentence``, with the nearest known name where one is unknown."""
    return [_sentence(detail, cls) for detail in error.errors()]


def _sentence(detail: Any, cls: type[Parameters]) -> str:
    from oatkit.names import did_you_mean  # only needed where something is wrong

    path = "".join(f".{key}" for key in detail["loc"])
    if detail["type"] == "extra_forbidden":
        owner = f"'{cls.name}'" if cls.name else "this table"
        key = str(detail["loc"][-1])
        known = list(cls.model_fields) if len(detail["loc"]) == 1 else []
        return f"{path}: {owner} has no parameter '{key}'{did_you_mean(key, known)}"
    return f"{path}: {detail['msg']}"
