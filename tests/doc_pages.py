"""What the README and the pages of docs/ show: blocks of code, commands, links."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str
    before: str
    """The prose between the block before and this one."""


def pages() -> list[str]:
    """All pages that people write, by their path in the repository."""
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("plugins/*/README.md")]
    written = [path for path in found if not {"_build", "auto_gallery", "reference"} & set(path.parts)]
    return sorted(str(path.relative_to(ROOT)) for path in written)


def text_of(page: str) -> str:
    """The text of a page."""
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(page: str) -> list[Block]:
    """The fenced blocks of a page, in their order."""
    parts = re.split(r"^```(\S*)\n(.*?)^```$", text_of(page), flags=re.MULTILINE | re.DOTALL)
    return [Block(language, text, before) for before, language, text in zip(*[iter(parts[:-1])] * 3, strict=True)]


def inline(page: str) -> list[str]:
    """The pieces of code within the lines of a page."""
    prose = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    return [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", prose)]


def lines_of(script: str) -> list[str]:
    """The commands of a shell script, a line each, without comments."""
    joined = script.replace("\\\n", " ").splitlines()
    return [line for line in joined if line.strip() and not line.lstrip().startswith("#")]


def commands(page: str) -> Iterator[list[str]]:
    """Every call of ``oatkit`` on a page, as the words behind the program's name."""
    shell = [line for block in blocks(page) if block.language == "sh" for line in lines_of(block.text)]
    for line in [*shell, *(code for code in inline(page) if code.startswith("oatkit "))]:
        words: list[str] = []
        for word in [*shlex.split(line, comments=True), ";"]:
            if word in {";", "&&", "||", "|", "do", "done"} or word.endswith(";"):
                yield from _call([*words, word.rstrip(";")])
                words = []
            else:
                words.append(word)


def _call(words: list[str]) -> Iterator[list[str]]:
    at = next((i for i, word in enumerate(words) if Path(word).name == "oatkit"), None)
    if at is not None:
        yield [word for word in words[at + 1 :] if word not in {"", ";", "&&", "||", "|"}]


def imports(script: str) -> Iterator[tuple[str, str]]:
    """Every name that a script takes from oatkit, with its module."""
    pattern = r"^(?:from (oatkit(?:\.\w+)*) import (?:\(([^)]*)\)|(.*))|import (oatkit(?:\.\w+)*)(?!\w).*)$"
    for module, inner, names, whole in re.findall(pattern, script, flags=re.MULTILINE):
        for name in (inner or names).split("#")[0].split(",") if module else ():
            if name.strip():
                yield module, name.split(" as ")[0].strip()
        if whole:
            yield whole, ""
