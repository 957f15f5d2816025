"""The form of a plugin of any kind: what pipelines, command line, documentation and window build on."""

import inspect
import pickle
import re
import tomllib
from collections.abc import Iterator
from functools import partial
from typing import Any

from oatkit.api import KINDS, Plugin, ValidationError, param
from oatkit.errors import OatkitError
from oatkit.parameters import Bounds, Context, Parameters, bounds_of
from oatkit.registry import installed
from oatkit.testing.running import refuses
from oatkit.testing.values import beyond, filled, foreign_types, holds, others

NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")

MATHEMATICAL = ("forward_model", "solver", "regularizer", "fluence_model", "unmixer")
"""Kinds whose docstring tells where their mathematics can be looked up."""

REFERENCE = re.compile(
    r"\b(1[89]|20)\d\d\b|\w(19|20)\d\d\]|10\.\d{4,}/|\bet al\b|https?://|\bEq\. |\bafter [A-Z]"
    r"|\.\. math::|\|[^|\s][^|\n]*\||\^|\b\w+\([^()\n]*\) = "
)
"""A year, a key such as [Beck2009], a DOI, "et al.", an address, "after" somebody, the number of an equation, or a
formula: a norm between bars, a power, a function that equals something, mathematics of Sphinx."""

PURE = re.compile(
    r"\b(relative|ratio|share|part|fraction|factor|percent|times|dimensionless|pure number|probability|exponent|power"
    r"|index|weight|momentum|relaxation|number of|order|degree of|anisotropy|standard deviations?\b.*\bin|of the median"
    r"|as `?scaling`? says|in units? of|in the units? of)\b"
)
"""Words that say of a number that it has no unit, or what it is measured in."""


def abstract(cls: type[Plugin]) -> Iterator[str]:
    """The class defines all that its kind asks for, by a name of small letters, digits and single hyphens."""
    if inspect.isabstract(cls):
        yield f"{cls.__name__} lacks the method {', '.join(sorted(cls.__abstractmethods__))}"
    if not NAME.fullmatch(cls.name):
        yield f"'{cls.name}' is no plugin name: small letters, digits and single hyphens"
    kinds = [kind for kind, base in KINDS.items() if issubclass(cls, base)]
    if kinds != [cls.kind]:
        yield f"it is of the kinds {', '.join(kinds)} and says '{cls.kind}'; a plugin is of one kind"


def final(cls: type[Plugin]) -> Iterator[str]:
    """A plugin is not derived from another plugin: what is said of one must not change another."""
    for base in cls.__mro__[1:]:
        if issubclass(base, Plugin) and base.name and not inspect.isabstract(base):
            yield f"{cls.__name__} is derived from the plugin {base.__name__}; share an abstract class or a function"


def frozen(cls: type[Plugin]) -> Iterator[str]:
    """Parameters are frozen, of strict types, known by name and finite, as the base class declares it."""
    for key, value in Plugin.model_config.items():
        if cls.model_config.get(key) != value:
            yield f"model_config sets {key} to {cls.model_config.get(key)!r}; leave it {value!r}"


def defaults(cls: type[Plugin]) -> Iterator[str]:
    """It can be made without parameters, and each default is a value that may be given."""
    try:
        plugin = cls()
        cls(**{name: getattr(plugin, name) for name in cls.model_fields})
    except OatkitError as error:
        yield f"{cls.__name__} with its defaults: {' '.join(str(error).split())}"


def docstring(cls: type[Plugin]) -> Iterator[str]:
    """The class has a docstring that begins with a sentence and, where there is mathematics, says where it is from.

    A reference may stand in the docstring of a method; `REFERENCE` says what is taken for one.
    """
    text = inspect.cleandoc(cls.__dict__.get("__doc__") or "")
    first = text.split("\n\n")[0]
    if not re.match(r"\S.*[.:]", first, re.DOTALL):
        yield "the class has no docstring that begins with a sentence"
    methods = [inspect.cleandoc(m.__doc__ or "") for m in vars(cls).values() if inspect.isfunction(m)]
    if cls.kind in MATHEMATICAL and not REFERENCE.search("\n".join([text, *methods])):
        yield "no docstring says where the method is from: a formula, or author and year, or a DOI"


