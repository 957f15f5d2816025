"""The gallery of the documentation: each script runs by itself, and makes one picture."""

import ast
import runpy
from pathlib import Path

import matplotlib
import pytest
from matplotlib import pyplot

from oatkit import Pipeline
from tiny import shrunk

GALLERY = Path(__file__).parents[1] / "docs" / "gallery"
PIXELS = 64
SCRIPTS = sorted(GALLERY.glob("plot_*.py"))


def text_of(script: Path) -> str:
    """The text at the top of a script."""
    return ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""


def test_the_gallery_has_scripts():
    """There are at least fourteen, and no other Python file lies beside them."""
    assert len(SCRIPTS) >= 14
    assert set(GALLERY.glob("*.py")) == set(SCRIPTS)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_script_has_a_title_and_one_lesson(script):
    """Each begins with a title, underlined in full, and the one lesson that it teaches."""
    title, line, *rest = text_of(script).splitlines()
    assert line == "=" * len(title)
    assert [paragraph.startswith("**Lesson: ") for paragraph in "\n".join(rest).strip().split("\n\n")].count(True) == 1


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_script_runs_and_makes_one_picture(script, capsys, monkeypatch):
    """Each runs without a warning, opens one figure, and prints numbers; on coarse grids here, in full for the docs."""
    monkeypatch.setattr(Pipeline, "of_table", shrunk(Pipeline.of_table, PIXELS))
    matplotlib.use("agg")
    pyplot.close("all")
    try:
        runpy.run_path(str(script), run_name="__main__")
        assert len(pyplot.get_fignums()) == 1
    finally:
        pyplot.close("all")
    assert any(character.isdigit() for character in capsys.readouterr().out)
