"""What a step offers to choose from: every installed plugin of its kind, and why some cannot be taken."""

import inspect
from dataclasses import dataclass

from oatkit.parameters import Parameters
from oatkit.registry import Entry, installed


@dataclass(frozen=True)
class Choice:
    """One plugin of a chooser."""

    name: str
    """As a pipeline file writes it."""
    about: str
    """The first line of its docstring, or why it cannot be taken."""
    usable: bool = True


def choices(ability: type[Parameters]) -> list[Choice]:
    """Return the plugins that fit a field of the type `ability`, then what is broken, each with the reason.

    A plugin whose name is ambiguous is offered by its full name, which never is.
    """
    entries = [e for e in installed().entries if e.kind in (ability.kind, None)]
    fitting = [e for e in entries if e.cls is not None and issubclass(e.cls, ability)]
    return [_usable(e) for e in fitting] + [Choice(e.full_name, e.problem, False) for e in entries if e.cls is None]


def _usable(entry: Entry) -> Choice:
    about = inspect.cleandoc((entry.cls and entry.cls.__doc__) or "").split("\n")[0]
    if entry.status == "ok":
        return Choice(entry.name, about)
    return Choice(entry.full_name, f"{about} ({entry.problem})")
