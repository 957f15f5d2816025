"""Plugins tried in processes of their own: whatever they do there, crash or hang, stays there."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.registry import ALLOWED, OURS, allowed, distributions

LOADING = """
import json, sys
from oatkit.registry import installed
rows = [entry.row() for entry in installed().entries if entry.distribution == sys.argv[1]]
with open(sys.argv[2], "w", encoding="utf-8") as file:
    json.dump(rows, file)
"""
CHECKING = """
import json, sys
from oatkit.registry import installed
from oatkit.testing import report
rows = [
    entry.row() | (report(entry.cls) if entry.cls else {"violations": [], "unchecked": ""})
    for entry in installed().entries
    if entry.distribution == sys.argv[1]
]
with open(sys.argv[2], "w", encoding="utf-8") as file:
    json.dump(rows, file)
"""
TIMES_LONGER = 10
"""Checking the plugins of a distribution may take so many times as long as loading them."""
LAST_LINES = 3
"""Of what a process printed before it crashed."""


@dataclass(frozen=True)
class Trial:
    """What became of the plugins of one distribution."""

    distribution: str
    rows: tuple[dict[str, Any], ...] = ()
    """As `oatkit.registry.Entry.row` gives them; empty where the process did not come back.

    Where they were checked, too, with what `oatkit.testing.report` says."""
    problem: str = ""
    """Why it did not."""

    @property
    def fine(self) -> bool:
        """Whether all plugins can be used."""
        return not self.problem and all(row["status"] == "ok" for row in self.rows)

    @property
    def violations(self) -> tuple[str, ...]:
        """A sentence for each promise that a plugin was found to break."""
        return tuple(sentence for row in self.rows for sentence in row.get("violations", ()))


def distributions_of(name: str) -> list[str]:
    """Return the distributions that `name` stands for: one of them, or ``all`` that may be loaded but ours.

    Raises `ValidationError` where there is none; nothing of theirs is loaded to find out.
    """
    known = distributions()
    if name == "all":
        return [one for one in known if one != OURS and allowed(one)]
    if name not in known:
        raise ValidationError(f"no distribution named '{name}' declares plugins{did_you_mean(name, known)}")
    return [name]


def try_out(distribution: str, seconds: float) -> Trial:
    """Load the plugins of a distribution in a fresh process that has so many seconds, and check them in another one.

    What they promise is that of `oatkit.testing`.
    """
    loaded = _run(LOADING, "loading it", distribution, seconds)
    if loaded.problem or not any(row["status"] != "broken" for row in loaded.rows):
        return loaded
    checked = _run(CHECKING, "checking it", distribution, TIMES_LONGER * seconds)
    return replace(loaded, problem=checked.problem) if checked.problem else checked


def _run(script: str, what: str, distribution: str, seconds: float) -> Trial:
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "rows.json"
        command = [sys.executable, "-c", script, distribution, str(answer)]
        try:
            done = subprocess.run(
                command,
                env={**os.environ, ALLOWED: distribution},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=seconds,
            )
        except subprocess.TimeoutExpired:
            return Trial(distribution, problem=f"does not come back: {what} was stopped after {seconds:g} s")
        if not answer.is_file():
            return Trial(distribution, problem=f"ends the whole process: {what}, {_crash(done)}")
        return Trial(distribution, tuple(json.loads(answer.read_bytes())))


def _crash(done: subprocess.CompletedProcess[str]) -> str:
    """Say how a process ended that did not answer, with its last words."""
    try:
        how = f"killed by {signal.Signals(-done.returncode).name}"
    except ValueError:
        how = f"exit code {done.returncode}"
    words = " / ".join(line.strip() for line in done.stderr.strip().splitlines()[-LAST_LINES:])
    return f"{how}{': ' + words if words else ''}"
