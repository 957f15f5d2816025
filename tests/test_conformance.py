"""Everything installed keeps what a user relies on, and each check that says so can say otherwise."""

import subprocess
import sys

import numpy as np
import pytest

import array_files
import ipasc_files
import msot_files
import patato_files
from mutant_tables import MUTANTS
from oatkit.api import Plugin, ValidationError
from oatkit.registry import installed
from oatkit.scanfile import write_scan
from oatkit.testing import CHECKS, Violations, check_plugin, form, violations
from oatkit.testing.problems import DISC_CENTRE_MM, DISC_RADIUS_MM, disc_distance_m, disc_grid
from oatkit.testing.values import others
from toy_plugins import TOYS, Threshold, write_toy

INSTALLED = [entry for entry in installed().entries if entry.status == "ok"]
SAMPLES = {
    "array": lambda folder, scan: array_files.saved(folder),
    "ipasc": lambda folder, scan: ipasc_files.write(folder / "scan.hdf5"),
    "ithera": lambda folder, scan: msot_files.write(folder, msot_files.header()),
    "oatkit-hdf5": lambda folder, scan: write_scan(scan, folder / "scan.h5") or folder / "scan.h5",
    "patato": lambda folder, scan: patato_files.write_patato(folder / "scan.h5"),
}
"""A file for each of our readers, by its name."""


def outline(tmp_path):
    """What segmenters of a given outline must be given: the disc that the suite shows to all."""
    angle = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    corners = np.add(DISC_CENTRE_MM, DISC_RADIUS_MM * np.column_stack([np.sin(angle), np.cos(angle)]))
    np.save(tmp_path / "mask.npy", disc_distance_m(disc_grid(300)) < 0)
    return {
        "polygon": {"vertices": tuple(map(tuple, corners.tolist()))},
        "mask": {"path": tmp_path / "mask.npy"},
        "monte-carlo": {"n_photons": 30_000},  # enough, and quick
    }


@pytest.mark.parametrize("entry", INSTALLED, ids=lambda entry: f"{entry.kind}-{entry.full_name}")
def test_every_installed_plugin_keeps_its_promises(entry, tmp_path, small_scan):
    """A plugin that is installed, whoever's it is, passes the conformance suite."""
    given = outline(tmp_path).get(entry.name, {}) if entry.kind == "segmenter" else {}
    sample = SAMPLES[entry.name](tmp_path, small_scan) if entry.name in SAMPLES and entry.kind == "reader" else None
    check_plugin(entry.cls, sample, **given)


def choices():
    """Plugins of ours with one word or switch other than by default, but solvers, which take longest."""
    for entry in INSTALLED:
        if entry.distribution == "oatkit" and entry.kind not in ("solver", "segmenter"):
            for name, field in entry.cls.model_fields.items():
                yield from (entry.cls(**{name: other}) for other in others(field) if isinstance(other, bool | str))


@pytest.mark.parametrize("plugin", list(choices()), ids=lambda plugin: str(plugin.model_dump())[:100])
def test_promises_hold_for_other_choices(plugin):
    """A word or a switch that a user may choose in place of the default keeps the promises, too."""
    check_plugin(plugin)


def test_every_reader_of_ours_has_a_sample():
    """No reader that ships with oatkit is let off with its form alone."""
    assert {e.name for e in INSTALLED if e.kind == "reader" and e.distribution == "oatkit"} == set(SAMPLES)


@pytest.mark.parametrize("toy", TOYS, ids=lambda toy: toy.name)
def test_the_smallest_right_plugin_passes(toy, tmp_path):
    """A plugin of a few lines that does what its kind promises has nothing to change, whatever its method is."""
    check_plugin(toy, write_toy(tmp_path / "sample.toy"))


CASES = [(kind, check, mutant) for kind, mutants in MUTANTS.items() for check, mutant in mutants.items()]


@pytest.mark.parametrize(("kind", "check", "mutant"), CASES, ids=[f"{kind}-{check}" for kind, check, _ in CASES])
def test_each_fault_is_found_by_its_check(kind, check, mutant, tmp_path):
    """A plugin that is wrong in one way is found to be so, by the check that promises it."""
    found = violations(mutant, write_toy(tmp_path / "sample.toy"))
    name = check.split(" (")[0]
    told = [sentence for sentence in found if sentence.startswith(f"{name}: ")]
    assert told, found
    assert not any(sentence.startswith(f"{name}: it raised") for sentence in told)


def test_each_check_has_a_fault_to_find():
    """No check is there that no wrong plugin of the tests fails."""
    checks = {("form", check.__name__) for check in (*form.CHECKS_OF_CLASS, *form.CHECKS)}
    checks |= {(kind, check.__name__) for kind, found in CHECKS.items() for check in found}
    assert {(kind, check.split(" (")[0]) for kind, check, _ in CASES} == checks


def test_all_violations_are_told_together():
    """`check_plugin` raises one AssertionError whose text lists every broken promise."""
    with pytest.raises(Violations) as caught:
        check_plugin(MUTANTS["form"]["parameters"])
    assert isinstance(caught.value, AssertionError)
    assert len(caught.value.sentences) > 3
    assert all(f"- {sentence}" in str(caught.value) for sentence in caught.value.sentences)


def test_what_must_be_given_is_asked_for():
    """A plugin that cannot work with its defaults is not waved through: the parameter that it needs is named."""
    (polygon,) = (entry.cls for entry in INSTALLED if entry.name == "polygon")
    assert any("vertices has no value" in sentence for sentence in violations(polygon))


def test_an_instance_is_checked_as_it_is():
    """A plugin with parameters of one's own is checked with these, as a class with keywords is."""
    assert violations(Threshold(share=0.4)) == []
    assert any(sentence.startswith("disc") for sentence in violations(Threshold(share=0.01)))
    assert violations(Threshold(share=0.01)) == violations(Threshold, share=0.01)


@pytest.mark.parametrize("thing", [7, int, "lsqr", Plugin])
def test_what_is_no_plugin_is_refused(thing):
    """Handed something else than a plugin of a kind, the suite says what it expected, and does not call that wrong."""
    with pytest.raises(ValidationError, match="no plugin"):
        check_plugin(thing)


def test_the_suite_needs_no_pytest():
    """`oatkit.testing` can be imported where pytest is not installed."""
    code = "import sys; sys.modules['pytest'] = None; import oatkit.testing"
    subprocess.run([sys.executable, "-c", code], check=True)
