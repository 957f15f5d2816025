"""Fig. 5: the whole chain on a mouse: outline, light, initial pressure, absorption."""

from collections.abc import Iterator

import numpy as np

from oatkit.data import Image
from oatkit.drawing.sheet import Panel, sheet
from oatkit.paper.chain import Mouse
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.result import Result
from oatkit.words import plane_words

SHOWN = "shown without a number"

SETTING = Setting(field_of_view_mm=25.0)


def fig5(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    mouse = Mouse(setting)
    yield mouse.words()
    result = mouse.corrected("maxent-absorption")
    for name, image in result.items():
        yield f"{name}: {image.unit or 'relative'}"
    title = "Fig. 5: from pressure to absorption"
    truth = [[Panel("truth: absorption", mouse.body.absorption(setting.grid))]] if not mouse.real else []
    panels = [
        [_pressure("(a) outline", result, outline=result["boundary"]), _pressure("(c) initial pressure", result)],
        [Panel("(b) fluence", result["fluence"], (_range(result["fluence"], result["boundary"]),))],
        [Panel("(d) absorption", result["absorption"], tuple(plane_words(result["absorption"], 0)))],
    ]
    yield Outcome("fig5", title, sheet([*panels, *truth], (), title, mouse.words()), tuple(_beside(mouse, result)))


def _pressure(title: str, result: Result, outline: Image | None = None) -> Panel:
    return Panel(title, result["initial_pressure"], (), 0, outline)


def _range(fluence: Image, boundary: Image) -> str:
    inside = fluence.values[0][boundary.values[0] < 0]
    return f"{inside.min():.3f} .. {inside.max():.3f} in the body"


def _beside(mouse: Mouse, result: Result) -> Iterator[Beside]:
    inside = result["boundary"].values[0] < 0
    light = result["fluence"].values[0][inside]
    yield Beside("least over largest fluence in the body", SHOWN, f"{light.min() / light.max():.3f}", "another mouse")
    deepest = np.where(inside, result["boundary"].values[0], 0) <= 0.5 * result["boundary"].values[0].min()
    before, after = (_depth_ratio(result[name], inside, deepest) for name in ("initial_pressure", "absorption"))
    why = "the paper says that deep signals are highlighted more; here as the mean of the inner over the outer half"
    yield Beside("inner over outer half, pressure", SHOWN, f"{before:.3f}", why)
    yield Beside("inner over outer half, absorption", SHOWN, f"{after:.3f}", why)
    if not mouse.real:
        true = mouse.body.boundary(mouse.setting.grid).values[0] < 0
        dice = 2 * (inside & true).sum() / (inside.sum() + true.sum())
        yield Beside("Dice coefficient of the outline", "not stated", f"{dice:.3f}", "the truth is known here")
        truth = mouse.body.absorption(mouse.setting.grid)
        ratio = _depth_ratio(truth, inside, deepest)
        yield Beside("inner over outer half, true absorption", "not known", f"{ratio:.3f}", "the truth is known here")


def _depth_ratio(image: Image, inside: np.ndarray, deep: np.ndarray) -> float:
    plane = image.values[0]
    return float(np.nanmean(plane[deep]) / np.nanmean(plane[inside & ~deep]))
