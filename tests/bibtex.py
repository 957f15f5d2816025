"""A strict reader of BibTeX, written from its grammar, for what the tests print."""

import re

HEAD = re.compile(r"@(\w+)\{([^\s,{}]+),")
FIELD = re.compile(r"\s*(\w+)\s*=\s*\{")


def parse(text: str) -> dict[str, dict[str, str]]:
    """The fields of each entry by its key; `ValueError` for what BibTeX would not read, or a key that stands twice."""
    entries: dict[str, dict[str, str]] = {}
    position = 0
    while (position := text.find("@", position)) >= 0:
        head = HEAD.match(text, position)
        if not head or head[2] in entries:
            raise ValueError(f"no entry, or its key again: {text[position : position + 60]!r}")
        entries[head[2]], position = _fields(text, head.end())
        entries[head[2]]["type"] = head[1]
    return entries


def _fields(text: str, position: int) -> tuple[dict[str, str], int]:
    fields = {}
    while field := FIELD.match(text, position):
        end = _closing(text, field.end())
        fields[field[1]] = text[field.end() : end]
        position = end + 2
        if text[end + 1 : position] != ",":
            raise ValueError(f"no comma behind the field {field[1]}")
    rest = text[position:].lstrip()
    if not rest.startswith("}"):
        raise ValueError(f"an entry does not end: {rest[:60]!r}")
    return fields, len(text) - len(rest) + 1


def _closing(text: str, position: int) -> int:
    """Where the brace closes that was opened just before `position`."""
    depth = 1
    for place in range(position, len(text)):
        # TeX's escaped braces count for BibTeX as the others do.
        depth += {"{": 1, "}": -1}.get(text[place], 0)
        if not depth:
            return place
    raise ValueError("a brace is not closed")
