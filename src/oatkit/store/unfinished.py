"""What an interrupted run leaves beside its output, and whether another run may go on with it."""

import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from oatkit.errors import ResultError, ValidationError
from oatkit.plain import decode, encode
from oatkit.store.journal import Story

MOST_NAMED = 3
"""Differences that a message names."""


@dataclass(frozen=True)
class Unfinished:
    """The hidden folder and the diary of a run."""

    path: Path
    """Of the output."""
    run: Mapping[str, Any]
    """Who asks for what, in plain values."""

    @property
    def folder(self) -> Path:
        """Where the frames are until all are there."""
        return self._beside("unfinished")

    @property
    def journal(self) -> Path:
        """The diary; it lies outside the folder, so that the folder is complete before the diary ends."""
        return self._beside("journal")

    def story(self, frames: int, resume: bool, overwrite: bool) -> Story | None:
        """Return what to go on with, after clearing away what is not.

        Raises `ResultError` where frames would be lost that nobody has given up, `ValidationError` where they are of
        another run.
        """
        story = Story.read(self.journal, self.folder)
        if story is not None and story.frames:
            if resume:
                self._check_same(decode(story.head.run))
                return story
            if not overwrite:
                raise ResultError(
                    f"{self.path}: an interrupted run left {story.frames} of {frames} frames; go on with it "
                    "(--resume, resume=True), or start anew (--overwrite, overwrite=True)"
                )
        shutil.rmtree(self.folder, ignore_errors=True)
        self.journal.unlink(missing_ok=True)
        return None

    def _check_same(self, earlier: Mapping[str, Any]) -> None:
        then, now = dict(_leaves(earlier)), dict(_leaves(decode(encode(self.run))))
        other = [key for key in {**then, **now} if then.get(key) != now.get(key)]
        if other:
            named = ", ".join(f"{key} ({then.get(key)}, now {now.get(key)})" for key in other[:MOST_NAMED])
            more = f" and {len(other) - MOST_NAMED} more" if len(other) > MOST_NAMED else ""
            raise ValidationError(
                f"{self.path}: the interrupted run was another one: {named}{more}; repeat it as it was, or start anew "
                "with --overwrite"
            )

    def _beside(self, ending: str) -> Path:
        path = self.path.absolute()
        return path.with_name(f".{path.name}.{ending}")


def _leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each plain value of nested tables with the way to it."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, f"{name}.{key}" if name else key)
    else:
        yield name, value
