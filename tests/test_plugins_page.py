"""The tutorial on plugins, done step by step as it is written."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import oatkit
from oatkit.api import API_VERSION, KINDS, Geometry
from oatkit.scanfile import write_scan
from oatkit.simulate import arc_detectors, disc, simulate_scan

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "tutorials" / "plugin.md").read_text()
PACKAGE = "oatkit-my-sirt"
SIRT = ROOT / "plugins" / "oatkit-sirt"
BLOCKS = re.findall(r"```(sh|python|toml|text)\n(.*?)```", PAGE, re.DOTALL)
SHELL = """#!/bin/sh
case "$*" in
    "-m pip install -e "*) folder=./${{5%[[]test]}}
        exec {python} -m pip install -q --no-index --no-deps --no-build-isolation --target "$SITE" "$folder" ;;
    *) exec {python} "$@" ;;
esac
"""
"""Python, which installs what is to be installed into the folder $SITE, without an index."""


def blocks(language):
    """The blocks of a language, in their order."""
    return [text for kind, text in BLOCKS if kind == language]


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """A folder to work in with a scan, and a function that runs commands there and returns what they print."""
    work = tmp_path_factory.mktemp("tutorial")
    geometry = Geometry(arc_detectors(48, 0.04, 270), 20e6, 400, start_time_s=17e-6)
    arc = oatkit.plugin("forward_model", "arc")()
    scan = simulate_scan(disc, arc, geometry=geometry, field_of_view_m=25e-3, pixels=91, snr_db=20.0)
    write_scan(scan, work / "scan.h5")
    programs = work / "bin"
    programs.mkdir()
    (programs / "python").write_text(SHELL.format(python=sys.executable))
    (programs / "oatkit").write_text(
        f'#!/bin/sh\nexec {sys.executable} -c "from oatkit.cli import main; main()" "$@"\n'
    )
    for program in programs.iterdir():
        program.chmod(0o755)
    environment = dict(
        os.environ,
        PATH=f"{programs}{os.pathsep}{os.environ['PATH']}",
        SITE=str(work / "site"),
        # The source before the installed copy: as if it had been installed to be worked on.
        PYTHONPATH=os.pathsep.join([str(work / PACKAGE / "src"), str(work / "site")]),
    )

    def run(commands):
        done = subprocess.run(["sh", "-e"], input=commands, cwd=work, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run.folder = work
    return run


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")
def test_the_tutorial_works_as_it_is_written(shell):
    """Every command and program of the page runs, in its order, and the files and lines that it shows are there."""
    first, test, use, trouble = blocks("sh")
    method, tests, script = blocks("python")
    tree, listed = blocks("text")
    folder = shell.folder / PACKAGE
    assert listed in shell(first)
    written = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert {line.split()[0] for line in tree.splitlines()[1:]} == {path for path in written if "cache" not in path}
    (folder / "src" / "oatkit_my_sirt" / "plugin.py").write_text(method)
    (folder / "tests" / "test_oatkit_my_sirt.py").write_text(tests)
    assert re.search(r"^.*2 passed", shell(test), re.MULTILINE)
    printed = shell(use)
    assert "takes a whole number at least 1" in printed
    assert oatkit.load(shell.folder / "sirt.zarr")["initial_pressure"].values.min() >= 0
    assert (shell.folder / "sirt.png").is_file()
    (toml,) = blocks("toml")
    (shell.folder / "pipeline.toml").write_text(toml)
    (shell.folder / "script.py").write_text(script)
    printed = shell("python script.py")
    assert "moved the image by" in printed
    assert printed.endswith("True\n")
    assert f"solver         my-sirt          {PACKAGE} 0.1.0\n" in shell(trouble)


def test_the_method_of_the_page_is_that_of_the_package():
    """The code that the page shows is that of `plugins/oatkit-sirt`, under a name of its own."""
    source = (SIRT / "src" / "oatkit_sirt" / "plugin.py").read_text()
    shown = blocks("python")[0].replace("class MySirt", "class Sirt").replace('"my-sirt"', '"sirt"')
    assert shown.replace("np\nfrom", "np\n\nfrom") == source


def test_the_package_of_the_tutorial_is_short():
    """All Python of `oatkit-sirt` is under 60 lines."""
    assert sum(len(path.read_text().splitlines()) for path in (SIRT / "src").rglob("*.py")) < 60


def test_the_page_knows_all_kinds_and_the_version():
    """The table has a row for each kind of plugin, and the version is today's."""
    assert re.findall(r"^\| `([a-z-]+)` \|", PAGE, re.MULTILINE) == [kind.replace("_", "-") for kind in KINDS]
    assert f"OATKIT_API = {API_VERSION}" in PAGE
