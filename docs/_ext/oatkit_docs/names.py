"""Names in backticks and in signatures become links to where the reference describes them."""

from typing import Any

from sphinx.util.nodes import make_refnode

from oatkit_docs.public import homes


def _resolve(app: Any, env: Any, node: Any, content: Any) -> Any:
    """Return a link for a public name that is written short, or by the module that it is defined in."""
    target = node.get("reftarget", "")
    name = target.rpartition(".")[2]
    if node.get("refdomain") != "py" or name not in homes() or target not in (name, *_paths(target, name)):
        return None
    full = f"{homes()[name]}.{name}"
    described = env.get_domain("py").objects.get(full)
    if described is None:
        return None
    return make_refnode(app.builder, node["refdoc"], described.docname, described.node_id, content, full)


def _paths(target: str, name: str) -> tuple[str, ...]:
    return (target,) if target.startswith("oatkit.") and target.endswith(f".{name}") else ()


def setup(app: Any) -> None:
    """Look up what Sphinx does not find by itself."""
    app.connect("missing-reference", _resolve)
