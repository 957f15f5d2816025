"""References as BibTeX: those of `references.bib`, and those that a docstring gives."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

SECTION = re.compile(r"^[ ]*References:[ ]*\n((?:[ ]+\S.*(?:\n|\Z))+)", re.MULTILINE)
SPHINX = re.compile(r"^[ ]*\.\. (\[\w+\] .*(?:\n[ ]+\S.*)*)", re.MULTILINE)
COMPLETE = re.compile(r"(?:\(\d{4}\)|\b10\.\d{4,9}/).*\.$")
"""What has a year or a DOI and ends as a sentence does."""
CITATION = re.compile(
    r'(?:\[(?P<key>\w+)\] )?(?P<authors>\D+?), (?:"(?P<title>[^"]+)", )?(?P<journal>[A-Z][^,"]*?)'
    r"(?: (?P<volume>\d+), (?P<pages>\w+))?,? \((?P<year>\d{4})\)"
)
"""``[Key] Authors, "Title", Journal volume, page (year)``: key, title, volume and page may be missing."""


@dataclass(frozen=True)
class Reference:
    """One entry of a bibliography."""

    key: str
    locator: str
    """DOI, or address without its scheme; "" where there is none."""
    bibtex: str


@cache
def library() -> tuple[Reference, ...]:
    """Return the entries of `references.bib` as they stand there."""
    text = files("oatkit.citing").joinpath("references.bib").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", text, re.MULTILINE | re.DOTALL)
    whole = re.findall(r"^@.*?^\}", text, re.MULTILINE | re.DOTALL)
    return tuple(
        Reference(key, re.findall(r"^  (?:doi = \{|url = \{https://)(.*)\},$", body, re.MULTILINE)[0], entry)
        for (key, body), entry in zip(entries, whole, strict=True)
    )


def references(text: str) -> list[Reference]:
    """Return what a docstring, or the source of a table, refers to.

    A reference stands in a section ``References:`` or behind ``.. [Key]``; a DOI counts wherever it stands. One whose
    DOI or address is in `references.bib` comes from there; of any other the entry holds what the text says.
    """
    given = list(_given(text))
    alone = [doi for doi in dois(text) if not any(doi in one for one in given)]
    found = [_known(one) or _of_text(one) for one in (*given, *alone)]
    addresses = [one for one in library() if not one.locator.startswith("10.") and one.locator in text]
    return list(dict.fromkeys([*found, *addresses]))


def dois(text: str) -> list[str]:
    """Return the DOIs in a text without the marks of its sentences."""
    found = re.findall(r"\b10\.\d{4,9}/[^\s\"'`]*[^\s\"'`.,;:]", text)
    return [doi.rstrip(")") if doi.count(")") > doi.count("(") else doi for doi in found]


def _given(text: str) -> Iterator[str]:
    """Yield each reference that a text spells out, in one line."""
    for section in SECTION.findall(text):
        lines: list[str] = []
        for line in map(str.strip, section.splitlines()):
            if lines and (line.startswith("[") or COMPLETE.search(" ".join(lines))):
                yield " ".join(lines)
                lines = []
            lines.append(line)
        yield " ".join(lines)
    for block in SPHINX.findall(text):
        yield " ".join(block.split())


def _known(text: str) -> Reference | None:
    return next((one for one in library() if one.locator in dois(text)), None)


def _of_text(text: str) -> Reference:
    """Make an entry of what a text says; where it is not in the usual form, of its words as they are."""
    doi = next(iter(dois(text)), "")
    said = CITATION.match(text)
    if not said:
        named = re.match(r"\[(\w+)\]", text)
        fields = {"note": "" if text == doi else text, "doi": doi}
        return _entry("misc", named[1] if named else doi or text.split(",")[0], fields)
    authors = _authors(said["authors"])
    key = said["key"] or authors.split(" and ")[0].split()[-1] + said["year"]
    fields = {name: said[name] or "" for name in ("title", "journal", "volume", "pages", "year")}
    return _entry("article", key, {"author": authors, **fields, "doi": doi})


def _authors(text: str) -> str:
    """Return ``A, B and C`` or ``A et al.`` as BibTeX separates authors."""
    names = re.sub(r",? et al\.?$", ", others", text)
    return " and ".join(re.split(r", and |, | and ", names))


def _entry(kind: str, key: str, fields: dict[str, str]) -> Reference:
    plain = re.sub(r"[^\w.:/-]", "", key)
    lines = [f"  {name} = {{{_escaped(name, value)}}}," for name, value in fields.items() if value]
    return Reference(plain, fields["doi"], "\n".join([f"@{kind}{{{plain},", *lines, "}"]))


def _escaped(name: str, text: str) -> str:
    return text if name == "doi" else re.sub(r"([&%$#_{}])", r"\\\1", text)
