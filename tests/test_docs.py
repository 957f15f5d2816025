"""The documentation and the code say the same: the reference lists all that there is, and pages name nothing else."""

import dataclasses
import inspect
import re
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

import oatkit
from doc_pages import ROOT, blocks, commands, imports, inline, pages, text_of
from oatkit import api, hookspecs
from oatkit.api import KINDS
from oatkit.cli.app import EXIT_CODES
from oatkit.describe import parameter_rows, pipeline_tables
from oatkit.parameters import part_of
from oatkit.pipeline import Pipeline, presets
from oatkit.registry import installed
from oatkit_docs import catalogue, reference
from oatkit_docs import commands as command_line
from oatkit_docs import hooks as manual
from oatkit_docs.links import contents_of, relinked
from oatkit_docs.public import MODULES, homes, names

PAGES = pages()
REFERENCE = reference.pages()
PLANNED = {"my-sirt"}
"""Plugins that a tutorial makes."""


# The generated reference ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_each_hook_shows_an_example_that_works(kind):
    """The page on hooks has each of them, with an example that declares a usable class of its kind."""
    hook = f"oatkit_{kind}s"
    assert hook in dir(hookspecs)
    summary, code = manual.halves(hook)
    page = REFERENCE["hooks.rst"]
    assert summary in page
    assert f"   {code.splitlines()[0]}\n" in page
    known = {name: getattr(api, name) for name in api.__all__} | {"np": np, "replace": dataclasses.replace}
    made = dict(known)
    exec(code, made)
    (cls,) = [value for name, value in made.items() if name not in known and inspect.isclass(value)]
    assert issubclass(cls, KINDS[kind])
    assert cls().name == cls.name != ""


@pytest.mark.parametrize("kind", KINDS)
def test_the_reference_has_each_plugin_with_its_parameters(kind):
    """Every plugin that is installed has a section with its name, what it does and each of its parameters."""
    page = REFERENCE[f"plugins/{kind}.rst"]
    entries = catalogue.plugins(kind)
    assert {e.full_name for e in entries} == {e.full_name for e in installed().entries if e.kind == kind and e.cls}
    sections = page.split(".. _plugin-")[1:]
    assert len(sections) == len(entries) > 0
    for entry, section in zip(entries, sections, strict=True):
        rows = parameter_rows(entry.cls)
        assert f"\n{entry.name}\n" in section
        assert inspect.getdoc(entry.cls).split()[0] in section.replace("\\", "")
        assert re.findall(r"^   \* - ``(\w+)``$", section, re.MULTILINE) == [row.name for row in rows]
        assert all(row.meaning.split("`")[0].split("|")[0].split("*")[0] in section for row in rows)


def test_the_reference_has_the_pipeline_file():
    """Every key of a pipeline file, and every parameter of its tables that are no plugins, has a row."""
    page = REFERENCE["pipeline.rst"]
    rows = re.findall(r"^   \* - ``(\w+)``$", page, re.MULTILINE)
    tables = [row.name for _, cls in pipeline_tables().items() for row in parameter_rows(cls)]
    assert rows == [*Pipeline.model_fields, *tables]
    assert len(tables) > 10


def test_the_reference_has_each_preset():
    """Every preset is shown, line by line."""
    page = REFERENCE["presets.rst"]
    for name, text in presets().items():
        assert f"\n{name}\n{'-' * len(name)}\n" in page
        assert all(f"   {line}\n" in page for line in text.splitlines() if line)


def test_the_reference_has_each_command_and_option():
    """Every command has a section, with every argument and option that it takes."""
    sections = REFERENCE["cli.rst"].split(".. _command-")[1:]
    assert [section.split(":")[0] for section in sections] == list(command_line.commands())
    for name, section in zip(command_line.commands(), sections, strict=True):
        shown = re.findall(r"^\.\. option:: (.*)$", section, re.MULTILINE)
        for option in options(name) - {"--help"}:
            assert any(option in re.split(r"[ ,]+", line) for line in shown), option


def test_the_reference_has_each_public_name():
    """Every name that a public module offers is described once."""
    described = re.findall(
        r"^\.\. (?:auto\w+|py:data):: (oatkit\S*\.\w+)$",
        "\n".join(text for name, text in REFERENCE.items() if name.startswith("api/")),
        re.MULTILINE,
    )
    once = [name for name in described if name not in MODULES]
    assert sorted(once) == sorted(f"{module}.{name}" for name, module in homes().items())
    assert {name for module in MODULES for name in names(module)} == set(homes())
    assert set(oatkit.__all__) | set(api.__all__) <= set(homes())


