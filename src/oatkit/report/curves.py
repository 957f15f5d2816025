"""The charts of a report: how the passes between absorption and light settled, and how rules chose."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.drawing.plot import Curve, Mark, Plot
from oatkit.report.charts import Chart, chart
from oatkit.report.facts import is_number, numbers, plane_name, spaced
from oatkit.result import Result

DRAWN_OF_WEIGHT = ("curve",)
DRAWN_OF_SPEED = ("speeds_m_s", "scores")
DRAWN_OF_CALIBRATION = ("tried", "misfit")
"""What of a choice is drawn, so that no table repeats it."""


def settling(result: Result) -> Iterator[Chart]:
    """Yield how much each pass of a loop between absorption and light still changed the absorption.

    Images that come from one loop all tell of it; it is drawn once.
    """
    seen: set[bytes] = set()
    for name, image in result.items():
        change = numbers(image.diagnostics.get("change", ()))
        if change.size and change.ndim in (1, 2) and (change > 0).any() and change.tobytes() not in seen:
            seen.add(change.tobytes())
            yield _settling(name, image, change.reshape(len(change), -1))


def _settling(name: str, image: Image, change: np.ndarray) -> Chart:
    passes = np.arange(2, 2 + len(change))
    one_each = change.shape[1] == len(image.wavelengths_nm)
    curves = tuple(Curve(plane_name(image, i) if one_each else "", passes, column) for i, column in enumerate(change.T))
    return chart(Plot(f"Settling of {spaced(name)}", curves, "pass", "relative change", logarithmic="y"))


def weight_chart(choice: Mapping[str, Any]) -> Chart | None:
    """Draw the L-curve, or the error of prediction where the rule held detectors out; None where none was recorded."""
    points = choice.get("curve")
    if not isinstance(points, tuple | list) or not all(isinstance(point, Mapping) for point in points):
        return None
    keys = ("weight", "residual_norm", "penalty", "prediction_error")
    table = numbers([[point.get(key) for key in keys] for point in points])
    if table.ndim != 2:
        return None
    weight, residual, penalty, prediction = table.T
    chosen = int(np.argmin(abs(weight - choice["weight"]))) if is_number(choice.get("weight")) else None
    if np.isfinite(prediction).all():
        x, y, labels = weight, prediction, ("weight", "error on detectors that were held out")
    else:
        x, y, labels = residual, penalty, ("residual norm", "penalty")
    marks = () if chosen is None else (Mark(x[chosen], y[chosen], f"weight {weight[chosen]:.3g}"),)
    return chart(Plot(f"Weight by {choice.get('rule', 'a rule')}", (Curve("", x, y),), *labels, "xy", marks))


def speed_chart(choice: Mapping[str, Any]) -> Chart | None:
    """Draw how sharp the image was at each speed of sound, each metric scaled to 0 .. 1; None where not recorded."""
    speeds, recorded = numbers(choice.get("speeds_m_s", ())), choice.get("scores")
    scores = {name: numbers(v) for name, v in recorded.items()} if isinstance(recorded, Mapping) else {}
    if not speeds.size or not scores or any(values.shape != speeds.shape for values in scores.values()):
        return None
    curves = tuple(Curve(spaced(name), speeds, _scaled(values)) for name, values in scores.items())
    lines = (("speed_m_s", "the pick"), ("header_m_s", "the scan says"))
    verticals = tuple((choice[key], f"{word} {choice[key]:.1f}") for key, word in lines if is_number(choice.get(key)))
    labels = ("speed of sound (m/s)", "sharpness, scaled to 0 .. 1")
    return chart(Plot("Speed of sound by focus", curves, *labels, verticals=verticals))


def calibration_chart(choice: Mapping[str, Any]) -> Chart | None:
    """Draw how badly each calibration that was tried explains the pressure; None where that was not recorded."""
    tried, misfit = (numbers(choice.get(key, ())) for key in ("tried", "misfit"))
    if not tried.size or tried.shape != misfit.shape or tried.ndim != 1:
        return None
    found = choice.get("calibration")
    verticals = ((float(found), f"K {found:.3g} a.u. m"),) if found is not None and is_number(found) else ()
    labels = ("calibration K (a.u. m)", "misfit, relative to the pressure")
    return chart(Plot("Calibration by the spectra", (Curve("", tried, misfit),), *labels, "xy", verticals=verticals))


def _scaled(values: np.ndarray) -> np.ndarray:
    return (values - values.min()) / (np.ptp(values) or 1)
