"""The reference, generated: a page's name and its text for all that the code declares."""

from pathlib import Path
from typing import Any

from oatkit_docs import catalogue, commands, hooks, public
from oatkit_docs.links import relinked

ROOT = Path(__file__).parents[3]


def pages() -> dict[str, str]:
    """Return every page of the reference by the name of its file."""
    return {
        **public.pages(),
        **catalogue.pages(),
        **hooks.pages(),
        **commands.pages(),
        **{f"{name}.md": _copied(f"{source}.md") for name, source in COPIED.items()},
    }


COPIED = {"changes": "CHANGELOG", "security": "SECURITY"}
"""Pages that lie at the top of the repository, where people look for them."""


def _copied(source: str) -> str:
    return relinked((ROOT / source).read_text(encoding="utf-8"), source, f"docs/reference/{source}")


def _write(app: Any) -> None:
    """Write what has changed, so that Sphinx reads no more than that."""
    folder = Path(app.srcdir) / "reference"
    for name, text in pages().items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Any) -> None:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", _write)
