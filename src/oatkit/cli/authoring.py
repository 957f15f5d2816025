"""The command for those who write plugins."""

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from oatkit.cli.app import command


@command
def new_plugin(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the package, as in oatkit-my-method.")],
    kind: Annotated[
        str,
        typer.Option(
            "--kind",
            "-k",
            metavar="KIND",
            help="reader, preprocessor, forward-model, solver, regularizer, segmenter, fluence-model or unmixer.",
        ),
    ],
    folder: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="An existing folder; the package gets one in it.")
    ] = Path(),
) -> None:
    """Write a package with a plugin that works, to start from.

    It has a test of the plugin, too.
    """
    from oatkit.scaffold import new_plugin as write

    target = write(name, kind, folder)
    typer.echo(f"wrote {target}; the method is in src/{name.replace('-', '_')}/plugin.py. Next:")
    typer.echo(f"  python -m pip install -e {quote(f'{target}[test]')}")
    typer.echo(f"  python -m pytest {quote(str(target))}")
    typer.echo("  oatkit plugins")
