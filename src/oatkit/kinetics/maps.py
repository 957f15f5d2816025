"""Change over time, pixel by pixel, as images."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.kinetics.course import counted_words, course_of, image_of, listed, not_failed, values_of
from oatkit.kinetics.statistics import Moments, Response
from oatkit.result import Result

QUANTITIES: Mapping[str, str] = {
    "peak": "change", "time_to_peak": "time_to_peak", "auc": "area_under_curve", "wash_in": "wash_in_slope",
}  # fmt: skip


def gas_challenge(result: Result, baseline: Iterable[int], challenge: Iterable[int], image: str = "so2") -> Result:
    r"""Return how `image` differs between two states, each a choice of the frames of a result, as images:

    ``<image>_baseline`` and ``<image>_challenge`` (means over the frames in which a pixel is defined),
    ``<image>_baseline_frames`` and ``<image>_challenge_frames`` (how many these are), ``<image>_change`` (challenge
    minus baseline) and ``<image>_change_se``, its standard error

    .. math:: \sqrt{s_b^2 / n_b + s_c^2 / n_c}

    with the unbiased variances s^2 of the two states, as if frames were independent; NaN where a pixel is defined in
    less than two frames of either. Frames that failed do not count.

    Raises `ValidationError` for an unknown image, an empty state, states that share a frame, or one of which every
    frame failed.
    """
    states = {"baseline": sorted(set(baseline)), "challenge": sorted(set(challenge))}
    shared = set(states["baseline"]) & set(states["challenge"])
    if shared:
        raise ValidationError(f"challenge: in the baseline, too: {listed(shared)}; choose other frames")
    found = {name: not_failed(result, frames, name) for name, frames in states.items()}
    first = image_of(result.frame(found["baseline"][0]), image)
    moments = {name: _moments(result, frames, image, first) for name, frames in found.items()}
    before, after = moments["baseline"], moments["challenge"]
    made = {
        "baseline": (before.mean, f"{first.quantity}_baseline", first.unit),
        "challenge": (after.mean, f"{first.quantity}_challenge", first.unit),
        "baseline_frames": (before.count.astype(float), "baseline_frames", "frames"),
        "challenge_frames": (after.count.astype(float), "challenge_frames", "frames"),
        "change": (after.mean - before.mean, "change", first.unit),
        "change_se": (np.sqrt(before.variance_of_mean + after.variance_of_mean), "standard_error", first.unit),
    }
    notes = [f"{name}: {counted_words(frames, found[name])}" for name, frames in states.items()]
    return _as_result(result, image, first, made, {"step": "gas-challenge", **states}, notes)


def contrast_kinetics(result: Result, image: str, baseline: Iterable[int]) -> Result:
    """Return what `image` does after the frames of `baseline`, as images.

    The change is the value minus the mean over the baseline; it begins with 0 at the time of the last baseline frame,
    time 0. ``<image>_baseline`` is that mean, ``<image>_peak``, ``<image>_time_to_peak``, ``<image>_auc`` and
    ``<image>_wash_in`` are those of `oatkit.kinetics.statistics.Response`. Pixels that are undefined in a frame lack
    that frame; those undefined in the whole baseline, or ever after, are NaN.

    Raises `ValidationError` for an unknown image, an empty baseline or one of which every frame failed, and where no
    frame is later.
    """
    course = course_of(result, baseline)
    first = image_of(result.frame(course.baseline[0]), image)
    before = _moments(result, course.baseline, image, first)
    response = Response(first.values.shape)
    for frame, time in course.later:
        response.add(time, values_of(result, frame, image, first) - before.mean)
    units = {"peak": first.unit, **_units(first.unit, course.unit)}
    made = {"baseline": (before.mean, f"{first.quantity}_baseline", first.unit)}
    made |= {name: (values, QUANTITIES[name], units[name]) for name, values in response.images().items()}
    step = {"step": "contrast-kinetics", "baseline": list(course.baseline), "time_unit": course.unit}
    return _as_result(result, image, first, made, step, course.notes)


def _moments(result: Result, frames: Iterable[int], name: str, first: Image) -> Moments:
    moments = Moments(first.values.shape)
    for frame in frames:
        moments.add(values_of(result, frame, name, first))
    return moments


def _as_result(
    result: Result,
    name: str,
    first: Image,
    made: Mapping[str, tuple[np.ndarray, str, str]],
    step: Mapping[str, Any],
    notes: Iterable[str],
) -> Result:
    """Return arrays as images, with the provenance of the result that they came from."""
    history = (*first.history, {**step, "image": name})
    images = {
        f"{name}_{key}": Image(values, quantity, unit, first.grid, first.wavelengths_nm, history)
        for key, (values, quantity, unit) in made.items()
    }
    return replace(result, images=images, seconds={}, warnings=tuple(notes), frame_index=0, time_s=None, stored=None)


def _units(unit: str, time_unit: str) -> dict[str, str]:
    one = time_unit.removesuffix("s") if time_unit == "frames" else time_unit
    return {"time_to_peak": time_unit, "auc": f"{unit} {one}".strip(), "wash_in": f"{unit or '1'}/{one}"}
