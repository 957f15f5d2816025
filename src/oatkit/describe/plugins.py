"""Plugins and tables of a pipeline, from their own declarations."""

import inspect
import re
from dataclasses import dataclass
from typing import Any

from oatkit.api import Plugin
from oatkit.parameters import Parameters, bounds_of, expected, part_of
from oatkit.pipeline import Pipeline


@dataclass(frozen=True)
class ParameterRow:
    """One parameter of a plugin."""

    name: str
    takes: str
    """Type, range and unit in words."""
    unit: str
    default: str
    """As a pipeline file writes it."""
    meaning: str


def parameter_rows(cls: type[Parameters]) -> list[ParameterRow]:
    """Return the parameters of a plugin class in the order of their declaration."""
    return [
        ParameterRow(name, expected(f), bounds_of(f).unit, _default(f.default), f.description or "")
        for name, f in cls.model_fields.items()
    ]


def plugin_text(cls: type[Plugin], origin: str) -> str:
    """Return kind, name, docstring and a paragraph for each parameter of a plugin."""
    return _text(f"{cls.kind.replace('_', ' ')} {cls.name}   ({origin})", cls)


def pipeline_tables() -> dict[str, type[Parameters]]:
    """Return the tables of a pipeline that are no plugins, by name."""
    parts = {name: part_of(field) for name, field in Pipeline.model_fields.items()}
    return {name: cls for name, cls in parts.items() if cls and not cls.kind}


def table_text(name: str, cls: type[Parameters]) -> str:
    """Return likewise what is to be said of a table of a pipeline."""
    return _text(f"table [{name}] of a pipeline", cls)


def _text(head: str, cls: type[Parameters]) -> str:
    rows = parameter_rows(cls)
    lines = [head, "", _plain(inspect.cleandoc(cls.__doc__ or "")), ""]
    lines.append("Parameters:" if rows else "It has no parameters.")
    for row in rows:
        lines += [f"  {row.name} = {row.default}", f"      {row.meaning}", f"      takes {row.takes}"]
    return "\n".join(lines)


def _plain(docstring: str) -> str:
    """Return a docstring without the marks that are for its page in the reference."""
    without_citations = re.sub(r"\[(\w+)\]_", r"[\1]", docstring)
    return re.sub(r"^\.\. math:: ", "    ", without_citations, flags=re.MULTILINE).replace("``", "`")


def _default(value: Any) -> str:
    if isinstance(value, Parameters):
        return f'"{value.name}"' if value.name else "{}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return f"[{', '.join(_default(v) for v in value)}]"
    return f'"{value}"' if isinstance(value, str) else "not set" if value is None else str(value)
