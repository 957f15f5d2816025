"""What Sphinx needs to make the documentation of oatkit: the generated reference, links, and formulas.

`reference.pages` writes every page of the reference from the code itself; tests call it without Sphinx.
"""

from typing import Any


def setup(app: Any) -> dict[str, bool]:
    """Connect all parts to Sphinx."""
    from oatkit_docs import docstrings, formulas, links, names, reference  # some need docutils

    for part in (docstrings, formulas, links, names, reference):
        part.setup(app)
    return {"parallel_read_safe": True}
