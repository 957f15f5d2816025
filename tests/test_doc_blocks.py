"""Each block of code on a page runs, in the order of the page, on small scans and with small grids."""

import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from skimage.io import imsave
from typer.testing import CliRunner

import oatkit
from doc_pages import ROOT, blocks, lines_of, pages
from moving_scans import at_rest, noisy_scan
from oatkit.cli import app
from oatkit.pipeline import Pipeline, preset
from oatkit.regions import load_regions
from oatkit.scanfile import write_scan
from tiny import PIXELS, new, shrunk

ELSEWHERE = {
    "docs/tutorials/plugin.md": "tests/test_plugins_page.py",
    "docs/guides/formats.md": "tests/test_reader_arrays.py",
}
"""Pages whose blocks have a test of their own."""

NOT_HERE = {
    r"python benchmarks/": "takes minutes, and measures a machine that does nothing else",
    r"pip install|venv|apt-get|git clone|conda |twine": "installs, which tests/run.sh and the release do",
    r"^sh (tests/run|docs/build|release|tests/lowest)\.sh": "runs these tests, or takes minutes",
    r"oatkit gui|^napari": "opens a window, see tests/test_gui_*.py",
    r"tcp://head": "needs a cluster; a cluster of one machine is tried",
    r"^oatkit join part-\*\.zarr .*# once all are done": "one job of eight has run; another page joins all of them",
    r"fluence.use=monte-carlo": "takes minutes, see plugins/oatkit-montecarlo/tests",
}
"""Lines of shell that do not run in a test, and why."""

STAND_INS = {"Scan_9.msot": "Scan_9.h5", "SCAN": "any.h5"}
"""Other names for scans, since ours are files of oatkit's own format."""

FRAMES = {"0:20": "0:1", "0:10": "0:1", "40:60": "1:3"}
"""Frames of long scans, and those of ours in their place."""

REGIONS = """
version = 1
[[region]]
name = "muscle"
shape = "rectangle"
centre_yx_mm = [0, 0]
half_axes_yx_mm = [2, 2]
"""

PLAIN = r"oatkit [^|<>&;$`#]*(#.*)?"
"""A command that needs no shell."""

PROGRAMS = {"oatkit": "-m tiny", "python": "", "python3": ""}


