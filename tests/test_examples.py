"""What docs, README and docstrings show is what happens."""

import doctest
import importlib
import re
import tomllib
from pathlib import Path

import pytest

import oatkit

ROOT = Path(__file__).parents[1]
SOURCE = Path(oatkit.__file__).parent
README = (ROOT / "README.md").read_text()


def with_examples() -> list[str]:
    """The modules whose docstrings hold examples."""
    files = [path for path in SOURCE.rglob("*.py") if ">>> " in path.read_text()]
    return sorted(".".join(("oatkit", *path.relative_to(SOURCE).with_suffix("").parts)) for path in files)


@pytest.mark.parametrize("module", [name for name in with_examples() if not name.endswith("__init__")])
def test_examples_in_docstrings_hold(module):
    """Every example in a docstring prints what it says."""
    result = doctest.testmod(importlib.import_module(module))
    assert result.failed == 0
    assert result.attempted > 0


def test_metrics_have_examples():
    """Beside each formula of a metric stands an example."""
    assert doctest.testmod(oatkit.metrics).attempted >= 7


def test_the_examples_on_the_science_page_hold():
    """Every number that docs/physics/science.md shows is what its command prints."""
    result = doctest.testfile(str(ROOT / "docs" / "physics" / "science.md"), module_relative=False)
    assert result.failed == 0
    assert result.attempted >= 5


def blocks(language: str, text: str = README) -> list[str]:
    """The blocks of code in a language, of the README or of another page."""
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_the_readmes_script_runs(small_scan_file, tmp_path, monkeypatch):
    """The script of the README reconstructs and saves, with the file's name changed only."""
    script = next(block for block in blocks("python") if "oatkit.read" in block)
    monkeypatch.chdir(tmp_path)
    small = '"maxent", ["grid.pixels=32", "grid.field_of_view_mm=9"]'
    exec(script.replace('"Scan_9.msot"', repr(str(small_scan_file))).replace('"maxent"', small))
    assert oatkit.load(tmp_path / "out.zarr")["initial_pressure"].values.min() >= 0


def test_the_page_on_absorption_shows_what_runs(tmp_path):
    """Its pipeline loads with all its steps, its script runs, and each of its commands names options that exist."""
    text = (ROOT / "docs" / "physics" / "absorption.md").read_text()
    (tmp_path / "p.toml").write_text(blocks("toml", text)[0])
    pipeline = oatkit.Pipeline.load(tmp_path / "p.toml")
    assert None not in (pipeline.segment, pipeline.fluence, pipeline.absorption)
    (script,) = blocks("python", text)
    exec(script, {})
    changes = re.findall(r"--set ([^\s`]+)", text)
    assert oatkit.Pipeline.load("maxent-absorption", [c for c in changes if "segment" not in c]).absorption is not None
    assert oatkit.Pipeline.load("maxent-absorption", [c for c in changes if "segment" in c]).segment.name == "mask"


def test_the_readmes_pipeline_loads(tmp_path):
    """The pipeline file of the README is valid."""
    text = next(block for block in blocks("toml") if "reconstruct" in block)
    assert oatkit.Pipeline.loads(text).grid.pixels == 256


def test_the_readmes_solver_works():
    """The solver of the README reduces the residual of a small problem, and its entry point is valid TOML."""
    import numpy as np

    names: dict = {}
    exec(next(block for block in blocks("python") if "class Landweber" in block), names)
    problem = oatkit.api.Problem(np.diag([1.0, 0.5]), np.array([1.0, 1.0]), (1, 2))
    residuals = [np.linalg.norm(problem.forward(i.image) - problem.data) for i in names["Landweber"]().iterate(problem)]
    assert residuals[-1] < 1e-3 * np.sqrt(2) < residuals[0]
    assert names["oatkit_solvers"]() == [names["Landweber"]]
    assert "oatkit" in tomllib.loads(next(b for b in blocks("toml") if "entry-points" in b))["project"]["entry-points"]


@pytest.mark.parametrize("page", ["README.md", *(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md"))])
def test_links_lead_somewhere(page):
    """Every relative link and picture of a page is a file of the repository."""
    text = (ROOT / page).read_text()
    targets = [t for t in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in t]
    assert [t for t in targets if not ((ROOT / page).parent / t).exists()] == []
