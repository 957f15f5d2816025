"""Damaged and hostile files: thousands of them are read, and what happens is counted.

    python benchmarks/fuzz.py [--mutations 2000] [--seconds S] [--subject NAME ...] [--seed 0] [--only NUMBER]

Each file of every kind that oatkit reads is damaged in one place, or edited in one, and read in a process of its own,
so that a crash or a hang is found and goes no further. The real scan of a mouse is among them where the folder of real
data is there (OATKIT_SHARED). Ends with exit code 1 where anything happened that may not.

    refused   an error of oatkit's, one or more printable sentences
    equal     read, with the same values as the file as it was
    noted     read, other values or some left out, and a note or a warning says what was odd
    silent    read, other values, and nothing says so: what a format without checksums, or an edit to another
              possible value, cannot show; each is named
    crash, hang (over 20 s), foreign (an error that is not oatkit's), memory (over 256 MiB more), unclear (a message
              that is empty, endless or holds control characters), unseen (silent where the format has checksums)
"""

import argparse
import logging
import multiprocessing
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fuzz_subjects import SUBJECTS, Remarks, Subject, Values
from mutations import mutate

HANG_SECONDS = 20.0
MEMORY_BYTES = 256 * 2**20
ADDRESS_BYTES = 8 * 2**30
LONGEST_MESSAGE = 3000
WRONG = ("crash", "hang", "foreign", "memory", "unclear", "unseen")
"""What may not happen."""
BAD_NOTES = ("notes",)


@dataclass(frozen=True)
class Outcome:
    """What one mutation led to."""

    number: int
    kind: str
    where: str
    """Subject, file and what was done to it."""
    detail: str = ""

    @property
    def is_wrong(self) -> bool:
        """Whether it may not happen."""
        return self.kind in WRONG


def same(one: Any, other: Any) -> bool:
    """Say whether two values are equal, NaN counting as equal to NaN, whatever the types of their numbers."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        first, second = np.asarray(one), np.asarray(other)
        numeric = first.dtype.kind in "fiub" and second.dtype.kind in "fiub"
        return first.shape == second.shape and bool(np.array_equal(first, second, equal_nan=numeric))
    return bool(one == other or (one != one and other != other))


def differing(found: Values, expected: Values) -> list[str]:
    """Return the names of the values that are not as they were."""
    names = [name for name in {**expected, **found} if name not in found or name not in expected]
    return names + [name for name in expected if name in found and not same(found[name], expected[name])]


class Reader:
    """Mutates and reads the files of one subject, within this process."""

    def __init__(self, name: str, subject: Subject, folder: Path) -> None:
        self.name, self.subject = name, subject
        self._whole, self._work = folder / "whole", folder / "work"
        self._whole.mkdir()
        subject.write(self._whole)
        self._expected, self._usual = self._read()
        self._files = subject.files(self._whole)
        weights = np.array([1.0 if form == "binary" else 3.0 for _, form in self._files])
        self._chances = weights / weights.sum()

    def outcome(self, number: int, rng: np.random.Generator) -> Outcome:
        """Do one mutation and say what happened."""
        at = rng.choice(len(self._files), p=self._chances)
        path, form = self._files[at]
        whole = path.read_bytes()
        what, changed = mutate(whole, form, rng)
        where = f"{self.name}: {path.relative_to(self._whole)}: {what}"
        before = peak_bytes(reset=True)
        try:
            kind, detail = self._judged(path, changed)
        except BaseException as error:
            trace = traceback.extract_tb(error.__traceback__)[-1]
            kind, detail = "foreign", f"{type(error).__name__}: {error} ({trace.filename}:{trace.lineno})"[:600]
        if peak_bytes() - before > MEMORY_BYTES:
            return Outcome(number, "memory", where, f"{(peak_bytes() - before) >> 20} MiB; {kind} {detail}")
        if kind == "silent" and self._checked(what):
            kind = "unseen"
        return Outcome(number, kind, where, detail)

    def _checked(self, what: str) -> bool:
        """Say whether the checksums of the format show such a change."""
        return self.name in ("result", "unfinished") or (self.name == "scan file" and what.startswith("damage"))

    def _judged(self, path: Path, changed: bytes) -> tuple[str, str]:
        from oatkit import OatkitError

        try:
            found, remarks = self._read(path.relative_to(self._whole), changed)
        except OatkitError as error:
            text = str(error)
            clear = text.replace("\n", "").isprintable() and 0 < len(text) <= LONGEST_MESSAGE
            return ("refused" if clear else "unclear"), text if clear else repr(text[:200])
        other = differing(found, self._expected)
        if not [name for name in other if name not in BAD_NOTES]:
            return "equal", ""
        refused = [n for n in other if isinstance(found.get(n), str) and found[n].startswith("refused")]
        if len(remarks) != len(self._usual) or "notes" in other or len(refused) == len(other):
            return "noted", ", ".join(other[:3])
        return "silent", ", ".join(dict.fromkeys(name.split(" ")[0] for name in other))

    def _read(self, name: Path | None = None, content: bytes = b"") -> tuple[Values, list[str]]:
        """Read a fresh copy of the files, one of them with another content; also return what was warned of."""
        shutil.rmtree(self._work, ignore_errors=True)
        shutil.copytree(self._whole, self._work)
        if name is not None:
            (self._work / name).write_bytes(content)
        remarks, log = Remarks(), logging.getLogger("oatkit")
        log.addHandler(remarks)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                return self.subject.read(self._work), remarks.found
        finally:
            log.removeHandler(remarks)


def peak_bytes(reset: bool = False) -> int:
    """Return the largest size of this process since the last reset; 0 where the system does not tell."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
        return 1024 * int(line.split()[1])
    except (OSError, StopIteration):
        return 0


