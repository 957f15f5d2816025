"""What stands in a cell of a CSV file that we write."""

from oatkit.hostile import printable

FORMULA = ("=", "+", "-", "@")
"""What makes a spreadsheet take a text for a formula."""


def cell(value: str | float | None) -> str | float | None:
    """Return a value for a cell: a text, which may come from a file, so that no spreadsheet runs it as a formula.

    >>> cell("=1+1")
    "'=1+1"
    """
    if not isinstance(value, str):
        return value
    text = printable(value)
    return f"'{text}" if text.startswith(FORMULA) else text
