"""Pages on the plugins by kind, the tables of a pipeline file and the presets, from their declarations."""

from oatkit.api import KINDS, Plugin, Proximable, Quadratic, Smooth
from oatkit.describe import parameter_rows, pipeline_tables
from oatkit.parameters import Parameters, part_of
from oatkit.pipeline import Pipeline, presets
from oatkit.registry import Entry, installed
from oatkit_docs.docstrings import rst_of
from oatkit_docs.rst import contents, escaped, heading, literal, table

ABILITIES = (Smooth, Proximable, Quadratic)


def pages() -> dict[str, str]:
    """Return the pages of the catalogue."""
    kinds = {f"plugins/{kind}.rst": _kind(kind) for kind in KINDS}
    return {"plugins/index.rst": _overview(), **kinds, "pipeline.rst": _pipeline(), "presets.rst": _presets()}


def plugins(kind: str) -> list[Entry]:
    """Return the usable plugins of a kind, ours first."""
    return [entry for entry in installed().entries if entry.kind == kind and entry.cls]


def words(kind: str) -> str:
    """Return what a kind of plugin is called: ``forward model``."""
    return kind.replace("_", " ")


def _overview() -> str:
    rows = [(f":doc:`{kind}`", ", ".join(_link(entry) for entry in plugins(kind))) for kind in KINDS]
    text = "Every plugin, as ``oatkit describe NAME`` describes it: what it does, where it comes from, its parameters."
    return "\n".join([heading("Plugins"), text, "", table(("kind", "plugins"), rows), contents(*KINDS)])


def _link(entry: Entry) -> str:
    return f":ref:`{entry.name} <plugin-{entry.kind}-{entry.full_name}>`"


def _kind(kind: str) -> str:
    base = KINDS[kind]
    parts = [heading(words(kind).capitalize() + "s"), rst_of(base.__doc__ or ""), ""]
    parts += [f"One's own: :doc:`../hooks`; the base class is `oatkit.api.{base.__name__}`.", ""]
    return "\n".join([*parts, *map(_plugin, plugins(kind))])


def _plugin(entry: Entry) -> str:
    cls = entry.cls
    assert cls is not None
    parts = [f".. _plugin-{entry.kind}-{entry.full_name}:", "", heading(entry.name, "-"), _about(cls, entry), ""]
    return "\n".join([*parts, rst_of(cls.__doc__ or ""), "", _parameters(cls)])


def _about(cls: type[Plugin], entry: Entry) -> str:
    """Return a line on where a plugin comes from and, of a regularizer, what it can do."""
    abilities = [f"`{ability.__name__}`" for ability in ABILITIES if issubclass(cls, ability)]
    of = f" It is {' and '.join(abilities)}." if abilities else ""
    return f"From the package ``{entry.distribution}``.{of}"


def _parameters(cls: type[Parameters]) -> str:
    rows = [
        (f"``{row.name}``", f"``{row.default}``", row.unit, escaped(row.takes), escaped(row.meaning))
        for row in parameter_rows(cls)
    ]
    head = ("parameter", "default", "unit", "takes", "meaning")
    return table(head, rows, "16 14 8 26 36") if rows else "It has no parameters.\n"


def _pipeline() -> str:
    """Return the page on the pipeline file: its keys, and those of each table that is no plugin."""
    parts = [heading("Pipeline file"), rst_of(Pipeline.__doc__ or ""), "", _steps()]
    for name, cls in pipeline_tables().items():
        parts += [f".. _table-{name}:", "", heading(f"[{name}]", "-"), rst_of(cls.__doc__ or ""), "", _parameters(cls)]
    return "\n".join(parts)


def _steps() -> str:
    rows = []
    for name, field in Pipeline.model_fields.items():
        cls = part_of(field)
        takes = f":doc:`plugins/{cls.kind}`" if cls and cls.kind else f":ref:`table-{name}`" if cls else "a number"
        rows.append((f"``{name}``", takes, escaped(field.description or "")))
    return table(("key", "takes", "what it says"), rows)


def _presets() -> str:
    text = "Pipelines that ship with oatkit. ``oatkit pipeline NAME`` prints one, to be saved, changed and run."
    parts = [heading("Presets"), text, ""]
    for name, toml in presets().items():
        parts += [f".. _preset-{name}:", "", heading(name, "-"), literal(toml, "toml")]
    return "\n".join(parts)
