"""The pipeline of a result as a TOML file that runs again, with what was asked for beside what was run."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ListingLine:
    """A line of the listing. One that was only asked for is a comment, so that the whole is still valid TOML."""

    text: str
    kind: str = ""
    """``"asked"``, ``"run"`` in place of it, or the same in both: ``""``."""


def listing(requested: Mapping[str, Any], run: Mapping[str, Any]) -> tuple[ListingLine, ...]:
    """Return the lines of the pipeline as run; none where it is not known."""
    return tuple(_lines(_toml(requested or run), _toml(run))) if run else ()


def _lines(asked: list[str], run: list[str]) -> Iterator[ListingLine]:
    for tag, i, j, k, m in SequenceMatcher(None, asked, run, autojunk=False).get_opcodes():
        if tag == "equal":
            yield from map(ListingLine, run[k:m])
            continue
        yield from (ListingLine(f"# asked for: {line}", "asked") for line in asked[i:j] if line)
        yield from (ListingLine(line, "run") for line in run[k:m])


def _toml(table: Mapping[str, Any]) -> list[str]:
    import tomlkit

    return tomlkit.dumps(_plain(table)).splitlines()


def _plain(value: Any) -> Any:
    """Return what TOML can hold; it has no word for None, which is left out as in pipeline files."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, tuple | list | np.ndarray):
        return [_plain(v) for v in value if v is not None]
    return value if isinstance(value, bool | int | float | str) else str(value)