def parameters(cls: type[Plugin]) -> Iterator[str]:
    """Each parameter is declared by `param` with a text, and is of a type that a pipeline file holds."""
    for name, field in cls.model_fields.items():
        if not isinstance((field.json_schema_extra or {}).get("oatkit"), Bounds):  # type: ignore[union-attr]
            yield f"{name} is not declared with param(default, text, ...)"
        elif not (field.description or "").strip():
            yield f"{name} has no text that says what it means"
        wrong = [getattr(part, "__name__", repr(part)) for part in foreign_types(field.annotation)]
        if wrong:
            yield f"{name} is of type {', '.join(wrong)}; take numbers, words, texts, paths, tuples of them, or plugins"
        if holds(field.annotation, type(None)) and field.default is not None:
            yield f"{name} may be None, which no pipeline file can say; make None its default, or take a word"


def units(cls: type[Plugin]) -> Iterator[str]:
    """A number that is no count has a unit, or its text says what it is relative to."""
    for name, field in cls.model_fields.items():
        text = f"{name.replace('_', ' ')} {field.description}"
        if holds(field.annotation, float) and not bounds_of(field).unit and not PURE.search(text):
            yield f"{name} has no unit; if it is a pure number, let its text say what it is relative to"


def bounds(cls: type[Plugin]) -> Iterator[str]:
    """Numbers outside of the declared range are refused with a `ValidationError`, as are NaN and infinity."""
    for name, field in cls.model_fields.items():
        endless = (float("nan"), float("inf"), -float("inf")) if holds(field.annotation, float) else ()
        tried = {n: filled(field.annotation, n) for n in (*beyond(bounds_of(field)), *endless)}
        taken = [f"{n:g}" for n, v in tried.items() if v is not None and not _refuses(cls, name, v)]
        if taken:
            yield f"{name} takes {', '.join(taken)}; expected a ValidationError"
    if not _refuses(cls, "no_such_parameter", 1):
        yield "it takes a parameter that it does not have"


def value(plugin: Plugin) -> Iterator[str]:
    """A plugin cannot be changed, and equals, hashes and pickles by its parameters."""
    for name in type(plugin).model_fields:
        if not refuses(partial(setattr, plugin, name, getattr(plugin, name)), Exception):
            yield f"{name} can be set on a finished plugin"
    twin = plugin.model_copy()
    if twin != plugin or hash(twin) != hash(plugin):
        yield "a copy is not equal to it, or hashes otherwise"
    if pickle.loads(pickle.dumps(plugin)) != plugin:
        yield "a pickled copy is not equal to it"
    for other in _altered(plugin):
        if other == plugin:
            yield f"it is equal to one with other parameters: {other!r}"


def toml(plugin: Plugin) -> Iterator[str]:
    """Written into a pipeline file and read again it is the same, whatever its parameters are."""
    import tomlkit

    for one in (plugin, *_altered(plugin)):
        table = {"part": one.model_dump()}
        text = tomlkit.dumps(_without_none(table))
        holder = _holder(type(plugin))
        if holder.model_validate(tomllib.loads(text), context=Context(_finder(type(plugin)))).part != one:  # type: ignore[attr-defined]
            yield f"read from a pipeline file it is another: {text.strip()}"


def _refuses(cls: type[Plugin], name: str, value: Any) -> bool:
    return refuses(lambda: cls(**{name: value}), ValidationError)


def _altered(plugin: Plugin) -> Iterator[Plugin]:
    """Yield plugins that differ in one parameter."""
    cls = type(plugin)
    for name, field in cls.model_fields.items():
        for other in others(field):
            if other != getattr(plugin, name):
                try:
                    yield cls(**{**{key: getattr(plugin, key) for key in cls.model_fields}, name: other})
                except OatkitError:
                    continue  # parameters may be bound to each other


def _holder(cls: type[Plugin]) -> type[Parameters]:
    """Return the class of a table with one slot for plugins of the kind of `cls`, as a pipeline has it."""
    kind: Any = KINDS[cls.kind]
    return type("Holder", (Parameters,), {"__annotations__": {"part": kind}, "part": param(..., "a plugin")})


def _finder(cls: type[Plugin]) -> Any:
    """Return the search of a pipeline file, which also finds `cls` where that is not installed."""

    def find(kind: str, name: str) -> type[Parameters]:
        if kind == cls.kind and name in (cls.name, cls.written_as):
            return cls
        return installed().find(kind, name)

    return find


def _without_none(table: Any) -> Any:
    if isinstance(table, dict):
        return {key: _without_none(item) for key, item in table.items() if item is not None}
    return [_without_none(item) for item in table] if isinstance(table, list) else table


CHECKS_OF_CLASS = (abstract, final, frozen, defaults, docstring, parameters, units, bounds)
CHECKS = (value, toml)
