"""A pipeline: which plugin does each step, with which parameters, as a frozen value that reads and writes TOML."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import pydantic

from oatkit.api import FluenceModel, ForwardModel, Plugin, Preprocessor, Segmenter, Solver, Unmixer
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.parameters import Context, Parameters, param, problems
from oatkit.registry import installed
from oatkit.tables import AbsorptionTable, GridTable, MotionTable, OpticsTable, ScanTable

BUILDS_ON: Mapping[str, str] = {"fluence": "segment", "absorption": "fluence"}
"""Which step needs which other one."""


class Pipeline(Parameters):
    """The steps from a scan to images. A step that is None does not happen."""

    key_word: ClassVar[str] = "table"
    title: ClassVar[str] = "a pipeline"

    version: Literal[1] = param(1, "version of the file format")
    scan: ScanTable = param(ScanTable(), "overrides of what the scan file says")
    motion: MotionTable | None = param(None, "whether frames out of place are looked for")
    grid: GridTable = param(GridTable(), "the image to reconstruct")
    preprocess: tuple[Preprocessor, ...] = param((), "steps on the raw signals, in this order")
    forward: ForwardModel = param(..., "acoustic model")
    reconstruct: Solver = param(..., "from signals to initial pressure")
    segment: Segmenter | None = param(None, "from initial pressure to the boundary of the body")
    optics: OpticsTable = param(OpticsTable(), "how the body absorbs and scatters light, for the fluence")
    fluence: FluenceModel | None = param(None, "from boundary and optics to the light in the body")
    absorption: AbsorptionTable | None = param(None, "from initial pressure and fluence to absorption")
    unmix: Unmixer | None = param(None, "from wavelengths to chromophores")

    @classmethod
    def load(cls, name_or_path: str | Path, changes: Iterable[str] = ()) -> Self:
        """Read a pipeline file (``*.toml``) or a preset by its name, with ``slot.key=value`` changes.

        Raises `ValidationError` with all that is wrong in it, one sentence a line.
        """
        text, origin, folder = _source(str(name_or_path))
        return cls.loads(text, origin, folder, changes)

    @classmethod
    def loads(cls, text: str, origin: str = "pipeline", folder: Path = Path(), changes: Iterable[str] = ()) -> Self:
        """Read a pipeline from TOML text; `origin` names it in messages, paths in it are relative to `folder`."""
        try:
            table = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # beyond syntax: numbers too long, nesting too deep
            raise ValidationError(f"{origin}: not valid TOML: {error}") from None
        for change in changes:
            set_value(table, change)
        return cls.of_table(table, origin, folder)

    @classmethod
    def of_table(cls, table: Mapping[str, Any], origin: str = "pipeline", folder: Path = Path()) -> Self:
        """Read a pipeline from tables nested as in its TOML file: ``Pipeline.of_table(result.pipeline)``.

        Raises as `loads` does.
        """
        try:
            pipeline = cls.model_validate(dict(table), context=Context(installed().find, folder))
        except pydantic.ValidationError as error:
            lines = [f"{origin}{_where(path, table)}: {text}" for path, text in problems(error)]
            raise ValidationError("\n".join(lines)) from None
        try:
            pipeline.grid.grid()
        except ValidationError as error:
            raise ValidationError(f"{origin} [grid]: {error}") from None
        try:
            pipeline.check_order()
        except ValidationError as error:
            raise ValidationError("\n".join(f"{origin} {line}" for line in str(error).splitlines())) from None
        return pipeline

    def check_order(self) -> None:
        """Raise `ValidationError` where a step lacks one that it builds on."""
        lacking = [
            f"[{step}] needs [{needed}], which is missing"
            for step, needed in BUILDS_ON.items()
            if getattr(self, step) is not None and getattr(self, needed) is None
        ]
        if lacking:
            raise ValidationError("\n".join(lacking))

    def to_toml(self) -> str:
        """Return the pipeline as TOML text with every parameter; `loads` gives back an equal pipeline."""
        import tomlkit  # only needed to write

        return tomlkit.dumps(_without_none(self.model_dump()))

    def save(self, path: str | Path) -> None:
        """Write the pipeline as a TOML file."""
        Path(path).write_text(self.to_toml(), encoding="utf-8")

    def with_solver(self, solver: Solver) -> Self:
        """Return the same pipeline with another solver."""
        return self.model_copy(update={"reconstruct": solver})

    def plugins(self) -> Iterator[Plugin]:
        """Yield the plugins of all steps, and those that are their parts: a solver's regularizer."""
        return _plugins(self)


