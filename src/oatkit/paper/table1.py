"""Table I: sharpness and the number of non-negative pixels in the body."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from oatkit.data import Image
from oatkit.drawing.sheet import Panel, sheet
from oatkit.engine import run
from oatkit.metrics import negative_pixels, sharpness
from oatkit.paper.chain import Mouse
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import pipeline_for
from oatkit.paper.star import Star

PRESETS = {"L2": "lsqr", "L2, thresholded": "lsqr-threshold", "MaxEnt": "maxent"}
PAPER = {
    ("star", "L2, thresholded"): (11963, 0.0075),
    ("star", "MaxEnt"): (16890, 0.0125),
    ("mouse", "L2, thresholded"): (8224, 0.0092),
    ("mouse", "MaxEnt"): (15071, 0.0226),
}
"""Non-negative pixels and sharpness; of the mouse, its kidney region."""
WHY = (
    "another body and another weight; a thresholded image has no negative pixels at all, so the paper's count of "
    "non-negative ones must be of those above 0"
)
NOTES = (
    "Sharpness (Eq. 22) rises with noise as it does with edges, so it ranks nothing. It is taken inside the body, of "
    "the initial pressure over its maximum.",
)

SETTING = Setting(field_of_view_mm=25.0)


def table1(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    star, mouse = Star(setting), Mouse(setting)
    yield f"star: {setting.words()}"
    yield f"mouse: {mouse.words()}"
    bodies = {"star": star.inside, "mouse": mouse.corrected("maxent-absorption")["boundary"].values[0] < 0}
    found: dict[tuple[str, str], Image] = {}
    for name, preset in PRESETS.items():
        found["star", name] = _scaled(run(pipeline_for(preset, setting), star.scan)["initial_pressure"])
        found["mouse", name] = _scaled(mouse.pressure(preset)["initial_pressure"])
        for body, inside in bodies.items():
            yield f"{body}, {name}: sharpness {sharpness(found[body, name].values[0], inside):.4f}"
    title = "Table I: sharpness and non-negative pixels in the body"
    groups = [[Panel(f"{body}, {name}", found[body, name]) for name in PRESETS] for body in bodies]
    figure = sheet(groups, (), title, f"each image over its maximum · {mouse.words()}")
    yield Outcome("table1", title, figure, tuple(_beside(found, bodies)), _table(found, bodies), NOTES)


def _scaled(image: Image) -> Image:
    """Return an image over its maximum: sharpness goes with the square of the scale."""
    return replace(image, values=image.values / image.values.max())


def _counts(image: Image, inside: np.ndarray) -> tuple[int, int]:
    """Return how many pixels of the body are not negative, and how many are above 0."""
    negative = negative_pixels(image.values[0], inside).count
    return int(inside.sum()) - negative, int((image.values[0][inside] > 0).sum())


def _table(found: dict[tuple[str, str], Image], bodies: dict[str, np.ndarray]) -> tuple[Sequence[str], ...]:
    heading = ("body", "method", "pixels in the body", "not negative", "above 0", "sharpness")
    rows = []
    for (body, name), image in sorted(found.items(), reverse=True):
        inside = bodies[body]
        counts = (f"{n:,}" for n in (int(inside.sum()), *_counts(image, inside)))
        rows.append((body, name, *counts, f"{sharpness(image.values[0], inside):.4f}"))
    return (heading, *rows)


def _beside(found: dict[tuple[str, str], Image], bodies: dict[str, np.ndarray]) -> Iterator[Beside]:
    for (body, name), (paper_count, paper_sharpness) in PAPER.items():
        image, inside = found[body, name], bodies[body]
        above = _counts(image, inside)[1]
        yield Beside(f"pixels above 0, {body}, {name}", f"{paper_count:,}", f"{above:,} of {int(inside.sum()):,}", WHY)
        ours = sharpness(image.values[0], inside)
        yield Beside(f"sharpness, {body}, {name}", f"{paper_sharpness:.4f}", f"{ours:.4f}", WHY)
