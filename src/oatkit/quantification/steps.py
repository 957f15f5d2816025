"""What each step after the reconstruction makes of the images so far, checked."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from oatkit.api import Plugin, UnmixProblem
from oatkit.blame import blame
from oatkit.data import Image
from oatkit.errors import PluginError, SolverError
from oatkit.parameters import Parameters
from oatkit.pipeline import Pipeline
from oatkit.quantification.absorption import absorption
from oatkit.quantification.fixed_point import fixed_point
from oatkit.reconstruction import check_finite
from oatkit.slips import optics_notes
from oatkit.tables import AbsorptionTable

Images = Mapping[str, Image]


def following(pipeline: Pipeline) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield the name of each step of `pipeline`, in order, with all that its images depend on beyond those before."""
    for name in STEPS:
        part = getattr(pipeline, name)
        if part is not None:
            parts = (part, pipeline.optics) if name == "fluence" else (part,)
            yield name, (*parts, *(stamp for part in parts for stamp in _stamps(part)))


def _stamps(part: Parameters) -> Iterator[tuple[str, int, int]]:
    """Yield what tells whether a file that a step reads has been changed: a mask is redrawn under one name."""
    for name in type(part).model_fields:
        value = getattr(part, name)
        for path in value if isinstance(value, tuple) else (value,):
            if isinstance(path, Path) and path.is_file():
                status = path.stat()
                yield str(path), status.st_mtime_ns, status.st_size


def quantify(name: str, pipeline: Pipeline, images: Images) -> dict[str, Image]:
    """Return what one step makes of the images so far, checked, each with the history of its making."""
    pressure, part = images["initial_pressure"], getattr(pipeline, name)
    with blame(part) if isinstance(part, Plugin) else nullcontext():
        made = dict(STEPS[name](pipeline, images))
    for key, image in made.items():
        _check(part, key, image, pressure)
    tables = {"optics": pipeline.optics.model_dump()} if name == "fluence" else {}
    history = (*_before(name, images), {"step": name, **part.model_dump(), **tables})
    return {key: replace(image, history=history) for key, image in made.items()}


def _segment(pipeline: Pipeline, images: Images) -> Images:
    assert pipeline.segment is not None
    return {"boundary": pipeline.segment.segment(images["initial_pressure"])}


def _fluence(pipeline: Pipeline, images: Images) -> Images:
    assert pipeline.fluence is not None
    optics = pipeline.optics.optics(images["initial_pressure"].wavelengths_nm)
    made, notes = pipeline.fluence.fluence(images["boundary"], optics), optics_notes(optics)
    if not isinstance(made, Image) or not notes:
        return {"fluence": made}
    return {
        "fluence": replace(
            made, diagnostics={**made.diagnostics, "notes": (*made.diagnostics.get("notes", ()), *notes)}
        )
    }


def _absorption(pipeline: Pipeline, images: Images) -> Images:
    table, model = pipeline.absorption, pipeline.fluence
    assert table is not None
    assert model is not None
    seen = (images["initial_pressure"], images["fluence"], images["boundary"])
    if table.passes == 1:
        return {"absorption": absorption(table, *seen)}
    optics = pipeline.optics.optics(seen[0].wavelengths_nm)
    with blame(model):
        made, light = fixed_point(table, model, optics, *seen)
    return {"absorption": made, "fluence": light}


def _unmix(pipeline: Pipeline, images: Images) -> Images:
    assert pipeline.unmix is not None
    return pipeline.unmix.unmix(unmix_problem(pipeline, images))


def unmix_problem(pipeline: Pipeline, images: Images) -> UnmixProblem:
    """Return what the unmixer of a pipeline gets."""
    pressure, table = images["initial_pressure"], pipeline.absorption or AbsorptionTable()
    return UnmixProblem(
        pressure,
        images.get("absorption"),
        images.get("boundary"),
        images.get("fluence"),
        pipeline.fluence,
        pipeline.optics.optics(pressure.wavelengths_nm) if pipeline.fluence else None,
        None if table.calibration is None else table.calibration * table.grueneisen,
        table.calibrated_by,
        table.floor,
    )


STEPS: Mapping[str, Callable[[Pipeline, Images], Images]] = {
    "segment": _segment, "fluence": _fluence, "absorption": _absorption, "unmix": _unmix,
}  # fmt: skip
"""The steps in their order, by the name of their table."""


def _before(name: str, images: Images) -> tuple[Mapping[str, Any], ...]:
    """Return the history of the image that a step builds on."""
    latest = {"segment": "initial_pressure", "fluence": "boundary", "absorption": "fluence"}.get(name)
    return images[latest or list(images)[-1]].history


def _check(part: Parameters, key: str, image: Any, pressure: Image) -> None:
    """Raise where an image is not what its step promises."""
    who = f"{part.kind.replace('_', ' ')} '{part.name}'" if part.kind else f"[{key}]"
    if not isinstance(image, Image) or image.grid != pressure.grid:
        raise PluginError(f"{who} returned no image on the grid as '{key}'")
    check_finite(who, key, image)
    if key == "boundary" and (image.quantity != "boundary" or len(image.values) != 1):
        raise PluginError(f"{who} returned {len(image.values)} planes of '{image.quantity}', not one of 'boundary'")
    if key == "boundary" and not (image.values < 0).any():
        raise SolverError(f"{who} found no body: no pixel is inside the boundary")
    if key == "fluence" and image.wavelengths_nm != pressure.wavelengths_nm:
        raise PluginError(f"{who} returned other wavelengths than the scan has: {image.wavelengths_nm}")
    if key == "fluence" and not (image.values >= 0).all():
        raise SolverError(f"{who} returned {(image.values < 0).sum()} pixels of negative fluence")
