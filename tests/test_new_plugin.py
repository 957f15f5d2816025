"""`oatkit new-plugin` writes packages that install, are listed, run in a pipeline and pass their tests, as they are."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import oatkit
from oatkit import ValidationError
from oatkit.api import KINDS
from oatkit.scaffold import new_plugin
from oatkit.scaffold.naming import names_of
from oatkit.scanfile import write_scan
from packages import run_oatkit

SMALL = ("--set", "grid.pixels=24", "--set", "grid.field_of_view_mm=9")
EACH_KIND = pytest.mark.parametrize("kind", KINDS)


def package_of(kind):
    """The name of the package that these tests make of a kind."""
    return f"oatkit-my-{kind.replace('_', '-')}"


def pip_install(*arguments):
    """Install without an index, and with the build tools that are here."""
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, *map(str, arguments)], check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def kit(tmp_path_factory):
    """A folder with a new package of each kind, and in its folder ``site`` all of them installed."""
    folder = tmp_path_factory.mktemp("kit")
    for kind in KINDS:
        new_plugin(package_of(kind), kind, folder)
    pip_install("--target", folder / "site", *(folder / package_of(kind) for kind in KINDS))
    return folder


@pytest.fixture(scope="module")
def scan(small_scan, tmp_path_factory):
    """The small scan at two wavelengths, in a file."""
    path = tmp_path_factory.mktemp("scan") / "two.h5"
    signals = np.repeat(small_scan.signals[:1], 2, axis=1) * np.array([1.0, 0.8])[:, None, None]
    write_scan(replace(small_scan, signals=signals, wavelengths_nm=(750.0, 850.0), valid=None), path)
    return path


def test_all_are_listed(kit):
    """Each package that is installed is a plugin that is there, of its kind and without a problem."""
    rows = json.loads(run_oatkit("plugins", "--json", path=kit / "site").stdout)
    mine = {row["kind"]: row for row in rows if row["distribution"].startswith("oatkit-my-")}
    assert mine.keys() == KINDS.keys()
    assert {row["status"] for row in mine.values()} == {"ok"}
    assert all(row["distribution"] == f"oatkit-{row['name']}" for row in mine.values())


@pytest.fixture(scope="module")
def own_tests(kit):
    """What pytest says of the tests that come with the packages, with warnings as errors."""
    environment = dict(os.environ, PYTHONPATH=str(kit / "site"))
    # napari, where it is installed, has a plugin for pytest that warns.
    strict = ["-W", "error", "-W", "ignore::pydantic.warnings.PydanticDeprecatedSince20"]
    command = [sys.executable, "-m", "pytest", "-v", *strict, "-p", "no:cacheprovider", *map(package_of, KINDS)]
    return subprocess.run(command, cwd=kit, env=environment, capture_output=True, text=True).stdout


@EACH_KIND
def test_its_own_tests_pass(own_tests, kind):
    """The tests that come with a new package pass: conformance, and one of the method."""
    outcomes = re.findall(rf"/test_oatkit_my_{kind}\.py::\S+ (\w+)", own_tests)
    assert outcomes == ["PASSED", "PASSED"], own_tests


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "reader"])
def test_the_pipeline_of_its_readme_runs(kit, kind, scan, tmp_path):
    """The pipeline in the README of a new package runs with it on a scan, and the result says so."""
    (text,) = re.findall(r"```toml\n(.*?)```", (kit / package_of(kind) / "README.md").read_text(), re.DOTALL)
    (tmp_path / "pipeline.toml").write_text(text)
    done = run_oatkit("run", "pipeline.toml", str(scan), "-o", "out.zarr", *SMALL, path=kit / "site", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = oatkit.load(tmp_path / "out.zarr")
    assert f"'my-{kind.replace('_', '-')}'" in str(result.pipeline)
    assert all(np.isfinite(image.values).all() for name, image in result.items() if name == "initial_pressure")


def test_a_file_of_a_new_reader_is_reconstructed(kit, tmp_path):
    """A new reader is found by the file, and the image of the point in its sample is brightest in the middle."""
    test = kit / package_of("reader") / "tests" / "test_oatkit_my_reader.py"
    write = f"import sys; sys.path.insert(0, {str(test.parent)!r}); from {test.stem} import write_sample; "
    write += f"from pathlib import Path; write_sample(Path({str(tmp_path / 'recording.dat')!r}))"
    environment = dict(os.environ, PYTHONPATH=str(kit / "site"))
    subprocess.run([sys.executable, "-c", write], check=True, env=environment)
    done = run_oatkit(
        "run",
        "nnls",
        "recording.dat",
        "-o",
        "out.zarr",
        *SMALL,
        "--set",
        "grid.pixels=25",
        path=kit / "site",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    image = oatkit.load(tmp_path / "out.zarr")["initial_pressure"].values[0]
    assert np.unravel_index(image.argmax(), image.shape) == (12, 12)


FORMS = """
import json, sys
from qtpy.QtWidgets import QApplication
app = QApplication([])
from oatkit.api import KINDS
from oatkit.gui.parts.forms import Form
from oatkit.gui.parts.plugin_chooser import PluginChooser
from oatkit.registry import plugin
found = {}
for kind, base in KINDS.items():
    name = "my-" + kind.replace("_", "-")
    chooser = PluginChooser(base)
    index = chooser.findData(name)
    usable = index >= 0 and chooser.model().item(index).isEnabled()
    found[kind] = [usable, list(Form(plugin(kind, name)(), lambda key, value, part: None).inputs)]
