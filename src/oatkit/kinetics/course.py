"""Many frames of a result as a series: which ones count, and when they were taken."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.result import Result


@dataclass(frozen=True)
class Course:
    """The frames of a result that did not fail, in the order of time."""

    baseline: tuple[int, ...]
    """Frames of the state before, in the order of time, so that sums do not depend on how frames are numbered."""
    all: tuple[tuple[int, float], ...]
    """All frames, each with its time after the last of the baseline."""
    unit: str
    """Of the times: ``"s"``, or ``"frames"`` of the scan where the result does not know them."""
    notes: tuple[str, ...]

    @property
    def later(self) -> tuple[tuple[int, float], ...]:
        """Those after the baseline."""
        return tuple((frame, time) for frame, time in self.all if time > 0)


def course_of(result: Result, baseline: Iterable[int]) -> Course:
    """Return the frames of a result around a baseline.

    Raises `ValidationError` for a baseline that is empty, of which every frame failed, or after which no frame comes.
    """
    wanted = sorted(set(baseline))
    good = not_failed(result, wanted, "baseline")
    times, unit = _times(result)
    zero = max(times[frame] for frame in good)
    order = sorted(times, key=times.__getitem__)
    unused = [frame for frame in order if frame not in good and times[frame] <= zero]
    notes = [f"baseline: {counted_words(wanted, good)}"]
    if unit == "frames":
        notes.append("the result does not know the times of its frames: the unit of time is one frame of the scan")
    if unused:
        notes.append(f"no later than the baseline, and not counted: {listed(unused)}")
    if not max(times.values()) > zero:
        last = max(frame for frame in good if times[frame] == zero)
        order_of = "by the times of the scan" if unit == "s" else "by their numbers in the scan"
        raise ValidationError(
            f"baseline: no frame is later than its last one, frame {last} ({order_of}; the result has "
            f"{counted(result.frames)})"
        )
    before = tuple(frame for frame in order if frame in good)
    return Course(before, tuple((frame, times[frame] - zero) for frame in order), unit, tuple(notes))


def _times(result: Result) -> tuple[dict[int, float], str]:
    """Return the time of each frame that did not fail, and its unit."""
    known = {frame: result.when(frame) for frame in range(result.frames) if frame not in result.failed}
    times = {frame: time for frame, (_, time) in known.items() if time is not None}
    if len(times) == len(known):
        return times, "s"
    return {frame: float(number) for frame, (number, _) in known.items()}, "frames"


def not_failed(result: Result, frames: Sequence[int], what: str) -> tuple[int, ...]:
    """Return the frames of a choice that did not fail.

    Raises `ValidationError`, which names the choice, where none is left, or one does not exist.
    """
    if not frames:
        raise ValidationError(f"{what}: no frame is chosen; the result has frames 0 .. {result.frames - 1}")
    missing = [frame for frame in frames if not 0 <= frame < result.frames]
    if missing:
        raise ValidationError(f"{what}: no frame {missing[0]}; the result has frames 0 .. {result.frames - 1}")
    good = tuple(frame for frame in frames if frame not in result.failed)
    if not good:
        raise ValidationError(f"{what}: all of its frames failed: {listed(frames)}")
    return good


def image_of(result: Result, name: str) -> Image:
    """Return an image by its name. Raises `ValidationError`, with the nearest name, where there is none."""
    if name not in result:
        raise ValidationError(f"the result has no image '{name}'{did_you_mean(name, result)}")
    return result[name]


def values_of(result: Result, frame: int, name: str, first: Image) -> np.ndarray:
    """Return the values of one image of one frame, float64.

    Raises `ValidationError` where they do not fit to those of the `first` frame.
    """
    image = image_of(result.frame(frame), name)
    if (image.grid, image.wavelengths_nm, image.unit) != (first.grid, first.wavelengths_nm, first.unit):
        raise ValidationError(f"frame {frame}: grid, wavelengths or unit of '{name}' are not those of the first frame")
    return image.values.astype(float)


def counted_words(asked: Sequence[int], good: Sequence[int]) -> str:
    """Say how many frames a state is made of, and which others failed."""
    failed = [frame for frame in asked if frame not in good]
    return counted(len(good)) + (f"; failed, and not counted: {listed(failed)}" if failed else "")


def counted(frames: int) -> str:
    """Return ``1 frame`` or ``3 frames``."""
    return f"{frames} frame{'' if frames == 1 else 's'}"


def listed(frames: Iterable[int]) -> str:
    """Name frames in their order: ``frame 3`` or ``frames 3, 7``."""
    numbers = sorted(frames)
    return f"frame{'' if len(numbers) == 1 else 's'} {', '.join(map(str, numbers))}"
