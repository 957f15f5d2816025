"""The page for users about the science."""

import doctest
from pathlib import Path


def test_the_examples_on_the_science_page_hold():
    """Every number that docs/science.md shows is what its command prints."""
    page = Path(__file__).parents[1] / "docs" / "science.md"
    result = doctest.testfile(str(page), module_relative=False)
    assert result.failed == 0
    assert result.attempted >= 5
