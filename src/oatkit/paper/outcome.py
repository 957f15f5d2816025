"""What an experiment ends with: a figure, a table of its own, and the paper's figures beside ours."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from oatkit.atomic import write_file
from oatkit.drawing.page import Figure, png


@dataclass(frozen=True)
class Beside:
    """One figure of the paper beside ours, in words."""

    what: str
    paper: str
    ours: str
    why: str
    """Why they differ."""


@dataclass(frozen=True)
class Outcome:
    """The end of an experiment."""

    name: str
    title: str
    figure: Figure
    beside: tuple[Beside, ...] = ()
    table: tuple[Sequence[str], ...] = ()
    """Rows of cells, the first one the heading."""
    notes: tuple[str, ...] = ()

    def markdown(self) -> str:
        """Return tables and notes as Markdown."""
        parts = [f"# {self.name}: {self.title}"]
        if self.table:
            parts.append(markdown_table(self.table))
        if self.beside:
            rows = [(row.what, row.paper, row.ours, row.why) for row in self.beside]
            parts.append(markdown_table([("", "paper", "ours", "why they differ"), *rows]))
        return "\n\n".join([*parts, *self.notes]) + "\n"

    def write(self, folder: Path, overwrite: bool = False) -> Iterator[Path]:
        """Write ``NAME.png`` and ``NAME.md`` into `folder` and yield their paths. Raises `ResultError`."""
        for ending, content in ((".png", png(self.figure)), (".md", self.markdown().encode())):
            path = folder / f"{self.name}{ending}"
            write_file(path, content, overwrite)
            yield path


def markdown_table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of cells, the first one the heading, as a Markdown table.

    >>> print(markdown_table([("a", "b"), ("1", "2")]))
    | a | b |
    |---|---|
    | 1 | 2 |
    """
    lines = [f"| {' | '.join(cells)} |" for cells in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])
