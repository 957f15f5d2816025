"""The page on the hooks, with the example of each."""

import inspect

from oatkit import hookspecs
from oatkit.api import KINDS
from oatkit_docs.docstrings import rst_of
from oatkit_docs.rst import heading, literal


def pages() -> dict[str, str]:
    """Return the page of the hooks."""
    parts = [heading("Hooks"), rst_of(hookspecs.__doc__ or ""), ""]
    for kind, base in KINDS.items():
        hook = getattr(hookspecs, f"oatkit_{kind}s")
        summary, code = halves(hook.__name__)
        parts += [heading(f"``{hook.__name__}``", "-"), f"{summary}:", "", literal(code, "python")]
        parts += [f"The class derives from `oatkit.api.{base.__name__}`: :doc:`plugins/{kind}`.", ""]
    return {"hooks.rst": "\n".join(parts)}


def halves(hook: str) -> tuple[str, str]:
    """Return what a hook does, and its example."""
    summary, code = inspect.cleandoc(getattr(hookspecs, hook).__doc__ or "").split("::\n\n", 1)
    return summary, code
