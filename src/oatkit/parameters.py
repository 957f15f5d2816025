"""How a parameter is declared, checked and described: once, beside its field.

A plugin class is a frozen pydantic model whose fields are its parameters. From the one declaration made with `param`
come validation, the keys of a pipeline file, ``oatkit describe``, ``--set``, the tables in the docs and the GUI's form.
"""

import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Union, get_args, get_origin

import pydantic
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_serializer, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails, PydanticCustomError

from oatkit.errors import OatkitError, ValidationError
from oatkit.names import did_you_mean

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


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
    extra: Any = {"oatkit": Bounds(unit, above, at_least, below, at_most)}
    return Field(default, description=text, json_schema_extra=extra)


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
        return " or ".join(_describe(arg, bounds) for arg in args if arg is not type(None))
    if origin is Literal:
        return " or ".join(_shown(word) for word in args)
    if origin is tuple:
        count = "a list of" if Ellipsis in args else f"a list of {len(args)}"
        if isinstance(args[0], type) and issubclass(args[0], Parameters):
            return f"{count} {_called(args[0])}s"
        return f"{count} {ITEMS.get(args[0], 'values')}{limits}"
    if isinstance(annotation, type) and issubclass(annotation, Parameters):
        return f"a {_called(annotation)}"
    words = {bool: "true or false", str: "a text", Path: "a path"}
    numbers = {float: "a number", int: "a whole number"}
    return words.get(annotation) or numbers.get(annotation, str(annotation)) + limits


ITEMS: Mapping[Any, str] = {float: "numbers", int: "whole numbers", str: "texts", Path: "paths"}
"""What a message calls the items of a list."""


def _called(cls: "type[Parameters]") -> str:
    """Return what a message calls a class: ``forward model``, ``quadratic regularizer``, ``table``."""
    kind = cls.kind.replace("_", " ")
    word = cls.__name__.lower()
    return kind if word == kind.replace(" ", "") else f"{word} {kind}" if kind else "table"


def part_of(field: FieldInfo) -> "type[Parameters] | None":
    """Return the class that a field asks of what is put into it, or of each in its list; None for a plain parameter."""
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


class _OurErrors(ModelMetaclass):
    """Turns what pydantic raises on ``Plugin(...)`` into the one exception tree of this package."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        try:
            return super().__call__(*args, **kwargs)
        except pydantic.ValidationError as error:
            where = cls.__name__
            raise ValidationError("\n".join(f"{where}{key}: {text}" for key, text in problems(error))) from None


class Parameters(BaseModel, metaclass=_OurErrors):
    """A frozen set of parameters; strict about types, unknown names and numbers that are not finite."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    kind: ClassVar[str] = ""
    name: ClassVar[str] = ""
    written_as: ClassVar[str] = ""
    """``distribution:name``, where the name alone would stand for another plugin, too; the registry sets it."""
    key_word: ClassVar[str] = "parameter"
    """What a message calls a key of this table."""
    title: ClassVar[str] = "this table"
    """What a message calls the table, where it is no plugin with a name."""

    @classmethod
    def _title(cls) -> str:
        return f"'{cls.name}'" if cls.name else cls.title

    @model_validator(mode="wrap")
    @classmethod
    def _explain(cls, data: Any, handler: Any) -> Any:
        """Say of each unknown or missing key what was meant, while it is known whose key it is."""
        try:
            return handler(data)
        except pydantic.ValidationError as error:
            lines = [_in_our_words(detail, cls) for detail in error.errors()]
            raise pydantic.ValidationError.from_exception_data(cls.__name__, lines) from None

    @field_validator("*", mode="wrap")
    @classmethod
    def _check(cls, value: Any, handler: Any, info: ValidationInfo) -> Any:
        field = cls.model_fields[info.field_name or ""]
        context: Context | None = info.context
        value = _as_tuples(value)
        if (ability := part_of(field)) and isinstance(value, Mapping):
            value = _part(ability, field.default, value, context)
        elif ability and isinstance(value, tuple):
            value = _parts(ability, value, context)
        elif Path in (field.annotation, *get_args(field.annotation)):
            value = _as_paths(value, context.folder if context else Path())
        try:
            checked = handler(value)
        except pydantic.ValidationError:
            raise _not_what_was_expected(field, value) from None
        # To Python, true equals 1 and so does 1.0.
        wrong_type = get_origin(field.annotation) is Literal and type(value) not in map(
            type, get_args(field.annotation)
        )
        if wrong_type or not all(bounds_of(field).allow(number) for number in _numbers(checked)):
            raise _not_what_was_expected(field, value)
        return checked

    @model_serializer
    def _table(self) -> dict[str, Any]:
        """Return the parameters as a table of a pipeline file, with the plugin's name under ``use``."""
        head = {"use": self.written_as or self.name} if self.name else {}
        return head | {name: _plain(getattr(self, name)) for name in type(self).model_fields}


