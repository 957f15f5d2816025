"""What all commands share: how they are registered, their exit codes, and the arguments that they have in common."""

import functools
import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

import oatkit
from oatkit.checkpoint import at_checkpoints
from oatkit.errors import OatkitError, PluginError, ReadError, ResultError, SolverError, ValidationError

app = typer.Typer(
    name="oatkit",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Optoacoustic tomography: from a scan to a non-negative image. "
    "Start with `oatkit demo`, then `oatkit run maxent SCAN -o OUT.zarr` and `oatkit export OUT.zarr picture.png`.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"oatkit {oatkit.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version of oatkit, and exit."
        ),
    ] = False,
) -> None: ...


EXIT_CODES: dict[type[OatkitError], int] = {
    ResultError: 1, ValidationError: 2, PluginError: 2, SolverError: 3, ReadError: 4,
}  # fmt: skip
INTERRUPTED = 130

Command = Callable[..., Any]

ScanPath = Annotated[
    Path,
    typer.Argument(
        metavar="SCAN", readable=False, help="The scan: a file that a reader knows (`oatkit plugins` lists them)."
    ),
]
ResultPath = Annotated[Path, typer.Argument(metavar="OUT.zarr", help="A result that `oatkit run` has written.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is there already.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for other programs.")]
RegionFiles = Annotated[
    list[Path],
    typer.Option(
        "--regions",
        "-r",
        metavar="FILE",
        readable=False,
        help="Regions of interest: a .toml, a mask or labels (.npy, .tif, .png), or a file that a reader knows. "
        "Repeatable.",
    ),
]
Changes = Annotated[
    list[str],
    typer.Option("--set", metavar="SLOT.KEY=VALUE", help="Change the pipeline: reconstruct.weight=0.01. Repeatable."),
]


class Terminated(BaseException):
    """A signal asked the command to end; its number is the text."""


def terminate(number: int, frame: Any) -> None:
    """Answer a signal by leaving every block that cleans up behind itself."""
    raise Terminated(number)


_asked_to_stop = False


def interrupt(number: int, frame: Any) -> None:
    """Answer Ctrl-C, and remember it: code that is being compiled just then may swallow what is raised."""
    global _asked_to_stop
    _asked_to_stop = True
    raise KeyboardInterrupt


def _look_for_interrupt() -> None:
    if _asked_to_stop:
        raise KeyboardInterrupt


def command(function: Command) -> Command:
    """Register a command whose errors become one sentence and an exit code."""

    @functools.wraps(function)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        try:
            with at_checkpoints(_look_for_interrupt):
                return function(*args, **kwargs)
        except OatkitError as error:
            if os.environ.get("OATKIT_DEBUG"):
                raise
            complain(str(error))
            raise typer.Exit(next((code for kind, code in EXIT_CODES.items() if isinstance(error, kind)), 1)) from None
        except KeyboardInterrupt:
            complain("interrupted")
            raise typer.Exit(INTERRUPTED) from None
        except Terminated as signalled:
            complain("terminated")
            raise typer.Exit(128 + int(str(signalled))) from None
        except BrokenPipeError:
            # The reader of our output has gone (`oatkit info ... | head`): nothing is left to say.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except OSError as error:
            if os.environ.get("OATKIT_DEBUG"):
                raise
            complain(str(error))
            raise typer.Exit(1) from None

    return app.command(name=function.__name__.removesuffix("_").replace("_", "-"))(guarded)


def complain(text: str) -> None:
    """Print to the error stream, one line for each of `text`, with the name of the program before it."""
    for line in text.splitlines():
        # Names from files must not steer the terminal.
        shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
        typer.echo(f"oatkit: {shown}", err=True)


class Complaints(logging.Handler):
    """Prints what the log of oatkit warns of, as `complain` does."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one warning."""
        complain(record.getMessage())


def check_new(path: Path, overwrite: bool) -> None:
    """Refuse, before any work is done, to write over what is there."""
    if os.path.lexists(path) and not overwrite:
        raise ValidationError(f"{path}: exists already; choose another name or add --overwrite")


def frames_in(text: str, count: int, option: str = "--frames", what: str = "scan") -> list[int]:
    """Read ``A:B``, ``A:B:C`` or ``N``. Raises `ValidationError` for anything else and for an empty choice."""
    try:
        numbers = [int(part) if part else None for part in text.split(":")]
        one = len(numbers) == 1
        chosen = [range(count)[numbers[0]]] if one else list(range(count)[slice(*numbers)])  # type: ignore[index]
    except (ValueError, IndexError, TypeError):
        chosen = []
    if not chosen:
        raise ValidationError(
            f"{option} {text}: expected A:B or one number within the {what}'s frames 0 .. {count - 1}"
        )
    return chosen
