"""Plugins come in through entry points; a broken one costs nobody else anything."""

import json
import os
import subprocess
import sys

import pytest

from oatkit import ValidationError, plugin
from oatkit.api import KINDS
from oatkit.registry import installed
from packages import install, run_oatkit

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
    "bad-name": (GOOD.format(name="Not A Name"), "no plugin name"),
}


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """A folder with a good package, two that share a name, one that takes a built-in's, and broken ones."""
    target = tmp_path_factory.mktemp("site") / "packages"
    install(target, "oatkit-good", GOOD.format(name="landweber"), "2.5")
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
