"""What a report says in words and tables: certificates, frames, provenance."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.report.ticks import plain
from oatkit.result import Result

SHOWN_ELSEWHERE = frozenset({
    "iteration", "products", "objective", "residual_norm", "penalty", "relative_gap", "converged", "reason",
    "data_norm", "negative_pixels", "details", "change", "notes",
})  # fmt: skip
"""Diagnostics that have a table or a chart of their own."""
LONGEST = 24
"""Numbers of a list that are written out."""
UNIT_ENDINGS = {"_m_s": "m/s", "_nm": "nm", "_mm2": "mm²", "_mm": "mm"}


@dataclass(frozen=True)
class Table:
    """Rows of text under a line of headings."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def spaced(name: str) -> str:
    """Write the name of an image or a diagnostic as words, a unit at its end in brackets."""
    for ending, unit in UNIT_ENDINGS.items():
        if name.endswith(ending):
            return f"{spaced(name.removesuffix(ending))} ({unit})"
    return re.sub(r"\bso2\b", "sO₂", name.replace("_", " "))


def titled(name: str) -> str:
    """Write the name of an image as a heading."""
    words = spaced(name)
    return words if words.startswith("sO₂") else words[:1].upper() + words[1:]


def plane_name(image: Image, index: int) -> str:
    """Name a plane by its wavelength; nothing for an image without any."""
    return f"{image.wavelengths_nm[index]:g} nm" if image.wavelengths_nm else ""


def said(value: Any) -> str:
    """Write a plain value in words."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return plain(value, 5)
    if isinstance(value, Mapping):
        return ", ".join(f"{spaced(str(k))} {said(v)}" for k, v in value.items()) or "none"
    if isinstance(value, tuple | list):
        if len(value) > 2 and all(type(one) is type(value[0]) and one == value[0] for one in value):
            return f"{said(value[0])} ({len(value)} times)"
        more = f", ... ({len(value)} in all)" if len(value) > LONGEST else ""
        return ", ".join(map(said, value[:LONGEST])) + more or "none"
    return "none" if value is None else str(value)


def is_number(value: Any) -> bool:
    """Say whether a value is one; what a result records is read from files, so it can be anything."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def numbers(value: Any) -> np.ndarray:
    """Return nested sequences of numbers as an array, and anything else as an empty one."""
    try:
        return np.array(value, float)
    except (ValueError, TypeError):
        return np.zeros(0)


def pairs(caption: str, head: tuple[str, str], table: Mapping[str, Any], unit: str = "") -> Table:
    """Return a table of two columns."""
    return Table(caption, head, tuple((spaced(str(k)), said(v) + unit) for k, v in table.items()))


def of_plane(found: Mapping[str, Any], key: str, index: int) -> Any:
    """Return a diagnostic of one plane; None where there is none."""
    values = found.get(key)
    if isinstance(values, Sequence | np.ndarray) and not isinstance(values, str):
        return values[index] if index < len(values) else None
    return values


def certificates(result: Result) -> Iterator[Table]:
    """Yield a table for each image that a solver made: one row for each wavelength."""
    head = ("wavelength", "converged", "gap to the optimum", "iterations", "products", "residual", "ended")
    for name, image in result.items():
        if {"relative_gap", "converged"} & image.diagnostics.keys():
            rows = tuple(_certificate(image, i) for i in range(len(image.values)))
            yield Table(spaced(name), head, rows)


def _certificate(image: Image, index: int) -> tuple[str, ...]:
    found = image.diagnostics
    residual, size = (of_plane(found, key, index) for key in ("residual_norm", "data_norm"))
    share = f"{100 * residual / size:.1f} % of the data" if is_number(residual) and is_number(size) and size else ""
    counts = (of_plane(found, key, index) for key in ("iteration", "products"))
    return (
        plane_name(image, index) or "all",
        _optional(of_plane(found, "converged", index)),
        gap_words(of_plane(found, "relative_gap", index)),
        *map(_optional, counts),
        share,
        _optional(of_plane(found, "reason", index)),
    )


def gap_words(gap: Any) -> str:
    """Write how near to the optimum an image is certified to be."""
    return plain(gap, 2) if isinstance(gap, float) and math.isfinite(gap) else "uncertified"


def _optional(value: Any) -> str:
    return "" if value is None else said(value)


def diagnostics(result: Result) -> Iterator[Table]:
    """Yield what else the steps measured: the scales of each wavelength's problem, then everything short."""
    for name, image in result.items():
        details = image.diagnostics.get("details")
        if isinstance(details, tuple | list) and details and all(isinstance(one, Mapping) for one in details):
            keys = tuple(dict.fromkeys(key for one in details for key in one))
            rows = (
                (plane_name(image, i) or "all", *(_optional(one.get(k)) for k in keys)) for i, one in enumerate(details)
            )
            yield Table(f"{spaced(name)}, by wavelength", ("wavelength", *map(spaced, keys)), tuple(rows))
        rest = {key: value for key, value in image.diagnostics.items() if key not in SHOWN_ELSEWHERE}
        if rest:
            yield pairs(spaced(name), ("measured", "value"), rest)


def frames(result: Result) -> Table:
    """Return which frames are complete and which failed, neighbours of one fate in one row."""
    fates = [result.failed.get(i) for i in range(result.frames)]
    rows = []
    for reason, group in groupby(enumerate(fates), key=lambda pair: pair[1]):
        numbers = [i for i, _ in group]
        if reason is None:
            rows.append((_span(numbers), "complete", _span([result.when(i)[0] for i in numbers]), ""))
        else:
            rows.append((_span(numbers), "failed", "", reason))
    return Table("Frames of this result", ("frame", "state", "frame of the scan", "reason"), tuple(rows))


def _span(numbers: list[int]) -> str:
    return f"{numbers[0]} – {numbers[-1]}" if len(numbers) > 1 else f"{numbers[0]}"


def choice_table(caption: str, choice: Mapping[str, Any], drawn: Iterable[str]) -> Table:
    """Return what is known of a choice that a rule made, but for what a chart shows."""
    return pairs(caption, ("of the choice", "value"), {k: v for k, v in choice.items() if k not in (*drawn, "notes")})
