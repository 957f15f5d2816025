"""Citing: BibTeX of what a pipeline uses, from one declaration of each reference."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import oatkit
from bibtex import parse
from oatkit.api import Solver
from oatkit.citing import bibtex
from oatkit.citing.bibliography import dois, library, references
from oatkit.describe import plugin_text
from oatkit.pipeline import presets
from oatkit.registry import installed
from packages import install, run_oatkit

SOURCE = Path(oatkit.__file__).parent
ROOT = SOURCE.parents[1]
TEXTS = {path: path.read_text() for pattern in ("*.py", "*.csv") for path in sorted(SOURCE.rglob(pattern))}
PAPER = "10.1109/TBME.2019.2892842"

THIRD_PARTY = '''
from oatkit.api import Iterate, Solver, hookimpl

class Mine(Solver):
    """Mine, of [Roe2021]_ and [Doe2020]_.

    References:
        [Doe2020] Doe & Roe, Ann. Sol. 3, 14 (2020), 10.1234/as_3.14.
        [Roe2021] R. Roe, "100 % of {mine}", J. Sol.
        7, 21 (2021).
    """

    name = "mine"

    def iterate(self, problem):
        yield Iterate(problem.adjoint(problem.data), 0)

@hookimpl
def oatkit_solvers():
    return [Mine]
'''


def of(pipeline: str, *changes: str) -> dict[str, dict[str, str]]:
    """The entries that `pipeline` makes."""
    return parse(bibtex(oatkit.Pipeline.load(pipeline, changes)))


def found_dois(entries: dict[str, dict[str, str]]) -> set[str]:
    """Their DOIs."""
    return {entry["doi"] for entry in entries.values() if "doi" in entry}


@pytest.mark.parametrize("name", presets())
def test_each_preset_gives_bibtex_that_parses(name):
    """For every preset the output is BibTeX, begins with oatkit itself, and no article lacks what it is found by."""
    entries = of(name)
    assert next(iter(entries)) == "oatkit"
    assert oatkit.__version__ in entries["oatkit"]["note"]
    articles = [entry for entry in entries.values() if entry["type"] == "article"]
    assert all({"author", "title", "journal", "year", "doi"} <= set(entry) for entry in articles)


def test_the_paper_is_cited_where_its_method_is_used():
    """Maximum entropy cites the paper that it comes from; back-projection without it does not."""
    assert PAPER in found_dois(of("maxent"))
    assert PAPER not in found_dois(of("backprojection"))


def test_what_a_pipeline_uses_is_cited_and_nothing_else():
    """Spectra, tissue, water and the light fed back come and go with the steps that use them."""
    light, water, heavy_water = "10.1364/AO.45.001866", "10.1364/AO.12.000555", "10.1364/OME.2.001588"
    plain, fed_back = of("maxent-absorption"), of("maxent-absorption", "absorption.passes=5")
    assert found_dois(fed_back) - found_dois(plain) == {light}
    assert "Prahl" in plain
    own = ("optics.absorption_per_cm=0.2", "optics.reduced_scattering_per_cm=12")
    assert found_dois(plain) - found_dois(of("maxent-absorption", *own)) == {"10.1088/0031-9155/58/11/R37"}
    heavy = found_dois(of("maxent-absorption", "fluence.couplant=d2o", *own))
    assert heavy_water in heavy
    assert water not in heavy
    assert "10.1117/1.3619139" in found_dois(of("lsqr", "scan.speed_of_sound_m_s=focus"))
    melanin = of("multispectral", 'unmix.chromophores=["melanin"]', *own)
    assert "10.1088/0031-9155/58/11/R37" in found_dois(melanin)
    assert "Prahl" not in melanin


def test_what_gives_no_reference_is_named():
    """A step that says nothing of where it is from is listed in a comment, so that nobody takes it for forgotten."""
    text = bibtex(oatkit.Pipeline.load("maxent"))
    assert "% Without a reference: preprocessor channels, " in text.splitlines()[-1]


def test_each_doi_has_one_entry_and_each_entry_is_used():
    """All DOIs in the sources are in `references.bib` once, and all of that is referred to by the sources."""
    used = {doi for text in TEXTS.values() for doi in dois(text) if not doi.startswith("10.1234/")}
    known = [one.locator for one in library()]
    assert len(set(known)) == len(known)
    assert used == {locator for locator in known if locator.startswith("10.")}
    sources = "\n".join(TEXTS.values())
    assert all(one.locator in sources for one in library())
    assert len(parse((SOURCE / "citing" / "references.bib").read_text())) == len(library())


def test_a_docstring_and_the_bibliography_say_the_same():
    """Where a docstring gives key, first author and year, the entry of that DOI has the same ones."""
    entries = {entry["doi"]: (key, entry) for key, entry in parse(_bibliography()).items() if "doi" in entry}
    checked = 0
    for text in TEXTS.values():
        for key, words in re.findall(r"^[ .]*\[(\w+)\] ((?:.|\n)*?\b10\.\d{4,}/\S+)", text, re.MULTILINE):
            expected, entry = entries[dois(words)[0]]
            year = re.search(r"\((\d{4})|IEEE Trans\. Biomed\. Eng\., (\d{4})", words)
            assert key == expected
            assert year
            assert entry["year"] in year.groups()
            assert re.match(r"\D+", key)[0] in re.sub(r"\W", "", words)
            checked += 1
    assert checked > 20


def _bibliography() -> str:
    return (SOURCE / "citing" / "references.bib").read_text()


def test_a_key_in_a_plugin_is_explained_there():
    """A key such as [Beck2009]_ in the docstring of a plugin stands among its references, which `describe` prints."""
    for entry in installed().entries:
        text = inspect.getdoc(entry.cls) or ""
        keys = {one.key for one in references(text)}
        assert set(re.findall(r"\[(\w+)\]_", text)) <= keys, entry.name
        assert all(one.locator in plugin_text(entry.cls, "") for one in references(text))


def test_the_citation_file_and_the_bibliography_agree():
    """CITATION.cff names the paper as the bibliography does."""
    text = (ROOT / "CITATION.cff").read_text()
    paper = next(entry for entry in parse(_bibliography()).values() if entry.get("doi") == PAPER)
    for field in ("title", "journal", "doi"):
        assert re.search(rf"^ +{field}: {re.escape(paper[field])}$", text, re.MULTILINE)
    names = re.findall(r"family-names: (\w+)\n +given-names: (\w+)", text)
    assert " and ".join(f"{family}, {given}" for family, given in names) == paper["author"]


@pytest.mark.parametrize(
    ("text", "key", "fields"),
    [
        (
            "Cai, Candes and Shen, SIAM J. Optim. 20, 1956 (2010), 10.1137/080738970.",
            "Cai2010",
            {"author": "Cai and Candes and Shen", "journal": "SIAM J. Optim.", "volume": "20", "pages": "1956"},
        ),
        ("[W95] Wang et al., J. X. 47, 131 (1995).", "W95", {"author": "Wang and others", "year": "1995"}),
        (
            '[C] A. Able, B. Baker, "On this", J. Y. 4, 077 (2001).',
            "C",
            {"author": "A. Able and B. Baker", "title": "On this", "pages": "077"},
        ),
        (
            "[Book] A book on 5 methods & more, 1999, no article.",
            "Book",
            {"note": "[Book] A book on 5 methods \\& more, 1999, no article."},
        ),
    ],
)
def test_a_reference_of_a_docstring_becomes_an_entry_that_says_no_more(text, key, fields):
    """What an own docstring says is in the entry, field by field where it is in the usual form, and nothing else."""
    (one,) = references(f"A method.\n\nReferences:\n    {text}\n")
    (entry,) = parse(one.bibtex).values()
    assert one.key == key
    assert fields.items() <= entry.items()
    assert ("title" in entry) == ("title" in fields)


def test_references_run_over_lines_and_stand_in_sentences():
    """Entries are told apart where lines are broken, in the way of Sphinx too; a DOI in a sentence counts."""
    docstring = """After 10.1000/xyz(9). More.

    References:
        Doe and Roe, J. Long.
        Name 3, 4 (2001),
        10.1000/abc.
        Poe, J. Y 1, 2 (2003).

    .. [Noe1999] N. Noe, "A title
       of two lines", J. Z 5, 6 (1999).
    """
    found = references(docstring)
    assert [one.key for one in found] == ["Doe2001", "Poe2003", "Noe1999", "10.1000/xyz9"]
    assert found[3].locator == "10.1000/xyz(9)"


def test_a_plugin_of_somebody_else_is_cited_by_its_docstring(tmp_path):
    """`oatkit cite` prints the references of an installed plugin, and what is special to TeX is escaped."""
    path = install(tmp_path / "site", "oatkit-mine", THIRD_PARTY)
    done = run_oatkit("cite", "lsqr", "--set", "reconstruct.use=mine", path=path)
    assert done.returncode == 0, done.stderr
    entries = parse(done.stdout)
    assert list(entries) == ["oatkit", "Doe2020", "Roe2021"]
    assert entries["Doe2020"]["doi"] == "10.1234/as_3.14"
    assert entries["Doe2020"]["author"] == "Doe \\& Roe"
    assert entries["Roe2021"]["title"] == "100 \\% of \\{mine\\}"


def test_keys_that_two_papers_share_are_told_apart():
    """Two papers of one key get different keys."""

    class Twin(Solver):
        """Twins.

        References:
            [Doe2020] Doe, J. X 1, 2 (2020), 10.1000/one.
            [Doe2020] Doe, J. Y 3, 4 (2020), 10.1000/two.
        """

        def iterate(self, problem):
            """Do nothing."""
            return iter(())

    entries = parse(bibtex(oatkit.Pipeline.load("lsqr").with_solver(Twin())))
    assert (entries["Doe2020"]["doi"], entries["Doe2020b"]["doi"]) == ("10.1000/one", "10.1000/two")


def test_an_unknown_pipeline_is_one_sentence():
    """`oatkit cite` of no pipeline cites oatkit; of an unknown one it says so, with exit code 2."""
    assert list(parse(run_oatkit("cite").stdout)) == ["oatkit"]
    done = run_oatkit("cite", "maxnet")
    assert done.returncode == 2
    assert "did you mean 'maxent'?" in done.stderr


def test_the_version_is_printed_without_loading_anything_heavy():
    """`oatkit --version` prints the version alone and imports no library of numbers, files or windows but numpy."""
    assert run_oatkit("--version").stdout == f"oatkit {oatkit.__version__}\n"
    code = (
        "import sys; sys.argv = ['oatkit', '--version']\nfrom oatkit.cli import main\ntry: main()\n"
        "except SystemExit: pass\nprint([m for m in ('numba', 'zarr', 'h5py', 'skimage', 'matplotlib', 'scipy') "
        "if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
