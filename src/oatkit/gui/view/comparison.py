"""Results kept to be compared: their names, what they have in common, and the difference of two of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import BOUNDARY, KEY, SEEN_AT_FIRST, image_of
from oatkit.gui.workbench import Workbench
from oatkit.metrics import psnr, rmse, ssim

CURRENT = ""
"""The group of the newest result."""
CURRENT_NAME = "current"
COMPARISON = "comparison"
"""What the tiles are for."""
DIFFERENCE = "difference"
"""Key and quantity of the difference of two images."""


class Comparison:
    """The results that are shown in one viewer, as groups of layers: the newest one, and those that were kept."""

    def __init__(self, bench: Workbench) -> None:
        self.bench, self.layers, self.side_by_side = bench, bench.layers, bench.side_by_side
        self._pair: tuple[str, str, str] | None = None
        """Groups and image of the difference that is shown."""
        self._subtracted: tuple[Image, Image] | None = None
        bench.viewing.changed.connect(self._follow)

    def close(self) -> None:
        """Follow the viewer no more."""
        self.bench.viewing.changed.disconnect(self._follow, missing_ok=True)

    @property
    def groups(self) -> list[str]:
        """The results that are at hand, the newest run first, where there is one."""
        found = list(self.layers.groups())
        return sorted(found, key=lambda group: group != CURRENT)

    @property
    def images(self) -> list[str]:
        """Names of the images that at least one result has, those that most have first; no outlines."""
        counts: dict[str, int] = {}
        for layers in self.layers.groups().values():
            for name, layer in layers.items():
                if layer.metadata[KEY]["image"].quantity != BOUNDARY:
                    counts[name] = counts.get(name, 0) + 1
        return sorted(counts, key=lambda name: -counts[name])

    @property
    def is_beside(self) -> bool:
        """Whether results are shown side by side."""
        return self.side_by_side.purpose == COMPARISON

    def suggested_name(self) -> str:
        """Return a name for the newest result that no other has: that of its solver."""
        result = self._newest()
        base = str(result.pipeline.get("reconstruct", {}).get("use", "result")) if result is not None else "result"
        taken = self.layers.groups()
        return next(name for name in (base, *(f"{base} {n}" for n in range(2, len(taken) + 3))) if name not in taken)

    def keep(self, name: str) -> None:
        """Keep the newest result under a name, out of sight. Raises `ValidationError` where there is none to keep."""
        result = self._newest()
        if result is None:
            raise ValidationError("there is no result to keep: run the pipeline first")
        self._check_name(name)
        self.layers.show_result(result, name, visible=False)

    def rename(self, old: str, new: str) -> None:
        """Call a kept result otherwise. Raises `ValidationError` for a name that is empty or taken."""
        if new != old:
            self._check_name(new)
            self.layers.rename_group(old, new)
            self._pair = None

    def remove(self, group: str) -> None:
        """Remove a kept result."""
        self.layers.remove_group(group)

    def is_shown(self, group: str) -> bool:
        """Say whether a result is seen."""
        return any(layer.visible for layer in self.layers.groups().get(group, {}).values())

    def show(self, group: str, shown: bool) -> None:
        """Let a result be seen, or not: side by side its tile, else what of a result is seen at first."""
        for layer in self.layers.groups().get(group, {}).values():
            if self.side_by_side.active:
                layer.visible = shown and layer in self.side_by_side.tiles
            else:
                layer.visible = shown and layer.metadata[KEY]["image"].quantity in SEEN_AT_FIRST

    def compare(self, name: str) -> None:
        """Show an image of all results that have it side by side. Raises `ValidationError` where none has."""
        groups = self.layers.groups()
        tiles = {groups[group][name]: called(group) for group in self.groups if name in groups[group]}
        if not tiles:
            raise ValidationError(f"no result has an image named '{name}'")
        self.side_by_side.begin(tiles, COMPARISON)

    def subtract(self, group: str, other: str, name: str) -> None:
        """Show the image of one result less that of another, of the frame looked at, in one layer.

        Raises `ValidationError` where one has no such image or they cannot be subtracted.
        """
        first, second = self._image(group, name), self._image(other, name)
        image = difference(first, second, f"{called(group)} - {called(other)}")
        layer = self.layers.show(image, DIFFERENCE, visible=True)
        layer.name = f"{called(group)} - {called(other)}: {name.replace('_', ' ')}"
        self.layers.select(DIFFERENCE)
        self._pair, self._subtracted = (group, other, name), (first, second)

    def numbers(self) -> str:
        """Return how far the images of the difference shown are apart at the wavelength looked at; "" without one."""
        if self._pair is None or self._subtracted is None or self.layers.find(DIFFERENCE) is None:
            return ""
        first, second = self._subtracted
        plane = min(self.layers.plane, len(first.values) - 1)
        try:
            return Likeness.of(first.values[plane], second.values[plane]).text
        except ValidationError as error:
            return str(error)

    def _follow(self) -> None:
        """Subtract again where another frame is looked at, or a result was computed anew."""
        if self._pair is None or self._subtracted is None:
            return
        if self.layers.find(DIFFERENCE) is None:
            self._pair = None
            return
        group, other, name = self._pair
        try:
            now = self._image(group, name), self._image(other, name)
            if not all(a is b for a, b in zip(now, self._subtracted, strict=True)):
                self._subtracted = now
                self.layers.show(difference(*now, f"{called(group)} - {called(other)}"), DIFFERENCE)
        except ValidationError:
            self._pair = None
            self.layers.remove(DIFFERENCE)

    def _image(self, group: str, name: str) -> Image:
        layer = self.layers.groups().get(group, {}).get(name)
        if layer is None:
            raise ValidationError(f"'{called(group)}' has no image named '{name}'")
        image = image_of(layer, self.layers.frame)
        if isinstance(image, str):
            raise ValidationError(f"{called(group)}: {image}")
        return image

    def _newest(self) -> Any:
        layers = self.layers.groups().get(CURRENT, {})
        return next((layer.metadata[KEY]["result"] for layer in layers.values()), None)

    def _check_name(self, name: str) -> None:
        if not name.strip() or "/" in name or name == CURRENT_NAME:
            raise ValidationError(f"a kept result needs a name without '/', other than '{CURRENT_NAME}'")
        if name in self.layers.groups():
            raise ValidationError(f"there is a result named '{name}' already: remove it, or take another name")


def called(group: str) -> str:
    """Return how a group is called."""
    return group or CURRENT_NAME


def difference(first: Image, second: Image, what: str) -> Image:
    """Return the first image less the second; `what` says of what, for the history of the image.

    Raises `ValidationError` where grids, wavelengths or units differ.
    """
    if first.grid != second.grid:
        raise ValidationError("the two images lie on different grids: run both with the same [grid] to subtract them")
    if first.wavelengths_nm != second.wavelengths_nm:
        raise ValidationError("the two images have different wavelengths, so that their planes do not belong together")
    if first.unit != second.unit:
        raise ValidationError(f"the two images have different units, {first.unit or '1'} and {second.unit or '1'}")
    step: Mapping[str, Any] = {"step": DIFFERENCE, "of": first.quantity, "what": what}
    return Image(
        first.values - second.values, DIFFERENCE, first.unit, first.grid, first.wavelengths_nm, (step,), {"what": what}
    )


@dataclass(frozen=True)
class Likeness:
    """How far a plane is from another that counts as the truth, over the pixels where both have a value."""

    relative_rmse: float
    psnr_db: float
    ssim: float
    pixels: int

    @classmethod
    def of(cls, plane: np.ndarray, truth: np.ndarray) -> "Likeness":
        """Compare two planes of one shape. Raises `ValidationError` where there is nothing to compare by."""
        mask = np.isfinite(plane) & np.isfinite(truth)
        plane, truth = (np.where(mask, values, 0.0).astype(float) for values in (plane, truth))
        size = rmse(np.zeros_like(truth), truth, mask)
        if not size > 0:
            raise ValidationError("the second image is zero everywhere, so that no relative error can be given")
        return cls(rmse(plane, truth, mask) / size, psnr(plane, truth, mask), ssim(plane, truth, mask), int(mask.sum()))

    @property
    def text(self) -> str:
        """One line for a reader."""
        return f"relative RMSE {self.relative_rmse:.3g} · PSNR {self.psnr_db:.1f} dB · SSIM {self.ssim:.3f}"