def test_one_name_means_one_thing():
    """A name that several public modules offer is the same object in all of them."""
    modules = {module: __import__(module, fromlist=["_"]) for module in MODULES}
    for module in MODULES:
        for name in names(module):
            assert getattr(modules[module], name) is getattr(modules[homes()[name]], name)


def test_the_reference_has_each_exit_code():
    """Each exception stands beside its exit code."""
    for kind, code in EXIT_CODES.items():
        assert f"   * - `oatkit.{kind.__name__}`\n     - ``{code}``\n" in REFERENCE["errors.rst"]


# What pages name ------------------------------------------------------------------------------------------------------


def options(command: str) -> set[str]:
    """All options of a command."""
    made = command_line.commands()[command]
    parameters = made.get_params(made.context_class(made, info_name=command))
    return {option for p in parameters if p.param_type_name == "option" for option in (*p.opts, *p.secondary_opts)}


def plugin_names(kind: str) -> set[str]:
    """The names of all plugins of a kind, and of those that a tutorial makes."""
    return {name for e in catalogue.plugins(kind) for name in (e.name, e.full_name)} | PLANNED


def keys_of(kind: str) -> set[str]:
    """The parameters of all plugins of a kind."""
    return {"use"} | {row.name for e in catalogue.plugins(kind) for row in parameter_rows(e.cls)}


def check_key(path: str, value: str = "") -> None:
    """Fail where ``slot.key`` is no key of a pipeline file, or ``slot.use=value`` names no plugin."""
    slot, *keys = path.split(".")
    assert slot in Pipeline.model_fields, f"no slot '{slot}'"
    cls = part_of(Pipeline.model_fields[slot])
    assert cls is not None
    kind = cls.kind
    if slot == "preprocess":
        assert keys[0] in plugin_names(kind), f"no preprocessor '{keys[0]}'"
        keys = keys[1:]
    if len(keys) > 1:
        assert keys[0] == "regularizer", path
        kind, keys = keys[0], keys[1:]
    assert keys[0] in (keys_of(kind) if kind else cls.model_fields), f"no key '{path}'"
    if keys[0] == "use" and value:
        assert value in plugin_names(kind), f"no {kind} '{value}'"


def placeholder(word: str) -> bool:
    """Whether a word stands for what the user fills in."""
    return word.isupper() or "..." in word or word.startswith(("$", "<", "{"))


def check_command(words: list[str]) -> None:
    """Fail where a call of ``oatkit`` names a command, option, preset or plugin that does not exist."""
    if not words or words[0].startswith("-") or placeholder(words[0]):
        return
    name, *rest = words
    assert name in command_line.commands(), f"no command '{name}'"
    given = [word.split("=")[0] for word in rest if re.match(r"--?[a-z]", word)]
    assert set(given) <= options(name), f"oatkit {name} has no {set(given) - options(name)}"
    for option, value in pairwise(rest):
        if option == "--set" and not placeholder(value):
            check_key(*value.split("=", 1))
        if option in ("--kind", "-k"):
            assert placeholder(value) or value.replace("-", "_") in KINDS
    first = rest[0] if rest and not rest[0].startswith("-") else "PLACEHOLDER"
    if not placeholder(first):
        if name in ("run", "pipeline") and not first.endswith(".toml"):
            assert first in presets(), f"no preset '{first}'"
        if name == "describe":
            assert first in {e.name for e in installed().entries} | PLANNED, f"no plugin '{first}'"


@pytest.mark.parametrize("page", PAGES)
def test_commands_exist(page):
    """Each command that a page shows exists, with its options, the keys that it sets, its presets and plugins."""
    for words in commands(page):
        check_command(words)


@pytest.mark.parametrize("page", PAGES)
def test_keys_and_names_exist(page):
    """Keys of pipelines, names of presets and plugins in a page's code, and in the first column of tables, exist."""
    for code in inline(page):
        if match := re.fullmatch(r"([a-z]+(?:\.[\w-]+)+) ?= ?\"?([^\"]*)\"?", code):
            check_key(*match.groups())
    code = "\n".join([block.text for block in blocks(page)] + inline(page))
    for kind, name in re.findall(r"""\bplugin\(["'](\w+)["'], ["']([\w:-]+)["']\)""", code):
        assert name in plugin_names(kind), f"no {kind} '{name}'"
    for name in re.findall(r"""Pipeline\.load\(["']([\w-]+)["']""", code):
        assert name in presets(), f"no preset '{name}'"
    for kind, name in first_column(page):
        assert name in (presets() if kind == "preset" else plugin_names(kind)), f"no {kind} '{name}'"