def serve(pipe: Connection, names: Sequence[str], seed: int, subjects: Mapping[str, Subject] | None = None) -> None:
    """Answer each number that comes with an outcome, until none comes: the work of a process."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_BYTES, ADDRESS_BYTES))
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)
    known = subjects or SUBJECTS
    pipe.send("ready")
    with tempfile.TemporaryDirectory() as name:
        readers: dict[str, Reader] = {}
        while (number := pipe.recv()) is not None:
            rng = np.random.default_rng([seed, number])
            chosen = names[number % len(names)]
            if chosen not in readers:
                folder = Path(name) / str(len(readers))
                folder.mkdir()
                readers[chosen] = Reader(chosen, known[chosen], folder)
            pipe.send(readers[chosen].outcome(number, rng))


class Worker:
    """A process that reads mutated files, made anew when it dies."""

    def __init__(self, names: Sequence[str], seed: int, subjects: Mapping[str, Subject] | None, limit: float) -> None:
        self._names, self._limit = names, limit
        self._arguments = (tuple(names), seed, subjects)
        self._begin()

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs, *self._arguments), daemon=True)
        self._process.start()
        theirs.close()
        self._pipe.recv()  # it has imported everything

    def give(self, number: int) -> None:
        """Hand over a mutation."""
        self.number, self.began = number, time.monotonic()
        self._pipe.send(number)

    def take(self) -> Outcome | None:
        """Return the outcome, or None where there is none yet."""
        subject = self._names[self.number % len(self._names)]
        try:
            if self._pipe.poll(0.002):
                outcome: Outcome = self._pipe.recv()
                return outcome
        except EOFError:
            self._process.join()
            found = Outcome(self.number, "crash", subject, f"exit code {self._process.exitcode}")
            self._begin()
            return found
        if time.monotonic() - self.began > self._limit:
            self.end()
            self._begin()
            return Outcome(self.number, "hang", subject, f"over {self._limit:g} s")
        return None

    def end(self) -> None:
        """Stop the process."""
        self._process.kill()
        self._process.join()
        self._pipe.close()


def fuzz(
    numbers: Sequence[int],
    names: Sequence[str] = tuple(SUBJECTS),
    seed: int = 0,
    seconds: float = float("inf"),
    subjects: Mapping[str, Subject] | None = None,
    processes: int = 2,
    hang_seconds: float = HANG_SECONDS,
) -> Iterator[Outcome]:
    """Yield the outcome of each of these mutations, as they come, until so many seconds are over.

    The same number and seed give the same mutation of the same names, whatever else is run.
    """
    workers = [Worker(names, seed, subjects, hang_seconds) for _ in range(min(processes, len(numbers)))]
    waiting, end = list(numbers)[::-1], time.monotonic() + seconds
    busy: list[Worker] = []
    try:
        while busy or waiting:
            if time.monotonic() > end:
                waiting.clear()
            for worker in [w for w in workers if w not in busy][: len(waiting)]:
                worker.give(waiting.pop())
                busy.append(worker)
            for worker in list(busy):
                if outcome := worker.take():
                    busy.remove(worker)
                    yield outcome
    finally:
        for worker in workers:
            worker.end()


def report(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of a table of what happened, then what was silent by its kind, then all that was wrong."""
    kinds = ("refused", "equal", "noted", "silent", *WRONG)
    counts = Counter((o.where.split(":")[0], o.kind) for o in outcomes)
    names = sorted({subject for subject, _ in counts})
    yield "subject".ljust(14) + "".join(kind.rjust(9) for kind in kinds)
    for name in names:
        yield name.ljust(14) + "".join(str(counts[name, kind]).rjust(9) for kind in kinds)
    yield "all".ljust(14) + "".join(str(sum(o.kind == kind for o in outcomes)).rjust(9) for kind in kinds)
    yield "\nsilent, by what was done and what is other than it was:"
    silent = Counter(f"{o.where} -> {o.detail}" for o in outcomes if o.kind == "silent")
    yield from (f"{count:5} {what}" for what, count in sorted(silent.items()))
    yield from (f"\nWRONG {o.kind}, number {o.number}: {o.where}: {o.detail}" for o in outcomes if o.is_wrong)


def main() -> int:
    """Run, print, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--mutations", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--subject", nargs="+", default=list(SUBJECTS), choices=list(SUBJECTS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="the number of one mutation")
    given = parser.parse_args()
    numbers = range(given.mutations) if given.only is None else [given.only]
    began, outcomes = time.monotonic(), []
    for outcome in fuzz(numbers, given.subject, given.seed, given.seconds):
        outcomes.append(outcome)
        if given.only is not None:
            print(outcome)
    print("\n".join(report(outcomes)))
    print(f"{len(outcomes)} mutations in {time.monotonic() - began:.0f} s")
    return int(any(outcome.is_wrong for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
