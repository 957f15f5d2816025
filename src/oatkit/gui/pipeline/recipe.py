"""How the image of a layer came about: what ran, not what stands in the window now."""

from collections.abc import Iterator, Mapping
from typing import Any

import tomlkit

from oatkit.data import Image
from oatkit.result import Result


def recipe_toml(image: Image, result: Result | None = None) -> str:
    """Return the pipeline that made an image, as run, as TOML text; `result` is what the image is part of.

    Without a result only the steps up to the image are known. Such a text is no whole pipeline.
    """
    if result is not None and result.pipeline:
        return tomlkit.dumps(_plain(result.pipeline))
    table: dict[str, Any] = {}
    for step in image.history:
        entry = {key: value for key, value in _plain(step).items() if key != "step"}
        if step["step"] == "preprocess":
            table.setdefault("preprocess", []).append(entry)
        else:
            table[str(step["step"])] = entry
    return tomlkit.dumps(table)


def recipe_text(image: Image, result: Result | None = None) -> str:
    """Return all that is known of how an image was made: input, choices, versions, and the pipeline as run."""
    lines = [f"# {image.quantity}" + (f", {image.unit}" if image.unit else "")]
    if result is not None:
        lines += [f"# {line}" for line in _about(result)]
    return "\n".join([*lines, "", recipe_toml(image, result)])


def _about(result: Result) -> Iterator[str]:
    """Yield a line for each thing to know of a result beside its pipeline."""
    scan = result.scan
    for key in ("name", "source", "fingerprint"):
        if scan.get(key):
            yield f"scan {key}: {scan[key]}"
    yield f"frame: {result.frame_index}"
    if scan.get("speed_of_sound_m_s"):
        yield f"speed of sound: {scan['speed_of_sound_m_s']:.1f} m/s ({scan.get('speed_of_sound_source', '')})"
    if result.weight_choice:
        yield f"weight: {result.weight_choice['weight']:.4g} by {result.weight_choice['rule']}"
    yield "versions: " + ", ".join(f"{name} {version}" for name, version in result.versions.items())
    yield from (f"note: {note}" for note in result.warnings)


def _plain(table: Any) -> Any:
    """Return a table without what is not set, which TOML cannot say."""
    if isinstance(table, Mapping):
        return {key: _plain(value) for key, value in table.items() if value is not None}
    return [_plain(value) for value in table] if isinstance(table, list | tuple) else table
