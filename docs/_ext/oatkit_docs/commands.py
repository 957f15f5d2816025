"""The page on the command line, from the commands themselves."""

from typing import Any

import typer

from oatkit import cli
from oatkit.cli.app import EXIT_CODES, INTERRUPTED, app
from oatkit_docs.docstrings import rst_of
from oatkit_docs.rst import escaped, heading, table


def commands() -> dict[str, Any]:
    """Return every command of the program by its name, in the order of ``oatkit --help``."""
    return typer.main.get_command(app).commands  # type: ignore[attr-defined]


def records(name: str) -> list[tuple[str, str]]:
    """Return each argument and option of a command, and what its help says, as ``--help`` prints them."""
    command = commands()[name]
    context = command.context_class(command, info_name=f"oatkit {name}")
    found = (parameter.get_help_record(context) for parameter in command.get_params(context))
    return [record for record in found if record and not record[0].endswith("--help")]


def usage(name: str) -> str:
    """Return how a command is called."""
    command = commands()[name]
    context = command.context_class(command, info_name=f"oatkit {name}")
    return " ".join(["oatkit", name, *command.collect_usage_pieces(context)])


def _command(name: str) -> str:
    parts = [f".. _command-{name}:", "", heading(f"oatkit {name}", "-"), f"``{usage(name)}``", ""]
    parts += [escaped(commands()[name].help), "", f".. program:: oatkit {name}", ""]
    for declared, text in records(name):
        parts += [f".. option:: {declared}", "", f"   {escaped(text)}", ""]
    return "\n".join(parts)


def pages() -> dict[str, str]:
    """Return the page of the command line and that of errors."""
    head = [heading("Command line"), "As ``oatkit --help`` and ``oatkit COMMAND --help`` say it.", ""]
    return {"cli.rst": "\n".join([*head, *map(_command, commands())]), "errors.rst": _errors()}


def _errors() -> str:
    """Return the page on exceptions and exit codes."""
    rows = [
        (f"`oatkit.{kind.__name__}`", f"``{code}``", rst_of(kind.__doc__ or "")) for kind, code in EXIT_CODES.items()
    ]
    codes = (cli.__doc__ or "").split("\n\n")[1].replace("\n", " ")
    parts = [
        heading("Errors and exit codes"),
        f"{codes} ``{INTERRUPTED}`` is what a shell gives for Ctrl-C; another signal gives 128 and its number.",
        "",
        "In Python each of these is a class, and all derive from `oatkit.OatkitError`:",
        "",
        table(("exception", "exit code", "meaning"), rows),
        "With the environment variable ``OATKIT_DEBUG`` set, the command line shows the traceback.",
        "",
    ]
    return "\n".join(parts)
