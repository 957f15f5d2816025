"""Shards: parts of a run by jobs that know nothing of each other, and the whole joined from them."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from oatkit.atomic import check_output
from oatkit.errors import ResultError, ValidationError
from oatkit.result import Result
from oatkit.store import StoreWriter, load


def shard_of(frames: Sequence[int], shard: str) -> list[int]:
    """Return the frames that shard ``i/n`` (from 1) of a run has. Raises `ValidationError` for another text.

    >>> shard_of(range(7), "2/3")
    [1, 4]
    """
    found = re.fullmatch(r"(\d+)/(\d+)", shard)
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise ValidationError(f"shard {shard}: expected i/n with 1 <= i <= n, as in 3/8")
    number, count = int(found[1]), int(found[2])
    chosen = list(frames)[number - 1 :: count]
    if not chosen:
        raise ValidationError(f"shard {shard}: the run has {len(frames)} frames only, none is left for this shard")
    return chosen


def join(paths: Sequence[str | Path], output: str | Path, overwrite: bool = False) -> Result:
    """Join results of parts of one run, in the order of their frames, and return the whole.

    Raises `ResultError` where a part is damaged, and where the output cannot be written or is one of the parts;
    `ValidationError` where the parts are not of one run, or two hold the same frame.
    """
    if not paths:
        raise ValidationError("join: expected one result or more")
    check_output(Path(output), map(str, paths), overwrite)
    parts = [load(path) for path in paths]
    _check_alike(parts, paths)
    frames = sorted((number, k, i) for k, part in enumerate(parts) for i, number in enumerate(_numbers(part)))
    twice = {one[0] for one, other in pairwise(frames) if one[0] == other[0]}
    if twice:
        raise ValidationError(f"join: frames {sorted(twice)} are in two of the results")
    with StoreWriter(output, len(frames), str(parts[0].scan.get("source", "")), overwrite) as writer:
        for index, (_, k, i) in enumerate(frames):
            if i in parts[k].failed:
                writer.fail(index, parts[k].failed[i])
            else:
                writer.write(index, parts[k].frame(i))
    return load(output)


def _check_alike(parts: Sequence[Result], paths: Sequence[str | Path]) -> None:
    first = parts[0]
    for part, path in zip(parts, paths, strict=True):
        same = (part.requested, part.scan.get("fingerprint")) == (first.requested, first.scan.get("fingerprint"))
        if not same:
            raise ValidationError(f"join: {path} is of another pipeline or another scan than {paths[0]}")


def _numbers(part: Result) -> list[int]:
    """Return which frame of the scan each frame of a result is; of one that failed its reason says so."""
    return [_of_reason(part.failed[i]) if i in part.failed else part.when(i)[0] for i in range(part.frames)]


def _of_reason(reason: str) -> int:
    found = re.match(r"frame (\d+): ", reason)
    if not found:
        raise ResultError(f"join: the reason of a failed frame does not say which it was: {reason}")
    return int(found[1])
