"""Docstrings as Sphinx wants them: keys of references, bars and stars are plain text to those who write them."""

import inspect
import re
from typing import Any

from oatkit_docs.rst import escaped

KEY = re.compile(r"\[([A-Z]\w*\d{4}\w*)\]")
LITERAL = re.compile(r"(::$|^\s*\.\. \w+:: ?|^\s*>>> )")
"""How a block begins that is left alone: code, a formula, an example."""


def rst_of(docstring: str) -> str:
    """Return a docstring as reStructuredText.

    A reference such as ``[Prakash2019]_`` keeps its key and is no link, since each docstring is complete in itself;
    those of a section "References:" and those that are written as citations become a list.
    """
    return "\n".join(_lines(inspect.cleandoc(docstring).splitlines()))


def _lines(lines: list[str]) -> list[str]:
    done: list[str] = []
    block: int | None = None
    references: int | None = None
    for line in lines:
        depth = len(line) - len(line.lstrip())
        if block is not None and line.strip() and depth <= block:
            block = None
        if references is not None and line.strip() and depth <= references:
            references = None
        if block is not None:
            done.append(line)
        elif line.strip() == "References:":
            references = depth
            done += [f"{line[:depth]}.. rubric:: References", ""]
        elif references is not None:
            done.append(_listed(line[4:], after=done[-1]))
        else:
            done.append(_plain(line))
            if LITERAL.search(line):
                block = depth - (">>>" in line)
    return done


def _listed(line: str, after: str) -> str:
    """Return a line of the references as that of a list, whose pieces end with a full stop."""
    if not line.strip():
        return line
    depth = len(line) - len(line.lstrip())
    bullet = "* " if not after.strip() or after.endswith(".") else "  "
    return " " * depth + bullet + _plain(line.lstrip())


def _plain(line: str) -> str:
    """Return a line of prose; ``.. [Key] text`` becomes a piece of a list, whose indent is the same."""
    line = re.sub(r"^(\s*)\.\. (?=\[[A-Z]\w*\d{4})", r"\1*  ", line)
    bullet = re.match(r"\s*\*  ?(?=\S)", line)
    head = bullet.group() if bullet else ""
    return head + escaped(KEY.sub(r"[\1]", line[len(head) :].replace("]_", "]")))


def setup(app: Any) -> None:
    """Let autodoc take docstrings in this form."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _process)


def _process(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = _lines(list(lines))
