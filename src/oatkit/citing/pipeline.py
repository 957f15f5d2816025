"""What to cite for the images of a pipeline: oatkit, and whatever the pipeline is made of."""

import inspect
import re
from collections import defaultdict
from collections.abc import Iterator
from importlib.metadata import metadata

from oatkit.citing.bibliography import Reference, references
from oatkit.pipeline import Pipeline
from oatkit.spectra import CHROMOPHORES, TISSUES

WATER = {
    "h2o": CHROMOPHORES["water"].source,
    "d2o": "S. Kedenburg et al., Opt. Mater. Express 2, 1588 (2012), 10.1364/OME.2.001588",
}
"""Where the absorption of what the body lies in comes from."""


def bibtex(pipeline: Pipeline | None = None) -> str:
    """Return BibTeX of oatkit and of all that a pipeline uses; a comment before each entry says what for."""
    used: dict[Reference, list[str]] = defaultdict(list)
    silent = []
    for what, text in _parts(pipeline) if pipeline else ():
        found = references(text)
        for one in found:
            used[one] += [what] if what not in used[one] else []
        silent += [] if found else [what]
    entries = [f"% {', '.join(names)}\n{one.bibtex}" for one, names in _distinct(used).items()]
    end = [f"% Without a reference: {', '.join(dict.fromkeys(silent))}."] if silent else []
    return "\n\n".join([_itself(), *entries, *end])


def _itself() -> str:
    """Return the entry of this package, from its metadata."""
    known = metadata("oatkit")
    return "\n".join(
        [
            "% the program",
            "@misc{oatkit,",
            f"  author = {{{{{known['Author']}}}}},",
            "  title = {oatkit},",
            f"  note = {{Version {known['Version']}. {known['Summary']}}},",
            "}",
        ]
    )


def _distinct(used: dict[Reference, list[str]]) -> dict[Reference, list[str]]:
    """Return the references with a letter behind each key that stands for another one already."""
    taken: set[str] = set()
    renamed = {}
    for one, names in used.items():
        key = next(k for k in (one.key, *(f"{one.key}{c}" for c in "bcdefghijklmnopqrstuvwxyz")) if k not in taken)
        taken.add(key)
        text = re.sub(r"\{.*?,", f"{{{key},", one.bibtex, count=1)
        renamed[Reference(key, one.locator, text)] = names
    return renamed


def _parts(pipeline: Pipeline) -> Iterator[tuple[str, str]]:
    """Yield what a pipeline uses, and the text that says where it comes from."""
    for plugin in pipeline.plugins():
        yield f"{plugin.kind.replace('_', ' ')} {plugin.name}", inspect.getdoc(type(plugin)) or ""
    if pipeline.scan.speed_of_sound_m_s == "focus":
        from oatkit.focus import metrics

        yield "speed of sound by focus", metrics.__doc__ or ""
    if pipeline.absorption is not None:
        yield from _absorption(pipeline.absorption.passes)
    if pipeline.fluence is not None:
        yield from _optics(pipeline)
    yield from _chromophores(pipeline)


def _absorption(passes: int) -> Iterator[tuple[str, str]]:
    from oatkit.quantification.absorption import absorption
    from oatkit.quantification.fixed_point import fixed_point

    yield "absorption", inspect.getdoc(absorption) or ""
    if passes > 1:
        yield "absorption fed back into the light", inspect.getdoc(fixed_point) or ""


def _optics(pipeline: Pipeline) -> Iterator[tuple[str, str]]:
    """Yield the sources of the body's optics, and of the water's around it."""
    optics, fluence = pipeline.optics, pipeline.fluence
    if optics.table is None and None in (optics.absorption_per_cm, optics.reduced_scattering_per_cm):
        tissue = TISSUES[optics.tissue]
        yield f"tissue {optics.tissue}", tissue.source
        parts = {"oxyhaemoglobin": tissue.blood_volume, "water": tissue.water, "lipid": tissue.fat}
        for name in (name for name, share in parts.items() if share and optics.absorption_per_cm is None):
            yield f"spectrum of {name}", CHROMOPHORES[name].source
    if getattr(fluence, "ring_radius", None) is not None:
        couplant = getattr(fluence, "couplant", "")
        yield f"light through {couplant}", WATER.get(couplant, "")


def _chromophores(pipeline: Pipeline) -> Iterator[tuple[str, str]]:
    unmixer = pipeline.unmix
    for name in getattr(unmixer, "chromophores", ()):
        known = CHROMOPHORES.get(name)
        yield f"spectrum of {name}", known.source if known and not getattr(unmixer, "tables", ()) else ""