json.dump(found, sys.stdout)
"""


@pytest.mark.skipif(not (os.environ.get("CI") or importlib.util.find_spec("napari")), reason="needs the extra gui")
def test_the_window_offers_it_with_its_form(kit):
    """Each new plugin can be chosen in the window, and its form has a field for each of its parameters."""
    environment = dict(os.environ, PYTHONPATH=str(kit / "site"), QT_QPA_PLATFORM="offscreen")
    done = subprocess.run([sys.executable, "-c", FORMS], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert all(usable for usable, _ in found.values())
    assert found["solver"][1] == ["n_iterations", "tolerance"]
    assert found["preprocessor"][1] == ["width"]


def test_it_can_be_installed_to_be_worked_on(kit, tmp_path):
    """``pip install -e`` puts the folder ``src`` of the package itself on Python's path."""
    pip_install("--prefix", tmp_path, "-e", kit / package_of("solver"))
    (path,) = tmp_path.rglob("*oatkit_my_solver*.pth")
    assert Path(path.read_text().strip()) == kit / package_of("solver") / "src"


@EACH_KIND
def test_it_is_written_as_one_would_write_it(kit, kind):
    """What is written keeps the rules of ruff, order of imports and documentation among them, and is formatted."""
    for command in (["check", "--select", "E,F,I,B,UP,SIM,RUF,C4,PT,D1"], ["format", "--check"]):
        ruff = [sys.executable, "-m", "ruff", *command, "--isolated", "--no-cache", "--line-length", "120", "."]
        done = subprocess.run(ruff, cwd=kit / package_of(kind), capture_output=True, text=True)
        assert done.returncode == 0, done.stdout


def test_the_command_says_what_to_do_next(tmp_path):
    """It writes the package into the folder that it is told, says three commands, and their paths are there."""
    done = run_oatkit("new-plugin", "oatkit-new", "--kind", "forward-model", "-o", str(tmp_path))
    first, *commands = done.stdout.splitlines()
    assert first.startswith(f"wrote {tmp_path / 'oatkit-new'}")
    assert (tmp_path / "oatkit-new" / first.split(" is in ")[1].split(".py")[0]).with_suffix(".py").is_file()
    assert [line.strip() for line in commands] == [
        f"python -m pip install -e '{tmp_path / 'oatkit-new'}[test]'",
        f"python -m pytest {tmp_path / 'oatkit-new'}",
        "oatkit plugins",
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["oatkit-new"]


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("Oatkit-X", "solver", "small letters, digits and single hyphens"),
        ("oatkit--x", "solver", "small letters"),
        ("oatkit_x", "solver", "small letters"),
        ("../x", "solver", "small letters"),
        ("-x", "solver", "small letters"),
        ("1x", "solver", "a letter first"),
        ("", "solver", "small letters"),
        ("x\n", "solver", "small letters"),
        ("numpy", "solver", "'import numpy' means something else here"),
        ("class", "solver", "'import class' means something else"),
        ("oatkit", "solver", "'import oatkit' means something else"),
        ("oatkit-lsqr", "solver", "oatkit has a solver named 'lsqr'"),
        ("oatkit-x", "solvr", "did you mean 'solver'"),
        ("oatkit-x", "", "no plugin kind named ''"),
    ],
)
def test_names_that_cannot_be_are_refused(name, kind, words, tmp_path):
    """A name that is no package's, means something to Python or is a plugin's already is refused, with the reason."""
    with pytest.raises(ValidationError, match=re.escape(words)):
        new_plugin(name, kind, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_name_taken_by_another_kind_is_free():
    """Names are unique within a kind only: a regularizer may be called as a solver is."""
    assert names_of("oatkit-backprojection", "regularizer").plugin == "backprojection"


@pytest.mark.parametrize(
    ("package", "cls"),
    [
        ("oatkit-two-words", "TwoWords"), ("plain", "Plain"), ("oatkit-solver", "MySolver"), ("oatkit-3d", "My3d"),
        ("oatkit-none", "MyNone"), ("oatkit-class-var", "MyClassVar"), ("oatkit-oatkit-x", "OatkitX"),
    ],
)  # fmt: skip
def test_the_class_has_a_name_of_its_own(package, cls):
    """The class is called like the package, and never like what its module imports or a word of Python's."""
    assert names_of(package, "solver").cls == cls


@pytest.mark.parametrize("there", ["file", "folder", "link"])
def test_what_exists_is_not_written_over(there, tmp_path):
    """A file, a folder or a link to nowhere of the name stays as it is."""
    path = tmp_path / "oatkit-x"
    {"file": path.touch, "folder": path.mkdir, "link": lambda: path.symlink_to("nowhere")}[there]()
    with pytest.raises(ValidationError, match="exists already"):
        new_plugin("oatkit-x", "solver", tmp_path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["oatkit-x"]


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path):
    """Where the folder is missing or is a file, the sentence says so and nothing is made."""
    (tmp_path / "file").touch()
    for folder in (tmp_path / "missing", tmp_path / "file"):
        with pytest.raises(ValidationError, match="cannot be written"):
            new_plugin("oatkit-x", "solver", folder)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]