def first_column(page: str):
    """The names in backticks below a table's head that is a kind of plugin, or "preset"."""
    for head, rows in re.findall(r"^\| ([a-z ]+?)s? \|.*\n\|[-| :]+\n((?:\|.*\n)+)", text_of(page), re.MULTILINE):
        kind = head.replace(" ", "_")
        if kind in {*KINDS, "preset"}:
            for cell in re.findall(r"^\| ([^|]*) \|", rows, re.MULTILINE):
                yield from ((kind, name) for name in re.findall(r"`([\w-]+)`", cell))


def scripts() -> dict[str, str]:
    """All that imports oatkit as users do: pages, the gallery, and the packages in plugins/."""
    shown = {page: "\n".join(b.text for b in blocks(page) if b.language == "python") for page in PAGES}
    files = [*(ROOT / "docs" / "gallery").glob("*.py"), *ROOT.glob("plugins/*/src/**/*.py")]
    return shown | {str(path.relative_to(ROOT)): path.read_text() for path in files}


@pytest.mark.parametrize("source", scripts())
def test_what_is_imported_is_public(source):
    """Pages, the gallery and our own packages of plugins import what the reference describes, and nothing else."""
    for module, name in imports(scripts()[source]):
        if f"{module}.{name}" not in MODULES:
            assert module in MODULES, f"{module} is not public"
            assert not name or name in names(module), f"{module}.{name} is not public"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("rum maxent SCAN", "no command 'rum'"),
        ("run maxent SCAN --out o.zarr", "has no {'--out'}"),
        ("run maxnet SCAN -o o.zarr", "no preset 'maxnet'"),
        ("run maxent SCAN --set reconstruct.wieght=1", "no key 'reconstruct.wieght'"),
        ("run maxent SCAN --set reconstruct.use=lsqrt", "no solver 'lsqrt'"),
        ("run maxent SCAN --set grid.pixel=3", "no key 'grid.pixel'"),
        ("run maxent SCAN --set preprocess.bandpass.low=1", "no preprocessor 'bandpass'"),
        ("describe maxent", "no plugin 'maxent'"),
    ],
)
def test_a_slip_in_a_command_is_found(wrong, said):
    """A command, option, preset, key or plugin that does not exist is found on a page."""
    with pytest.raises(AssertionError, match=re.escape(said)):
        check_command(wrong.split())


# How it is built ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", [page for page in PAGES if page.startswith("docs/")])
def test_every_page_can_be_found(page):
    """Each page stands in the list of the index of its folder, and each folder in that of the first page."""
    folder, _, name = page.rpartition("/")
    index = f"{folder}/index.md" if name != "index.md" else "docs/index.md"
    listed = contents_of(relinked(text_of(index), index, index))
    path = page.removesuffix(".md").removeprefix(index.removesuffix("index.md"))
    assert page == index or path in listed


def test_links_are_followed_to_where_they_lead():
    """Links within docs/ stay, what has moved is found, and the rest leads into the repository or is plain text."""
    text = "[a](../physics/limits.md#b) [c](../../SECURITY.md) [d](../gallery) [e](../../src/x.py) [f](https://g)"
    inner = "[a](../physics/limits.md#b) [c](../reference/security.md) [d](../auto_gallery/index.rst)"
    assert relinked(text, "docs/guides/p.md", "docs/guides/p.md") == f"{inner} e [f](https://g)"
    there = relinked(text, "docs/guides/p.md", "docs/guides/p.md", "https://host/repo")
    assert there == f"{inner} [e](https://host/repo/src/x.py) [f](https://g)"
    assert relinked("[a](docs/speed.md)", "CHANGELOG.md", "docs/reference/changes.md") == "[a](../speed.md)"


@pytest.mark.slow
def test_the_documentation_builds_without_a_warning(tmp_path):
    """Sphinx makes every page, without the pictures of the gallery, and has nothing to complain about."""
    pytest.importorskip("sphinx")
    arguments = ["-q", "-W", "--keep-going", "-D", "plot_gallery=0", str(ROOT / "docs"), str(tmp_path)]
    done = subprocess.run([sys.executable, "-m", "sphinx", *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "reference" / "plugins" / "solver.html").is_file()
