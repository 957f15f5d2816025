"""The pages on the public modules: each name with its signature and docstring, described once."""

import ast
import importlib
import inspect
from functools import cache
from itertools import pairwise
from textwrap import indent

from oatkit_docs.docstrings import rst_of
from oatkit_docs.rst import contents, heading, table

MODULES = (
    "oatkit", "oatkit.api", "oatkit.events", "oatkit.metrics", "oatkit.weights", "oatkit.simulate", "oatkit.scanfile",
    "oatkit.spectra", "oatkit.focus", "oatkit.motion", "oatkit.regions", "oatkit.regions.spectra", "oatkit.kinetics",
    "oatkit.figure", "oatkit.report", "oatkit.export", "oatkit.convert", "oatkit.batch", "oatkit.testing",
    "oatkit.data", "oatkit.errors", "oatkit.store",
)  # fmt: skip
"""The public modules. A name that several offer is described in the first."""

INTERNAL = "model_config, key_word, title, written_as"
"""What classes of parameters have for the sake of messages."""


def names(module: str) -> list[str]:
    """Return the public names of a module: its ``__all__``, else what it defines without an underscore before it."""
    loaded = importlib.import_module(module)
    declared = getattr(loaded, "__all__", None)
    if declared is not None:
        return list(declared)
    return [n for n, v in vars(loaded).items() if getattr(v, "__module__", "") == module and not n.startswith("_")]


@cache
def homes() -> dict[str, str]:
    """Return in which module each public name is described."""
    found: dict[str, str] = {}
    for module in MODULES:
        for name in names(module):
            found.setdefault(name, module)
    return found


def pages() -> dict[str, str]:
    """Return a page for each public module, and one that lists them."""
    each = {f"api/{module}.rst": _module(module) for module in MODULES}
    rows = [(f":doc:`{module}`", _summary(module)) for module in MODULES]
    text = "All that scripts and plugins may rely on. What is not here may change without notice."
    overview = [heading("Python"), text, "", table(("module", "what is in it"), rows), contents(*MODULES)]
    return {"api/index.rst": "\n".join(overview), **each}


def _summary(module: str) -> str:
    docstring = importlib.import_module(module).__doc__ or ""
    return rst_of(docstring).split("\n\n")[0].replace("\n", " ")


def _module(module: str) -> str:
    here = [name for name in names(module) if homes()[name] == module]
    elsewhere = [f"`{homes()[name]}.{name}`" for name in names(module) if homes()[name] != module]
    parts = [heading(module), f".. automodule:: {module}", "   :no-members:", ""]
    if elsewhere:
        parts += ["Described elsewhere: " + ", ".join(elsewhere) + ".", ""]
    return "\n".join([*parts, *(_described(module, name) for name in here)])


def _described(module: str, name: str) -> str:
    """Return the directive that describes a name."""
    value = getattr(importlib.import_module(module), name)
    full = f"{module}.{name}"
    if inspect.isclass(value):
        kind = "exception" if issubclass(value, Exception) else "class"
        bases = "   :show-inheritance:\n" if any(base.__name__ in homes() for base in value.__bases__) else ""
        return f".. auto{kind}:: {full}\n   :members:\n   :exclude-members: {INTERNAL}\n{bases}"
    if inspect.isroutine(value):
        return f".. autofunction:: {full}\n"
    return f".. py:data:: {full}\n\n{indent(rst_of(said_of(module, name)), '   ')}\n"


def said_of(module: str, name: str) -> str:
    """Return the string that stands below the value of a name, in the module that it comes from."""
    body = ast.parse(inspect.getsource(importlib.import_module(module))).body
    for node, following in pairwise([*body, ast.Pass()]):
        if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
            return said_of(node.module or "", name)
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if name in [getattr(target, "id", "") for target in targets]:
            said = following.value if isinstance(following, ast.Expr) else None
            return str(said.value) if isinstance(said, ast.Constant) else ""
    return ""
