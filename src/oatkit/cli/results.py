"""Commands on results."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from oatkit.cli.app import EXIT_CODES, Overwrite, ResultPath, check_new, command, complain
from oatkit.errors import ReadError, ResultError


@command
def export(
    result: ResultPath,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Ends in .png (figure), .ome.tif or .h5.")],
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else the first one.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the images of a result as a figure, an OME-TIFF or an HDF5 file."""
    from oatkit.export import export as write

    check_new(file, overwrite)
    write(_stored(result, frame), file, overwrite=overwrite)
    typer.echo(f"wrote {file}")


@command
def verify(result: ResultPath) -> None:
    """Check that a result is complete and that no bit of it has changed."""
    from oatkit.store import verify as problems_of

    found = problems_of(result)
    for problem in found:
        complain(problem)
    if found:
        raise typer.Exit(EXIT_CODES[ReadError])
    typer.echo(f"{result}: complete, all checksums right")


def _stored(path: Path, frame: int | None) -> Any:
    """Read one frame of a result, the first good one unless said; a damaged result is unreadable input."""
    from oatkit.store import load

    try:
        stored = load(path)
        chosen = stored if frame is None else stored.frame(frame)
        return replace(chosen, images=dict(chosen))
    except ResultError as error:
        raise ReadError(str(error)) from None
