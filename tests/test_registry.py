"""Plugins come in through entry points; a broken one costs nobody else anything."""

import inspect
import json
import os
import subprocess
import sys

import pytest

from oatkit import ValidationError, plugin
from oatkit.api import KINDS
from oatkit.registry import installed
from packages import install, run_oatkit
from toy_plugins import Landweber

GOOD = '''
from oatkit.api import Iterate, Solver, hookimpl, param

class Landweber(Solver):
    """Landweber's iteration."""

    name = "{name}"
    n_iterations: int = param(5, "number of steps", at_least=1)

    def iterate(self, problem):
        x = 0 * problem.back_projected
        for i in range(self.n_iterations):
            x = x - problem.adjoint(problem.forward(x) - problem.data) / problem.norm**2
            yield Iterate(x, i + 1, converged=i + 1 == self.n_iterations)

@hookimpl
def oatkit_solvers():
    return [Landweber]
'''

RIGHT = f"""
from typing import ClassVar
import numpy as np
from oatkit.api import Iterate, Solver, hookimpl, param

{inspect.getsource(Landweber)}

@hookimpl
def oatkit_solvers():
    return [Landweber]
"""

RUDE = """
from oatkit.api import Reader, hookimpl

class Rude(Reader):
    name = "rude"

    def can_read(self, path):
        raise RuntimeError("not today")

    def read(self, path): ...

@hookimpl
def oatkit_readers():
    return [Rude]
"""

BROKEN = {
    "import-error": ("import no_such_module_anywhere", "no_such_module_anywhere"),
    "syntax-error": ("def (", "SyntaxError"),
    "system-exit": ("import sys; sys.exit('goodbye')", "goodbye"),
    "takes-arguments": ("from oatkit.api import hookimpl\n@hookimpl\ndef oatkit_solvers(x): return []", "x"),
    "unknown-hook": ("from oatkit.api import hookimpl\n@hookimpl\ndef oatkit_solver(): return []", "oatkit_solver"),
    "hook-raises": ("from oatkit.api import hookimpl\n@hookimpl\ndef oatkit_solvers(): 1 / 0", "ZeroDivisionError"),
    "no-list": ("from oatkit.api import hookimpl\n@hookimpl\ndef oatkit_solvers(): return 7", "not iterable"),
    "no-class": ("from oatkit.api import hookimpl\n@hookimpl\ndef oatkit_solvers(): return [7]", "no Solver class"),
    "abstract": (
        "from oatkit.api import Solver, hookimpl\nclass A(Solver):\n    name = 'abstract'\n"
        "@hookimpl\ndef oatkit_solvers(): return [A]",
        "lacks the method iterate",
    ),
    "needs-arguments": (GOOD.format(name="needy").replace("param(5,", "param(...,"), "is missing"),
    "system-exit-in-hook": (
        "import sys\nfrom oatkit.api import hookimpl\n@hookimpl\ndef oatkit_solvers(): sys.exit(3)",
        "SystemExit",
    ),
    "newer-api": (
        "OATKIT_API = (2, 0)\n" + GOOD.format(name="newer"),
        "made for version 2.0 of the plugin API, this oatkit has 1.0: update oatkit",
    ),
    "older-api": ("OATKIT_API = (0, 9)", "made for version 0.9 of the plugin API, this oatkit has 1.0: update the"),
    "odd-api": ("OATKIT_API = '1.0'", "expected two whole numbers, as in (1, 0)"),
    "bad-name": (GOOD.format(name="Not A Name"), "no plugin name"),
}


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A folder with a good package, two that share a name, one that takes a built-in's, and broken ones."""
    target = tmp_path_factory.mktemp("site") / "packages"
    install(target, "oatkit-good", "OATKIT_API = (1, 0)\n" + GOOD.format(name="landweber"), "2.5")
    install(target, "oatkit-first", GOOD.format(name="twin"))
    install(target, "oatkit-second", GOOD.format(name="twin"))
    install(target, "oatkit-shadow", GOOD.format(name="lsqr"))
    install(target, "oatkit-rude", RUDE)
    for name, (module, _) in BROKEN.items():
        install(target, f"oatkit-{name}", module)
    return target