def presets() -> dict[str, str]:
    """Return the text of each pipeline that ships with the package, by its name."""
    found = (f for f in files("oatkit.presets").iterdir() if f.name.endswith(".toml"))
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in sorted(found, key=lambda f: f.name)}


def preset(name: str) -> str:
    """Return the text of a preset. Raises `ValidationError`, with the nearest name, where there is none."""
    known = presets()
    if name not in known:
        hint = did_you_mean(name, known)
        raise ValidationError(f"no preset named '{name}'{hint} (a pipeline file ends in .toml)")
    return known[name]


def set_value(table: dict[str, Any], change: str) -> None:
    """Apply ``slot.key=value`` to a pipeline's table in place.

    The right side is read as a TOML value, else as a bare word; an empty one takes the key out, so that the default
    holds. A step of ``preprocess`` is addressed by its plugin's name. A change of ``use`` drops the other keys of the
    old plugin. Raises `ValidationError`.
    """
    path, equals, text = change.partition("=")
    keys = path.strip().split(".")
    if not equals or len(keys) < 2 or not all(keys):
        raise ValidationError(f"--set {change}: expected slot.key=value, as in reconstruct.weight=0.01")
    for key in keys[:-1]:
        table = _descend(table, key, change)
    if not isinstance(table, dict):
        raise ValidationError(
            f"--set {change}: '{keys[-2]}' is a list of steps; say which, as in preprocess.offset.KEY=VALUE"
        )
    if keys[-1] == "use":
        table.clear()
    if text.strip():
        table[keys[-1]] = _value(text.strip())
    else:
        table.pop(keys[-1], None)


def _descend(table: Any, key: str, change: str) -> Any:
    if isinstance(table, list):
        steps = {str(step.get("use")): step for step in table if isinstance(step, dict)}
        if key not in steps:
            hint = did_you_mean(key, steps)
            raise ValidationError(f"--set {change}: the pipeline has no step '{key}' there{hint}")
        return steps[key]
    below = table.setdefault(key, {})
    if not isinstance(below, dict | list):
        raise ValidationError(f"--set {change}: '{key}' is a value, not a table")
    return below


def _value(text: str) -> Any:
    try:
        table = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    except (ValueError, RecursionError):
        raise ValidationError(f"--set: {text[:40]}... is too long a number or nested too deeply") from None
    return table["value"] if len(table) == 1 else text


def _source(name_or_path: str) -> tuple[str, str, Path]:
    """Return text, name for messages and folder of a pipeline."""
    path = Path(name_or_path)
    if path.suffix != ".toml":
        return preset(name_or_path), name_or_path, Path()
    try:
        if not path.is_file():
            raise ValidationError(f"{path}: no such pipeline file")
        # Some editors put a mark before the text that names its encoding.
        return path.read_text(encoding="utf-8-sig"), path.name, path.parent
    except (OSError, UnicodeDecodeError) as error:
        raise ValidationError(f"{path}: not a readable text file: {error}") from None


def _where(path: str, table: Mapping[str, Any]) -> str:
    """Write ``.reconstruct.weight`` as `` [reconstruct].weight``; a preprocess step is named by its plugin."""
    keys = path.split(".")[1:]
    if not keys:
        return ""
    if len(keys) == 1 and not isinstance(table.get(keys[0]), dict | list) and keys[0] in table:
        return f" {keys[0]}"
    head, rest = keys[0], keys[1:]
    if rest and rest[0].isdigit():
        step = table[head][int(rest[0])]
        name = step.get("use", rest[0]) if isinstance(step, dict) else rest[0]
        head, rest = f"{head}.{name}", rest[1:]
    return f" [{head}]" + "".join(f".{key}" for key in rest)


def _plugins(table: Parameters) -> Iterator[Plugin]:
    for name in type(table).model_fields:
        value = getattr(table, name)
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, Plugin):
                yield one
            if isinstance(one, Parameters):
                yield from _plugins(one)


def _without_none(table: Any) -> Any:
    if isinstance(table, dict):
        return {k: _without_none(v) for k, v in table.items() if v is not None}
    return [_without_none(v) for v in table] if isinstance(table, list) else table
