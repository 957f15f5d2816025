"""Oatkit with every grid made small, so that what pages show can be tried: ``python -m tiny run maxent ...``."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from oatkit.pipeline import Pipeline

PIXELS = 32
"""The most along a side."""


def shrunk(of_table: Callable[..., Any], most: int = PIXELS) -> Callable[..., Any]:
    """Return `Pipeline.of_table` as one that caps the pixels along a side of the grid."""

    def small(table: Mapping[str, Any], origin: str = "pipeline", folder: Path = Path()) -> Pipeline:
        grid = table.get("grid", {})
        pixels = grid.get("pixels", most)
        return of_table({**table, "grid": {**grid, "pixels": min(pixels, most)}}, origin, folder)

    return small


def new(words: list[str]) -> list[str]:
    """Return the words of a command so that it writes over what is there: pages show several ways to write one file."""
    writes = "-o" in words and not {"--resume", "--overwrite", "new-plugin"} & set(words)
    return [*words, "--overwrite"] if writes else words


def main() -> None:
    """Run the command line."""
    from oatkit.cli import main

    Pipeline.of_table = shrunk(Pipeline.of_table)  # type: ignore[method-assign]
    sys.argv = new(sys.argv)
    main()


if __name__ == "__main__":
    main()