@pytest.fixture(scope="module")
def stock(tmp_path_factory):
    """A folder with what pages take for granted: a scan, a result, files of regions."""
    folder = tmp_path_factory.mktemp("stock")
    write_scan(noisy_scan(at_rest(3)[:, :3], 30.0, seed=0, name="any"), folder / "scan.h5")
    (folder / "regions.toml").write_text(REGIONS)
    for name in ("mask.tif", "mask.png"):
        imsave(folder / name, np.pad(np.full((20, 20), 255, np.uint8), (PIXELS - 20) // 2), check_contrast=False)
    pipeline = oatkit.Pipeline.load("lsqr", [f"grid.pixels={PIXELS}"])
    oatkit.run_frames(pipeline, noisy_scan(at_rest(4), 30.0, seed=0), folder / "out.zarr")
    return folder


@pytest.fixture
def work(tmp_path, monkeypatch, stock):
    """An empty folder to work in, where grids are small."""
    monkeypatch.setattr(Pipeline, "of_table", shrunk(Pipeline.of_table))
    monkeypatch.setenv("MPLBACKEND", "agg")
    folder = tmp_path / "page"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def test_every_line_that_is_left_out_is_somewhere():
    """Each reason to leave a line out has a page that needs it, and each page with a test of its own has that test."""
    shell = [
        line for page in pages() for block in blocks(page) if block.language == "sh" for line in lines_of(block.text)
    ]
    assert [pattern for pattern in NOT_HERE if not any(re.search(pattern, line) for line in shell)] == []
    for page, test in ELSEWHERE.items():
        assert Path(page).name in (ROOT / test).read_text()


SHOWING = [
    page for page in pages() if page not in ELSEWHERE and {b.language for b in blocks(page)} & {"python", "sh", "toml"}
]


# Vessels of the demo hold no pixel of a small grid.
@pytest.mark.filterwarnings("ignore:Mean of empty slice", "ignore:invalid value encountered in")
@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")
@pytest.mark.parametrize("page", SHOWING)
def test_blocks_run(page, work, stock):
    """Python, shell and TOML of a page do what they are shown to do, one after another in one folder."""
    shown = blocks(page)
    provide(work, stock, "\n".join(block.text for block in shown))
    named: dict = {"__name__": "page"}
    for block in [block for block in shown if block.language == "toml"][::-1]:
        keep(block, "toml")  # a page may show a file below the command that reads it
    for block in shown:
        text = with_stand_ins(block.text)
        match block.language:
            case "toml":
                keep(block, "toml")
                check_toml(text)
            case "python" if text.startswith(">>>"):
                check_examples(text)
            case "python":
                keep(block, "py")
                exec(compile(text, page, "exec"), named)
            case "sh":
                run(text)


@pytest.mark.parametrize("page", pages())
def test_no_command_hides_in_a_block_without_a_language(page):
    """What a page shows of commands is marked as shell, so that it runs here."""
    hidden = [
        b.text for b in blocks(page) if b.language in ("", "text") and re.match(r"\$? ?(oatkit|pip|python) ", b.text)
    ]
    assert hidden == []


def provide(work: Path, stock: Path, text: str) -> None:
    """Put the files into the folder that a page names and does not make."""
    text = with_stand_ins(text)
    for name in {"scan.h5", *STAND_INS.values()}:
        if name in text and not re.search(rf"""(-o |write_scan\(.*["']){re.escape(name)}""", text):
            shutil.copy(stock / "scan.h5", work / name)
    for name in ("regions.toml", "mask.tif", "mask.png"):
        shutil.copy(stock / name, work / name)
    if "out.zarr" in text and not re.search(r'(-o |save\("|, ")$', text.partition("out.zarr")[0]):
        shutil.copytree(stock / "out.zarr", work / "out.zarr")


def with_stand_ins(text: str) -> str:
    """Return code in which the names of scans, and their frames, are those of ours."""
    for name, ours in (STAND_INS | FRAMES).items():
        text = re.sub(rf"(?<![\w$]){re.escape(name)}\b", ours, text)
    return text


def keep(block, ending: str) -> None:
    """Write a block into the file that the line above it names last, if it does."""
    names = re.findall(rf"`([\w-]+\.{ending})`", block.before.strip().split("\n\n")[-1])
    if names:
        Path(names[-1]).write_text(with_stand_ins(block.text))


def check_toml(text: str) -> None:
    """Fail where TOML is no valid pipeline, piece of one, file of regions, or description of a package."""
    table = tomllib.loads(text)
    if "project" in table:
        assert all(isinstance(value, str) for value in table["project"]["entry-points"]["oatkit"].values())
    elif "region" in table:
        Path("checked.toml").write_text(text)
        assert len(load_regions(Path("checked.toml"))) == len(table["region"])
    else:
        Pipeline.of_table(tomllib.loads(preset("maxent")) | table, folder=Path.cwd())


def check_examples(text: str) -> None:
    """Fail where an example prints something else than it shows."""
    examples = doctest.DocTestParser().get_doctest(text, {}, "page", None, None)
    assert doctest.DocTestRunner().run(examples).failed == 0


def run(script: str) -> None:
    """Run a block of shell, without the lines that cannot run here; in this process where all are commands of ours."""
    lines = lines_of(without_what_cannot_run(script))
    if all(re.fullmatch(PLAIN, line) for line in lines):
        for line in lines:
            done = CliRunner().invoke(app, new(shlex.split(line, comments=True)[1:]))
            assert done.exit_code == 0, f"{line}\n{done.output}\n{done.exception!r}"
    else:
        run_shell(without_what_cannot_run(script))


def run_shell(script: str) -> None:
    """Run a script, with programs that know small grids."""
    programs = Path.cwd().parent / "bin"
    programs.mkdir(exist_ok=True)
    for name, arguments in PROGRAMS.items():
        (programs / name).write_text(f'#!/bin/sh\nexec {sys.executable} {arguments} "$@"\n')
        (programs / name).chmod(0o755)
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT / "tests"),
    }
    done = subprocess.run(["sh", "-e"], input=script, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{script}\n{done.stdout}\n{done.stderr}"


def without_what_cannot_run(script: str) -> str:
    """Return a script without the lines that `NOT_HERE` names."""
    kept = [line for line in script.splitlines() if not any(re.search(pattern, line) for pattern in NOT_HERE)]
    return "\n".join(kept)