@pytest.fixture(scope="module")
def listed(packages):
    """What `oatkit plugins --json` says with those packages installed."""
    done = run_oatkit("plugins", "--json", path=packages)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_third_partys_plugin_is_listed_with_its_distribution(listed):
    """A package that is installed is a plugin that is there."""
    rows = [row for row in listed if row["name"] == "landweber"]
    expected = {"kind": "solver", "name": "landweber", "distribution": "oatkit-good", "version": "2.5"}
    assert rows == [expected | {"status": "ok", "problem": ""}]


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_plugin_is_listed_with_its_reason(listed, name):
    """Each way to be broken is listed as such, with a reason that names it, and only for that distribution."""
    rows = [row for row in listed if row["distribution"] == f"oatkit-{name}"]
    assert [row["status"] for row in rows] == ["broken"]
    assert BROKEN[name][1] in rows[0]["problem"]


def test_the_rest_works_beside_broken_plugins(listed):
    """Every built-in is fine in the company of broken packages."""
    ours = [row for row in listed if row["distribution"] == "oatkit"]
    assert {row["name"] for row in ours} == {e.name for e in installed().entries if e.distribution == "oatkit"}
    assert {row["status"] for row in ours} == {"ok"}


def test_a_shared_name_is_an_error_that_names_both(packages, listed):
    """Two plugins of one name are both listed as ambiguous; using the name is an error that names both in full."""
    twins = [row for row in listed if row["name"] == "twin"]
    assert [row["status"] for row in twins] == ["ambiguous", "ambiguous"]
    done = run_oatkit("run", "lsqr", "nowhere.msot", "-o", "x.zarr", "--set", "reconstruct.use=twin", path=packages)
    assert done.returncode == 2
    assert "oatkit-first:twin and oatkit-second:twin" in done.stderr


def test_a_full_name_is_never_ambiguous(packages):
    """`distribution:name` picks one of two twins."""
    done = run_oatkit("describe", "oatkit-second:twin", path=packages)
    assert done.returncode == 0
    assert "solver twin   (oatkit-second 1.0)" in done.stdout


def test_a_full_name_survives_writing_and_reading(packages, small_scan_file, tmp_path):
    """A pipeline that names one of two twins, or a plugin named like a built-in, is written with the full name."""
    code = (
        "import oatkit\n"
        "for name in ('oatkit-second:twin', 'oatkit-shadow:lsqr'):\n"
        "    one = oatkit.Pipeline.load('lsqr', [f'reconstruct.use={name}'])\n"
        "    again = oatkit.Pipeline.loads(one.to_toml())\n"
        "    assert again == one and type(again.reconstruct).__module__ != 'oatkit.builtin.solvers.lsqr'\n"
        "    print(again.model_dump()['reconstruct']['use'])\n"
    )
    environment = dict(os.environ, PYTHONPATH=str(packages))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert done.stdout.split() == ["oatkit-second:twin", "oatkit-shadow:lsqr"], done.stderr


def test_a_reader_that_raises_does_not_keep_others_from_reading(packages, small_scan_file):
    """With a reader installed whose `can_read` raises, other files are still read."""
    assert run_oatkit("info", str(small_scan_file), path=packages).returncode == 0
    done = run_oatkit("info", str(packages), path=packages)
    assert done.returncode == 4
    assert "reader 'rude' failed: RuntimeError" in done.stderr


def test_a_built_in_cannot_be_shadowed(packages, listed):
    """A package that takes a built-in's name is reported, and the name still means the built-in."""
    rows = {row["distribution"]: row["status"] for row in listed if (row["kind"], row["name"]) == ("solver", "lsqr")}
    assert rows == {"oatkit": "ok", "oatkit-shadow": "ambiguous"}


def test_an_unknown_plugin_is_reported_with_the_nearest_name_and_the_broken_ones(packages):
    """A misspelt name gets the nearest known one, and is told of plugins that could not be loaded."""
    done = run_oatkit(
        "run", "lsqr", "nowhere.msot", "-o", "x.zarr", "--set", "reconstruct.use=landwebber", path=packages
    )
    assert done.returncode == 2
    assert "did you mean 'landweber'?" in done.stderr
    assert "no_such_module_anywhere" in done.stderr


