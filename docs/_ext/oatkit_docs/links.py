"""Links and navigation, from what the Markdown pages say: they are read on a plain git host, too.

The lists of links on a page named ``index.md`` are its table of contents. A link to what lies outside of the
documentation leads into the repository where `oatkit_repository` says its address, and is plain text where not.
"""

import os
import re
from pathlib import Path, PurePosixPath
from typing import Any

LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s#:]+)(#[^)\s]*)?\)")
MOVED = {
    "docs/gallery": "docs/auto_gallery/index.rst",
    "CHANGELOG.md": "docs/reference/changes.md",
    "SECURITY.md": "docs/reference/security.md",
}
"""What lies elsewhere when the documentation is built."""


def relinked(text: str, old: str, new: str, repository: str = "") -> str:
    """Return a page written for the path `old` in the repository as one for `new`, with its links followed."""

    def follow(link: re.Match[str]) -> str:
        words, target, anchor = link.groups()
        path = os.path.normpath(PurePosixPath(old).parent / target).replace(os.sep, "/")
        path = MOVED.get(path, path)
        if path.startswith("docs/"):
            return f"[{words}]({os.path.relpath(path, PurePosixPath(new).parent)}{anchor or ''})"
        return f"[{words}]({repository}/{path})" if repository else words

    return LINK.sub(follow, text)


def contents_of(text: str) -> list[str]:
    """Return the pages that a page's lists link to, as names for a table of contents."""
    items = re.findall(r"^- \[[^\]]*\]\(([^)\s#:]+\.(?:md|rst))\)", text, re.MULTILINE)
    return [str(PurePosixPath(item).with_suffix("")) for item in items]


def _read(app: Any, name: str, content: list[str]) -> None:
    """Rework a page before it is parsed."""
    source = Path(app.env.doc2path(name))
    if source.suffix != ".md":
        return
    page = f"docs/{name}.md"
    content[0] = relinked(content[0], page, page, app.config.oatkit_repository)
    entries = contents_of(content[0]) if source.name == "index.md" else []
    if entries:
        content[0] += "\n".join(["", "```{toctree}", ":hidden:", "", *entries, "```", ""])


def setup(app: Any) -> None:
    """Rework each page as it is read."""
    app.add_config_value("oatkit_repository", "", "env")
    app.connect("source-read", _read)
