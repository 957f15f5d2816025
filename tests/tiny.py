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


def main() -> None:
    """Run the command line; pages show several ways to write one file, of which each is tried."""
    from oatkit.cli import main

    Pipeline.of_table = shrunk(Pipeline.of_table)  # type: ignore[method-assign]
    if "-o" in sys.argv and not {"--resume", "--overwrite", "new-plugin"} & set(sys.argv):
        sys.argv.append("--overwrite")
    main()


if __name__ == "__main__":
    main()
