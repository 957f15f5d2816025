"""The L-curve of a sweep: as a plot with what lies on it, as a table, and each of its points in words. No Qt."""

import csv
import io
import math
from collections.abc import Iterator

import numpy as np

from oatkit.csv_cell import cell
from oatkit.drawing.plot import Curve, Mark, Plot
from oatkit.gui.weights.sweep import Tried, WeightSweep
from oatkit.metrics import negative_pixels
from oatkit.pipeline import Pipeline

COLUMNS = (
    "solver", "frame", "wavelength_nm", "weight", "residual_norm", "penalty", "relative_gap", "converged",
    "negative_percent", "prediction_error", "picked_by",
)  # fmt: skip


def short(weight: float) -> str:
    """Return a weight as it is written beside a curve.

    >>> short(10 ** -2.5)
    '0.00316'
    """
    return f"{weight:.3g}"


def plot_of(sweep: WeightSweep, shown: float | None = None) -> Plot:
    """Return the curve with marks: what the rules pick, the weight of the pipeline now, and the one that is `shown`."""
    x, y = _axes(sweep.tried)
    # An axis without a value above zero cannot be drawn logarithmically.
    logarithmic = "".join(name for name, values in (("x", x), ("y", y)) if (values > 0).any())
    marks = tuple(_marks(sweep, shown))
    curves = (Curve("", x, y, "o-"),)
    return Plot(title_of(sweep), curves, "residual |A x - b|", "root of the penalty", logarithmic, marks)


def title_of(sweep: WeightSweep) -> str:
    """Return what was swept."""
    if sweep.begun is None or sweep.scan is None:
        return "L-curve"
    strongest = ", the strongest" if sweep.begun.is_strongest else ""
    frame = f", frame {sweep.frame}" if sweep.scan.frames > 1 else ""
    return f"L-curve at {sweep.begun.wavelength_nm:g} nm{strongest}{frame}"


def heading_of(sweep: WeightSweep) -> str:
    """Return the heading of a page with the curve: the solver and the scan."""
    parts = (sweep.pipeline.reconstruct.name if sweep.pipeline else "", sweep.scan.name if sweep.scan else "")
    return ", ".join(("Weight", *(part for part in parts if part)))


def words_of(sweep: WeightSweep, tried: Tried) -> str:
    """Return what there is to know of a point."""
    return " · ".join(_words(sweep, tried))


def now_of(pipeline: Pipeline) -> str:
    """Return what weight a pipeline has, in words."""
    weight = getattr(pipeline.reconstruct, "weight", None)
    if weight is None:
        return f"{pipeline.reconstruct.name} has no weight"
    return f"pipeline: by {weight}" if isinstance(weight, str) else f"pipeline: {short(weight)}"


def csv_of(sweep: WeightSweep) -> str:
    """Return the curve as CSV, a row for each weight; empty cells are what is not known."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS)
    held_out = {point.weight: point.prediction_error for point in sweep.held_out}
    for tried in sweep.tried:
        writer.writerow(list(_cells(sweep, tried, held_out.get(tried.point.weight, math.nan))))
    return file.getvalue()


def _cells(sweep: WeightSweep, tried: Tried, prediction_error: float) -> Iterator[str | float | None]:
    assert sweep.pipeline is not None  # there is something that was tried
    point = tried.point
    yield from (cell(sweep.pipeline.reconstruct.name), sweep.frame, f"{tried.image.wavelengths_nm[0]:g}")
    yield from (_number(value) for value in (point.weight, point.residual_norm, point.penalty, _gap(tried)))
    yield from ("yes" if point.converged else "no", f"{_negative_percent(tried):.4g}", _number(prediction_error))
    yield ", ".join(name for name, weight in sweep.picks.items() if weight == point.weight)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.9g}"


def _words(sweep: WeightSweep, tried: Tried) -> Iterator[str]:
    point, negative, gap = tried.point, _negative_percent(tried), _gap(tried)
    yield f"weight {short(point.weight)}"
    share = f" ({100 * point.residual_norm / sweep.begun.data_norm:.1f} % of the data)" if sweep.begun else ""
    yield f"residual {point.residual_norm:.4g}{share}"
    yield f"{negative:.1f} % negative" if negative else "no negative pixels"
    yield "no certificate" if not math.isfinite(gap) else f"within {gap:.1e} of the optimum"
    if not point.converged:
        yield "not converged"


def _negative_percent(tried: Tried) -> float:
    plane = tried.image.values[0]
    return 100 * negative_pixels(plane).count / plane.size


def _gap(tried: Tried) -> float:
    return float(tried.image.diagnostics["relative_gap"][0])


def _marks(sweep: WeightSweep, shown: float | None) -> Iterator[Mark]:
    """Yield a mark for each weight that has a name, with all its names: marks at one place would hide each other."""
    names: dict[float, list[str]] = {}
    for name, weight in sweep.picks.items():
        names.setdefault(weight, []).append(name)
    now = getattr(sweep.session.pipeline.reconstruct, "weight", None)
    for name, number in (("pipeline", now), ("shown", shown)):
        if isinstance(number, float | int):
            names.setdefault(float(number), []).append(name)
    for weight, words in names.items():
        if (place := _place(sweep.tried, weight)) is not None:
            yield Mark(*place, f"{short(weight)} {', '.join(words)}")


def _place(tried: list[Tried], weight: float) -> tuple[float, float] | None:
    """Return where a weight lies on the curve, between points on a straight line of its logarithms; None beside it."""
    weights = [each.point.weight for each in tried]
    if not weights or not weights[0] <= weight <= weights[-1]:
        return None
    tiny = np.finfo(float).tiny
    x, y = (np.log(np.maximum(axis, tiny)) for axis in _axes(tried))
    at = np.log(weight)
    return tuple(float(np.exp(np.interp(at, np.log(weights), axis))) for axis in (x, y))  # type: ignore[return-value]


def _axes(tried: list[Tried]) -> tuple[np.ndarray, np.ndarray]:
    points = [each.point for each in tried]
    return np.array([p.residual_norm for p in points]), np.sqrt([max(p.penalty, 0.0) for p in points])
