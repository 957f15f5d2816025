"""Pieces of reStructuredText."""

import re
from collections.abc import Iterable, Sequence
from textwrap import indent

CODE = re.compile(r"(`+[^`]+`+_*)")


def heading(text: str, line: str = "=") -> str:
    """Return a heading, underlined by `line`."""
    return f"{text}\n{line * len(text)}\n"


def escaped(text: str) -> str:
    """Return text whose ``|`` and ``*`` mean themselves; what stands in backticks stays as it is."""
    parts = CODE.split(text)
    parts[::2] = [re.sub(r"([|*])", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def literal(text: str, language: str) -> str:
    """Return a block of code."""
    return f".. code-block:: {language}\n\n{indent(text.rstrip(), '   ')}\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], widths: str = "auto") -> str:
    """Return a table of cells that are reStructuredText of one line."""
    lines = [".. list-table::", "   :header-rows: 1", f"   :widths: {widths}", ""]
    for row in (head, *rows):
        lines += [f"   {'*' if i == 0 else ' '} - {cell}" for i, cell in enumerate(row)]
    return "\n".join(lines) + "\n"


def contents(*names: str) -> str:
    """Return a table of contents with the pages of these names."""
    return "\n".join([".. toctree::", "   :maxdepth: 1", "", *(f"   {name}" for name in names)]) + "\n"
