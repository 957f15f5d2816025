"""Commands that show what oatkit does without a scan of one's own."""

import time
from pathlib import Path
from typing import Annotated

import typer

from oatkit.cli.app import Overwrite, command


@command
def demo(
    folder: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Where to write.")] = Path(
        "oatkit-demo"
    ),
    overwrite: Overwrite = False,
) -> None:
    """Simulate scans and show what becomes of them; needs no file.

    One is reconstructed three ways, the oxygen is found in another, each beside the truth.
    """
    from oatkit.demo import run_demo

    start = time.perf_counter()
    for line in run_demo(folder, overwrite):
        typer.echo(line)
    typer.echo(f"done in {time.perf_counter() - start:.0f} s")


@command
def paper(
    experiment: Annotated[
        str, typer.Argument(metavar="EXPERIMENT", help="Its name; without it, the list of experiments.")
    ] = "",
    folder: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Where to write.")] = Path(
        "oatkit-paper"
    ),
    scan: Annotated[
        Path | None, typer.Option(metavar="SCAN", help="A real scan of a mouse, for fig5, fig6, fig7 and table1.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Repeat an experiment of the paper on maximum entropy (2019).

    Prakash and others, IEEE Trans. Biomed. Eng.: a figure, and a table of the paper's numbers beside ours.
    """
    from oatkit.paper.experiments import EXPERIMENTS
    from oatkit.paper.running import run_experiment

    if not experiment:
        for name, what in EXPERIMENTS.items():
            typer.echo(f"{name:<10}{what}")
        return
    start = time.perf_counter()
    for line in run_experiment(experiment, folder, scan, overwrite):
        typer.echo(line)
    typer.echo(f"done in {time.perf_counter() - start:.0f} s")
