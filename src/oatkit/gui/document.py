"""A pipeline as the text that its author wrote: edited without losing comments, with undo and redo."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import BaseModel
from tomlkit.exceptions import TOMLKitError

from oatkit.errors import ValidationError
from oatkit.pipeline import Pipeline, preset


class PipelineDocument:
    """The text of a pipeline and the pipeline that it stands for.

    An edit that gives no valid pipeline raises `ValidationError` and changes nothing. A step of ``preprocess`` is
    addressed by its position.
    """

    def __init__(self, text: str, folder: Path = Path()) -> None:
        self.folder = folder
        self.path: Path | None = None
        """The file that it was opened from, or last saved to."""
        self.pipeline = self._parsed(text)
        self._texts, self._at = [text], 0
        self._saved = text

    @classmethod
    def of_preset(cls, name: str) -> "PipelineDocument":
        """Open a preset by its name."""
        return cls(preset(name))

    @classmethod
    def open(cls, path: Path) -> "PipelineDocument":
        """Open a pipeline file. Raises `ValidationError`."""
        try:
            opened = cls(path.read_bytes().decode("utf-8-sig"), path.parent)
        except (OSError, UnicodeDecodeError) as error:
            raise ValidationError(f"{path}: not a readable text file: {error}") from None
        opened.path = path
        return opened

    @property
    def text(self) -> str:
        """The text as it stands."""
        return self._texts[self._at]

    @property
    def changed(self) -> bool:
        """Whether something would be lost if it were closed."""
        return self.text != self._saved

    def save(self, path: Path) -> None:
        """Write the text, byte for byte as it stands; in another folder, with its relative paths made whole.

        Raises `ResultError` where it cannot be written.
        """
        from oatkit.atomic import write_file

        write_file(path, self._text_in(path.parent).encode(), overwrite=True)
        self._saved, self.path = self.text, path

    def set(self, slot: str, key: str, value: Any, part: str = "", index: int | None = None) -> None:
        """Set a parameter of a step; `part` names a nested plugin (a solver's regularizer), `index` a preprocess step.

        A plugin nested deeper is named by the way to it: ``"regularizer.inner"``.

        Setting ``use`` takes another plugin, and drops the keys of the old one. A value of None removes the key.
        """
        document = self._document()
        table = _table(document, slot, index)
        for name in part.split(".") if part else ():
            table = _nested(table, name)
        if key == "use":
            for old in [name for name in table if name != "use"]:
                del table[old]
        if value is None:
            table.pop(key, None)
        else:
            table[key] = _plain(value)
        self._take(tomlkit.dumps(document))

    def put(self, slot: str, values: Mapping[str, Any]) -> None:
        """Put other keys in place of all that the table of a step has, as one edit."""
        document = self._document()
        new = slot not in document
        table = _table(document, slot, None)
        for old in list(table):
            del table[old]
        for key, value in values.items():
            table[key] = _plain(value)
        text = tomlkit.dumps(document)
        self._take(_spaced(text) if new else text)

    def replace(self, text: str) -> None:
        """Take another text in place of this one, as an edit that can be undone."""
        self._take(text)

    def add(self, slot: str, use: str | None = None) -> None:
        """Add a step to the end of ``preprocess``, or switch a later one on."""
        document = self._document()
        table = tomlkit.table() if use is None else tomlkit.item({"use": use})
        if slot == "preprocess":
            steps = document.setdefault("preprocess", tomlkit.aot())
            steps.append(table)
        else:
            document[slot] = table
        self._take(_spaced(tomlkit.dumps(document)))

    def remove(self, slot: str, index: int | None = None) -> None:
        """Remove a step."""
        document = self._document()
        if index is None:
            document.pop(slot, None)
        else:
            del document[slot][index]
        self._take(tomlkit.dumps(document))

    def move(self, index: int, to: int) -> None:
        """Move a step of ``preprocess``."""
        document = self._document()
        steps = list(document["preprocess"])
        steps.insert(to, steps.pop(index))
        array = tomlkit.aot()
        for step in steps:
            array.append(step)
        document["preprocess"] = array
        self._take(_spaced(tomlkit.dumps(document)))

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to take back."""
        return self._at > 0

    @property
    def can_redo(self) -> bool:
        """Whether there is an edit to make again."""
        return self._at < len(self._texts) - 1

    def undo(self) -> None:
        """Take the last edit back, if there is one."""
        self._go(self._at - 1)

    def redo(self) -> None:
        """Make an edit again that was taken back, if there is one."""
        self._go(self._at + 1)

    def _text_in(self, folder: Path) -> str:
        """Return the text for a file in another folder: what it names there is what it names here."""
        if folder.resolve() == self.folder.resolve() or not (known := set(_paths(self.pipeline))):
            return self.text
        document = self._document()
        _make_whole(document, self.folder, known)
        return tomlkit.dumps(document)

    def _go(self, at: int) -> None:
        if 0 <= at < len(self._texts):
            self._at = at
            self.pipeline = self._parsed(self.text)

    def _take(self, text: str) -> None:
        if text != self.text:
            self.pipeline = self._parsed(text)
            self._texts = [*self._texts[: self._at + 1], text]
            self._at += 1

    def _parsed(self, text: str) -> Pipeline:
        return Pipeline.loads(text, "pipeline", self.folder)

    def _document(self) -> tomlkit.TOMLDocument:
        try:
            return tomlkit.parse(self.text)
        except TOMLKitError as error:
            raise ValidationError(f"pipeline: not valid TOML: {error}") from None


def _table(document: Any, slot: str, index: int | None) -> Any:
    if index is not None:
        return document[slot][index]
    if slot not in document:
        document[slot] = tomlkit.table()
    return document[slot]


def _nested(table: Any, part: str) -> Any:
    if not isinstance(table.get(part), Mapping):
        table[part] = tomlkit.inline_table()
    return table[part]


def _paths(value: Any) -> Iterator[Path]:
    """Yield the paths among the parameters of a pipeline."""
    if isinstance(value, BaseModel):
        value = tuple(getattr(value, name) for name in type(value).model_fields)
    if isinstance(value, tuple | list):
        for item in value:
            yield from _paths(item)
    elif isinstance(value, Path):
        yield value


def _make_whole(table: Any, folder: Path, known: set[Path]) -> None:
    """Replace each text of a table that stands for one of the `known` paths by the whole path."""
    for key, value in table.items() if isinstance(table, Mapping) else enumerate(table):
        if isinstance(value, str) and folder / value in known:
            table[key] = str((folder / value).absolute())
        elif isinstance(value, Mapping | list):
            _make_whole(value, folder, known)


def _spaced(text: str) -> str:
    """Put one blank line before each table, or before the comment above it: what was moved brings several, or none."""
    lines: list[str] = []
    for line in text.splitlines():
        if re.match(r"\[\[?[A-Za-z]", line):
            comment = _comment_above(lines)
            while lines and not lines[-1].strip():
                lines.pop()
            lines += ["", *comment] if lines else comment
        lines.append(line)
    return "\n".join(lines).rstrip("\n") + "\n"


def _comment_above(lines: list[str]) -> list[str]:
    """Take the comment off the end of `lines` that has a blank line before it, and return it."""
    at = len(lines)
    while at and lines[at - 1].startswith("#"):
        at -= 1
    comment = lines[at:] if at and not lines[at - 1].strip() else []
    del lines[len(lines) - len(comment) :]
    return comment


def _plain(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value
