"""What a user relies on in a plugin, as checks: for those who write one, and for all that is installed.

A test of a package needs three lines::

    from oatkit.testing import check_plugin

    def test_it_keeps_its_promises():
        check_plugin(MySolver)

The checks of a kind are in the module of its name; each states its promise in its docstring. What they need of a plugin
is small: a few seconds for a solver or a model. pytest is not needed.
"""

from pathlib import Path
from typing import Any

from oatkit.api import Plugin, Reader, ValidationError
from oatkit.testing import (
    fluence,
    form,
    forward,
    preprocessor,
    reader,
    regularizer,
    segmenter,
    solver,
    unmixer,
)
from oatkit.testing.running import Check, run

__all__ = ["CHECKS", "Violations", "check_plugin", "must_be_given", "report", "violations"]

CHECKS: dict[str, tuple[Check, ...]] = {
    "reader": reader.CHECKS,
    "preprocessor": preprocessor.CHECKS,
    "forward_model": forward.CHECKS,
    "solver": solver.CHECKS,
    "regularizer": regularizer.CHECKS,
    "segmenter": segmenter.CHECKS,
    "fluence_model": fluence.CHECKS,
    "unmixer": unmixer.CHECKS,
}
"""The mathematics of each kind; beside them, `oatkit.testing.form` looks at the form of every plugin."""


class Violations(AssertionError):
    """A plugin does not keep what a user relies on; ``sentences`` holds one for each promise that is broken."""

    def __init__(self, plugin: str, sentences: list[str]) -> None:
        super().__init__(f"{plugin} breaks {len(sentences)} promises:\n" + "\n".join(f"- {s}" for s in sentences))
        self.sentences = tuple(sentences)


def check_plugin(plugin: Plugin | type[Plugin], sample: Path | str | None = None, **parameters: Any) -> None:
    """Raise `Violations` unless a plugin keeps all its promises; a class is made with its defaults and `parameters`.

    `sample` is a file that a reader reads: without one only its form and its manners towards other files are looked at.
    """
    found = violations(plugin, sample, **parameters)
    if found:
        cls = plugin if isinstance(plugin, type) else type(plugin)
        raise Violations(f"{cls.kind.replace('_', ' ')} '{cls.name or cls.__name__}'", found)


def violations(plugin: Plugin | type[Plugin], sample: Path | str | None = None, **parameters: Any) -> list[str]:
    """Return a sentence for each promise that a plugin breaks, each beginning with the name of the check.

    Raises `ValidationError` for something that is no plugin.
    """
    cls = plugin if isinstance(plugin, type) else type(plugin)
    checks = CHECKS.get(cls.kind) if issubclass(cls, Plugin) else None
    if checks is None:
        raise ValidationError(f"{plugin!r} is no plugin: derive it from one of the base classes in oatkit.api")
    found = run(form.CHECKS_OF_CLASS, cls)
    if any(sentence.startswith(("abstract", "defaults")) for sentence in found):
        return found
    made = cls(**parameters) if isinstance(plugin, type) else plugin
    found += run(form.CHECKS, made)
    lacking = must_be_given(made)
    if lacking:
        names = ", ".join(lacking)
        return [
            *found,
            f"must_be_given: {names} has no value; hand it to check_plugin, as in check_plugin(cls, {lacking[0]}=...)",
        ]
    if isinstance(made, Reader):
        return found + run(checks, reader.Sampled(made, None if sample is None else Path(sample)))
    return found + run(checks, made)


def report(cls: type[Plugin]) -> dict[str, Any]:
    """Return what can be told of a class without knowing more: its ``violations``, and what is ``unchecked`` and why.

    Left out are the mathematics of a plugin that must be given something, and what a reader makes of its own files.
    """
    found = violations(cls)
    needs = [sentence for sentence in found if sentence.startswith(must_be_given.__name__)]
    unchecked = "its own files, since no sample was handed in" if cls.kind == "reader" else ""
    if needs:
        unchecked = f"its mathematics: {needs[0].removeprefix(f'{must_be_given.__name__}: ')}"
    return {"violations": [sentence for sentence in found if sentence not in needs], "unchecked": unchecked}


def must_be_given(plugin: Plugin) -> list[str]:
    """Return which parameters have no value although their text says that they ``must be given``."""
    fields = type(plugin).model_fields
    return [
        name
        for name, field in fields.items()
        if "must be given" in (field.description or "") and getattr(plugin, name) == field.default
    ]
