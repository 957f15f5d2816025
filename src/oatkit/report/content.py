"""All that a report shows, as plain values for the template."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from oatkit.regions import Region
from oatkit.regions.table import RegionOf, region_table
from oatkit.report.charts import Chart
from oatkit.report.curves import (
    DRAWN_OF_CALIBRATION,
    DRAWN_OF_SPEED,
    DRAWN_OF_WEIGHT,
    calibration_chart,
    settling,
    speed_chart,
    weight_chart,
)
from oatkit.report.facts import Table, certificates, choice_table, diagnostics, frames, is_number, pairs, said
from oatkit.report.gallery import Group, groups
from oatkit.report.listing import ListingLine, listing
from oatkit.report.spectra import region_tables, spectra_charts
from oatkit.report.verdict import Check, checks
from oatkit.result import Result

SCAN_WORDS = {
    "name": "scan", "source": "read from", "reader": "reader", "wavelengths_nm": "wavelengths (nm)",
    "speed_of_sound_m_s": "speed of sound (m/s)", "speed_of_sound_source": "speed known from",
    "fingerprint": "fingerprint of the data", "frames": "frames in the scan",
}  # fmt: skip
"""What a scan says of itself, and in which words it is shown; the rest is shown under its own name."""


@dataclass(frozen=True)
class Content:
    """What the template shows, from top to bottom."""

    title: str
    subtitle: str
    facts: Table
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]
    groups: tuple[Group, ...]
    region_charts: tuple[Chart, ...]
    region_tables: tuple[Table, ...]
    region_names: tuple[str, ...]
    certificates: tuple[Table, ...]
    charts: tuple[Chart, ...]
    diagnostics: tuple[Table, ...]
    pipeline: tuple[ListingLine, ...]
    frames: Table
    provenance: tuple[Table, ...]

    @property
    def most_planes(self) -> int:
        """Of any image."""
        return max((len(group.wavelengths) for group in self.groups), default=0)

    @property
    def changed(self) -> bool:
        """Whether the pipeline that ran is not letter for letter the one that was asked for."""
        return any(line.kind for line in self.pipeline)


def content_of(result: Result, regions: Sequence[RegionOf]) -> Content:
    """Return the content of a report on the frame that `result` shows."""
    placed = [region if isinstance(region, Region) else region(result) for region in regions]
    rows = region_table(dict(result), placed)
    choices = (
        weight_chart(result.weight_choice),
        speed_chart(result.speed_choice),
        calibration_chart(result.calibration_choice),
    )
    return Content(
        title=str(result.scan.get("name") or "Reconstruction"),
        subtitle=f"Frame {result.frame_index} of the scan"
        + (f", one of {result.frames} in this result" if result.frames > 1 else ""),
        facts=_facts(result),
        checks=tuple(checks(result)),
        warnings=_warnings(result),
        groups=groups(result, placed),
        region_charts=tuple(spectra_charts(rows)),
        region_tables=tuple(region_tables(rows)),
        region_names=tuple(region.name for region in placed),
        certificates=tuple(certificates(result)),
        charts=(*settling(result), *(choice for choice in choices if choice)),
        diagnostics=(*_choices(result), *diagnostics(result)),
        pipeline=listing(result.requested, result.pipeline),
        frames=frames(result),
        provenance=tuple(_provenance(result)),
    )


def _warnings(result: Result) -> tuple[str, ...]:
    """Return all notes of the run and of its choices, each once."""
    choices = (result.weight_choice, result.speed_choice, result.calibration_choice)
    found = [choice.get("notes") for choice in choices]
    notes = [str(note) for part in found if isinstance(part, tuple | list) for note in part]
    return tuple(dict.fromkeys([*result.warnings, *notes]))


def _facts(result: Result) -> Table:
    """Return what the images are of, in a few lines."""
    scan, solver = result.scan, result.pipeline.get("reconstruct")
    facts = {}
    if scan.get("wavelengths_nm"):
        facts["wavelengths"] = f"{said(scan['wavelengths_nm'])} nm"
    if isinstance(solver, Mapping) and "use" in solver:
        weight = solver.get("weight")
        facts["solver"] = str(solver["use"]) + (f", weight {said(weight)}" if weight is not None else "")
    if is_number(scan.get("speed_of_sound_m_s")):
        facts["speed of sound"] = f"{scan['speed_of_sound_m_s']:.1f} m/s"
    if result.images:
        grid = next(iter(result.values())).grid
        height, width = (said(1e3 * n * grid.pixel_size_m) for n in grid.shape)
        facts["field of view"] = f"{width} × {height} mm, pixels of {said(1e3 * grid.pixel_size_m)} mm"
    if result.time_s is not None:
        facts["taken at"] = f"{said(result.time_s)} s"
    if result.seconds:
        facts["computed in"] = f"{said(sum(filter(is_number, result.seconds.values())))} s"
    if "oatkit" in result.versions:
        facts["made by"] = f"oatkit {result.versions['oatkit']}"
    return pairs("In short", ("fact", "value"), facts)


def _choices(result: Result) -> list[Table]:
    known = (
        ("Choice of the weight", result.weight_choice, DRAWN_OF_WEIGHT),
        ("Choice of the speed of sound", result.speed_choice, DRAWN_OF_SPEED),
        ("Choice of the calibration", result.calibration_choice, DRAWN_OF_CALIBRATION),
    )
    return [choice_table(caption, choice, drawn) for caption, choice, drawn in known if choice]


def _provenance(result: Result) -> list[Table]:
    scan = {SCAN_WORDS.get(key, key): value for key, value in result.scan.items() if key != "notes"}
    tables = [
        pairs("Scan", ("fact", "value"), scan),
        pairs("Time of each step", ("step", "time"), result.seconds, " s"),
        pairs("Versions", ("package", "version"), result.versions),
    ]
    return [table for table in tables if table.rows]
