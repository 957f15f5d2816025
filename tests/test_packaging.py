"""What is handed to others: the wheel, the source archive, their metadata, and the recipe for conda."""

import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.message import Message
from email.parser import Parser
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import oatkit

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RECIPE = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text())
CONDA_NAMES = {"matplotlib": "matplotlib-base", "dask": "dask-core"}
"""Where conda calls a package otherwise, or has a part of it that is enough."""


@pytest.fixture(scope="module")
def archives(tmp_path_factory) -> Path:
    """The folder of the wheel and the source archive, built by the backend without an index."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def wheel(archives):
    """The wheel, opened."""
    with zipfile.ZipFile(next(archives.glob("*.whl"))) as opened:
        yield opened


@pytest.fixture(scope="module")
def metadata(wheel) -> Message:
    """The metadata of the wheel."""
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return Parser().parsestr(wheel.read(name).decode())


def ours(folder: Path) -> set[str]:
    """The files below a folder, by their paths from its parent, without what Python and tools leave there."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    left_there = re.compile(r"__pycache__|\.egg-info|_cache|\.hypothesis|/_build/|auto_gallery|docs/reference|\.zarr/")
    found = {str(path.relative_to(folder.parent)) for path in paths}
    return {name for name in found if not left_there.search(name)}


def test_the_wheel_holds_every_file_of_the_package(wheel):
    """All that lies in src/oatkit is in the wheel, byte for byte, and beside it nothing but its metadata."""
    inside = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert inside == ours(ROOT / "src" / "oatkit")
    assert all(wheel.read(name) == (ROOT / "src" / name).read_bytes() for name in inside)
    expected = ("presets/maxent.toml", "spectra/icg.csv", "napari.yaml", "report/template.html.j2", "report/style.css")
    more = ("report/script.js", "scaffold/templates/solver/plugin.py.txt", "py.typed", "citing/references.bib")
    assert {f"oatkit/{name}" for name in (*expected, *more)} <= inside


def test_the_source_archive_holds_what_a_maintainer_needs(archives):
    """Package, tests, docs, plugins, benchmarks, recipe and the pages at the top are in the source archive."""
    with tarfile.open(next(archives.glob("*.tar.gz"))) as opened:
        inside = {name.partition("/")[2] for name in opened.getnames()}
    for folder in ("src", "tests", "docs", "plugins", "benchmarks", "conda"):
        assert ours(ROOT / folder) <= inside
    top = ("README.md", "CHANGELOG.md", "SECURITY.md", "CITATION.cff", "LICENSE", "pyproject.toml", "release.sh")
    assert set(top) <= inside


def test_the_wheel_says_what_it_is(wheel, metadata):
    """Name, version, licence, readme, extras, classifiers and entry points are in the metadata; addresses are not.

    There is no public address of the project yet, so none is given.
    """
    assert (metadata["Name"], metadata["Version"]) == ("oatkit", oatkit.__version__)
    assert (metadata["License-Expression"], metadata["License-File"]) == ("MIT", "LICENSE")
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert metadata.get_payload().strip() == (ROOT / "README.md").read_text().strip()
    assert {"Framework :: napari", "Typing :: Typed"} <= set(metadata.get_all("Classifier"))
    assert set(metadata.get_all("Provides-Extra")) == set(PROJECT["optional-dependencies"])
    assert metadata.get_all("Project-URL") is None
    (points,) = (name for name in wheel.namelist() if name.endswith("entry_points.txt"))
    text = wheel.read(points).decode()
    for section in ("[console_scripts]", "[oatkit]", "[napari.manifest]"):
        assert section in text


def test_one_version_everywhere():
    """Project, package, citation file and conda recipe are of the same version."""
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited
    assert len({PROJECT["version"], oatkit.__version__, cited[1], RECIPE["context"]["version"]}) == 1


def as_conda(texts: list[str]) -> set[str]:
    """Requirements as conda writes them."""
    found = (Requirement(text) for text in texts)
    pairs = ((CONDA_NAMES.get(one.name, one.name.lower()), str(one.specifier)) for one in found)
    return {f"{name} {','.join(sorted(bounds.split(','), reverse=True))}".strip() for name, bounds in pairs}


def test_the_conda_recipe_needs_what_the_project_needs():
    """Run dependencies equal those of pyproject.toml, and the extras' are the constraints; Python and summary agree."""
    run = set(RECIPE["requirements"]["run"])
    extras = PROJECT["optional-dependencies"]
    assert run - {"python >=${{ python_min }}"} == as_conda(PROJECT["dependencies"])
    optional = [text for name in ("report", "wavelet", "gui", "scale") for text in extras[name]]
    assert set(RECIPE["requirements"]["run_constraints"]) == as_conda(optional)
    assert f">={RECIPE['context']['python_min']}" == PROJECT["requires-python"]
    assert RECIPE["about"]["summary"] == PROJECT["description"]
    assert RECIPE["about"]["license"] == PROJECT["license"]
    (point,) = RECIPE["build"]["python"]["entry_points"]
    assert dict([point.split(" = ")]) == PROJECT["scripts"]