def _as_tuples(value: Any) -> Any:
    return tuple(_as_tuples(item) for item in value) if isinstance(value, list | tuple) else value


def _as_paths(value: Any, folder: Path) -> Any:
    """Return a text, or each text of a list, as a path from `folder`."""
    if isinstance(value, tuple):
        return tuple(_as_paths(item, folder) for item in value)
    return folder / value if isinstance(value, str) else value


def _numbers(value: Any) -> Iterator[float]:
    """Yield the numbers in a value, nested tuples included."""
    if isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)
    elif isinstance(value, int | float):
        yield value


def _plain(value: Any) -> Any:
    if isinstance(value, Parameters):
        return value.model_dump()
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    # Absolute, since the file that it is written to may lie elsewhere.
    return str(value.absolute()) if isinstance(value, Path) else value


def _part(ability: type[Parameters], default: Any, table: Mapping[str, Any], context: Context | None) -> Parameters:
    """Make the plugin that a nested table describes; without ``use`` it is the field's own."""
    parameters = {k: v for k, v in table.items() if k != "use" or not ability.kind}
    chosen = ability if not ability.kind else _used(ability, default, table.get("use"), context)
    if isinstance(default, chosen):
        parameters = {**default.model_dump(), **parameters}
        parameters.pop("use", None)
    return chosen.model_validate(parameters, context=context)


def _used(ability: type[Parameters], default: Any, use: Any, context: Context | None) -> type[Parameters]:
    """Return the class that ``use`` names; without it, the class of the field's own plugin."""
    if use is None and isinstance(default, Parameters):
        return type(default)
    if context is None:
        raise PydanticCustomError("oatkit", "must be a plugin object here, got a table")
    if not isinstance(use, str):
        kind = ability.kind.replace("_", " ")
        raise PydanticCustomError("oatkit", "{text}", {"text": f'needs use = "...", the name of a {kind}'})
    try:
        return context.find(ability.kind, use)
    except OatkitError as error:
        raise PydanticCustomError("oatkit", "{text}", {"text": str(error)}) from None


def _parts(ability: type[Parameters], tables: tuple[Any, ...], context: Context | None) -> tuple[Any, ...]:
    """Make the plugins of a list of tables; all that is wrong is reported together, under ``0``, ``1``, ..."""
    made, wrong = [], []
    for index, table in enumerate(tables):
        try:
            made.append(_part(ability, None, table, context) if isinstance(table, Mapping) else table)
        except pydantic.ValidationError as error:
            wrong += [_in_our_words({**d, "loc": (index, *d["loc"])}, ability) for d in error.errors()]
        except PydanticCustomError as error:
            wrong.append(InitErrorDetails(type=error, loc=(index,), input=table))
    if wrong:
        raise pydantic.ValidationError.from_exception_data(ability.__name__, wrong)
    return tuple(made)


def _not_what_was_expected(field: FieldInfo, value: Any) -> PydanticCustomError:
    got = f"the {value.kind} '{value.name}'" if isinstance(value, Parameters) else _shown(value)
    if isinstance(value, str) and (ability := part_of(field)) and ability.kind:
        got += f'; write {{ use = "{value}" }}'
    return PydanticCustomError("oatkit", "must be {expected}, got {got}", {"expected": expected(field), "got": got})


def _shown(value: Any) -> str:
    """Write a value as a pipeline file would, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def problems(error: pydantic.ValidationError) -> list[tuple[str, str]]:
    """Return the path (``.key.key``) and a sentence for each error of a failed validation."""
    return [("".join(f".{key}" for key in detail["loc"]), detail["msg"]) for detail in error.errors()]


def _in_our_words(detail: Any, cls: type[Parameters]) -> InitErrorDetails:
    """Rewrite one of pydantic's errors; those of nested tables have been rewritten where they arose."""
    text, path = detail["msg"], detail["loc"]
    if detail["type"] == "extra_forbidden":
        key = str(path[-1])
        text = f"{cls._title()} has no {cls.key_word} '{key}'{did_you_mean(key, cls.model_fields)}"
        path = path[:-1]
    elif detail["type"] == "missing":
        text = f"is missing: {cls._title()} needs {expected(cls.model_fields[path[-1]])}"
    error = PydanticCustomError("oatkit", "{text}", {"text": text})
    return InitErrorDetails(type=error, loc=path, input=detail["input"])