def test_every_kind_has_a_hook_and_a_base_class():
    """All eight kinds of plugin can be declared, with or without a built-in."""
    assert set(KINDS) == {
        "reader", "preprocessor", "forward_model", "solver", "regularizer", "segmenter", "fluence_model", "unmixer",
    }  # fmt: skip


def test_a_plugin_is_found_by_kind_and_name():
    """`oatkit.plugin` returns the class, and refuses unknown kinds and names with the nearest one."""
    assert plugin("solver", "maxent-nlcg").name == "maxent-nlcg"
    with pytest.raises(ValidationError, match="did you mean 'maxent-nlcg'"):
        plugin("solver", "maxent_nlcg")
    with pytest.raises(ValidationError, match="did you mean 'solver'"):
        plugin("solvers", "lsqr")


@pytest.mark.parametrize("chosen", ["none", "oatkit-good", " OATKIT_Good ,oatkit-second"])
def test_the_environment_says_whose_plugins_are_loaded(packages, chosen, monkeypatch):
    """With OATKIT_PLUGINS only ours and those of the named distributions are there, and the others are not imported."""
    monkeypatch.setenv("OATKIT_PLUGINS", chosen)
    done = run_oatkit("plugins", path=packages)
    named = {name.strip().lower().replace("_", "-") for name in chosen.split(",")} - {"none"}
    lines, last = done.stdout.splitlines()[:-1], done.stdout.splitlines()[-1]
    assert {line.split()[2] for line in lines} == {"oatkit"} | named
    assert last.startswith("left out by OATKIT_PLUGINS: ")
    assert ("oatkit-good" in last) == ("oatkit-good" not in named)


VIOLENT = {
    "oatkit-crash": ("import os, sys\nprint('bang', file=sys.stderr, flush=True)\nos.abort()", "killed by SIGABRT"),
    "oatkit-exit": ("import os\nos._exit(7)", "exit code 7"),
    "oatkit-hang": ("import time\ntime.sleep(600)", "stopped after 3 s"),
}


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_plugins_that_crash_or_hang_are_found_from_outside(packages, tmp_path, monkeypatch):
    """`plugins --check` names what a distribution does to a process, in the time that it is given; right ones are ok.

    It names the promises that a plugin breaks.
    With OATKIT_PLUGINS=none the program works beside them.
    """
    site = tmp_path / "packages"
    install(site, "oatkit-good", GOOD.format(name="landweber"), "2.5")
    for name, (module, _) in VIOLENT.items():
        install(site, name, module)
    monkeypatch.setenv("OATKIT_PLUGINS", ",".join(VIOLENT))
    done = run_oatkit("plugins", "--check", "all", "--seconds", "3", path=site)
    monkeypatch.delenv("OATKIT_PLUGINS")
    assert done.returncode == 2
    assert done.stderr == "oatkit: not all plugins can be used: oatkit-crash, oatkit-exit, oatkit-hang\n"
    for name, (_, words) in VIOLENT.items():
        (line,) = [line for line in done.stdout.splitlines() if name in line]
        assert words in line
    assert "bang" in done.stdout
    install(site, "oatkit-right", RIGHT)
    done = run_oatkit("plugins", "--check", "oatkit-right", path=site)
    assert (done.returncode, done.stdout) == (0, "solver         toy-landweber    oatkit-right 1.0\n")
    done = run_oatkit("plugins", "--check", "oatkit-good", path=site)
    first, *broken = done.stdout.splitlines()
    assert (done.returncode, first) == (2, "solver         landweber        oatkit-good 2.5")
    assert {"docstring", "known_answers", "honest", "products"} <= {line.split(":")[0].strip() for line in broken}
    assert done.stderr == "oatkit: not all plugins keep their promises: oatkit-good\n"
    done = run_oatkit("plugins", "--check", "oatkit-god", path=site)
    assert "did you mean 'oatkit-good'?" in done.stderr
    monkeypatch.setenv("OATKIT_PLUGINS", "none")
    assert run_oatkit("plugins", path=site).returncode == 0
