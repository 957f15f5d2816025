"""The unmixing view: a map of what the blood and the tissue hold, in colours, over the grey image of the anatomy."""

from dataclasses import replace
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.gui.images.caption import SHOWN_WHERE
from oatkit.gui.images.layers import KEY, image_of
from oatkit.gui.images.looks import CHROMOPHORES
from oatkit.gui.workbench import Workbench
from oatkit.words import FRACTIONS

ANATOMY = ("initial_pressure", "absorption")
"""What maps lie over: the first that there is."""
BLOOD = "so2_in_blood"
"""Key of the saturation with the rest of the image left out."""
MAPS = "maps"
"""What the tiles are for."""
SO2, HAEMOGLOBIN = "so2", "total_haemoglobin"


class Unmixing:
    """Which map of which result is seen in one viewer, and how."""

    def __init__(self, bench: Workbench) -> None:
        self.bench, self.layers = bench, bench.layers
        self._group = ""
        self._opacity = 1.0
        self._percent: float | None = None
        self._masked: tuple[Image, Image, float] | None = None
        """What the layer of `BLOOD` was made of."""
        bench.viewing.changed.connect(self._follow)

    def close(self) -> None:
        """Follow the viewer no more."""
        self.bench.viewing.changed.disconnect(self._follow, missing_ok=True)

    @property
    def groups(self) -> list[str]:
        """The results that hold maps."""
        return sorted(group for group, layers in self.layers.groups().items() if _maps(layers))

    @property
    def group(self) -> str:
        """The result whose maps are seen: the one that was chosen or, where it is gone, the first that has some."""
        groups = self.groups
        return self._group if self._group in groups or not groups else groups[0]

    @group.setter
    def group(self, group: str) -> None:
        shown = self.shown
        self._group = group
        self.show(shown if shown in self.maps else "")

    @property
    def maps(self) -> dict[str, Any]:
        """The layers of the maps of that result by the name of their image; chromophores come first."""
        layers = self.layers.groups().get(self.group, {})
        return dict(sorted(_maps(layers).items(), key=lambda entry: _quantity(entry[1]) in (SO2, HAEMOGLOBIN)))

    @property
    def shown(self) -> str:
        """The map that is seen on top, or ""."""
        blood = self.layers.find(BLOOD)
        if blood is not None and blood.visible:
            return next((name for name, layer in self.maps.items() if _quantity(layer) == SO2), "")
        return next((name for name, layer in reversed(self.maps.items()) if layer.visible), "")

    def show(self, name: str) -> None:
        """Show one map over the anatomy, or with "" the anatomy alone; other images are hidden, outlines are not."""
        self.bench.side_by_side.leave()
        chosen = self.maps.get(name)
        seen = [self._anatomy(), self._top(chosen)]
        for layer in self.bench.viewer.layers:
            if KEY in layer.metadata and hasattr(layer, "colormap"):
                layer.visible = any(layer is one for one in seen)
                layer.colorbar.position, layer.colorbar.visible = "bottom_left", layer is seen[1]
        if seen[1] is not None:
            seen[1].opacity = self._opacity
        active = seen[1] if seen[1] is not None else seen[0]
        if active is not None:
            self.bench.viewer.layers.selection.active = active
        self.bench.viewing.changed.emit()

    def show_side_by_side(self) -> None:
        """Show all maps side by side."""
        names = {layer: layer.name if self.group else short(name) for name, layer in self.maps.items()}
        self.bench.side_by_side.begin(names, MAPS, bars=True)

    @property
    def is_beside(self) -> bool:
        """Whether all maps are shown side by side."""
        return self.bench.side_by_side.purpose == MAPS

    @property
    def opacity(self) -> float:
        """Of the map that is seen, 0 .. 1."""
        return self._opacity

    @opacity.setter
    def opacity(self, opacity: float) -> None:
        self._opacity = opacity
        top = self._top(self.maps.get(self.shown))
        if top is not None:
            top.opacity = opacity

    @property
    def blood_percent(self) -> float | None:
        """Above how many percent of the most haemoglobin saturation is shown; None where it is shown everywhere."""
        return self._percent

    @blood_percent.setter
    def blood_percent(self, percent: float | None) -> None:
        saturation = next((name for name, layer in self.maps.items() if _quantity(layer) == SO2), "")
        shown = self.shown
        self._percent = percent
        if saturation and (percent is not None or shown == saturation):
            self.show(saturation)
        if percent is None:
            self.layers.remove(BLOOD)

    @property
    def trust(self) -> str:
        """What is to be known of the map that is seen before it is believed; "" where none is."""
        if not self.shown:
            return ""
        layer = self.maps[self.shown]
        images = [image for _, image in self._images()]
        return " ".join(trust(layer.metadata[KEY]["image"], images))

    def _images(self) -> list[tuple[str, Image]]:
        layers = self.layers.groups().get(self.group, {})
        found = [(name, image_of(layer, self.layers.frame)) for name, layer in layers.items()]
        return [(name, image) for name, image in found if isinstance(image, Image)]

    def _anatomy(self) -> Any:
        layers = self.layers.groups().get(self.group, {}).values()
        return next((layer for quantity in ANATOMY for layer in layers if _quantity(layer) == quantity), None)

    def _top(self, layer: Any) -> Any:
        """Return the layer that stands for a map: for saturation in blood only, one of its own."""
        if layer is None or self._percent is None or _quantity(layer) != SO2:
            return layer
        self._show_blood(self._percent)
        return self.layers.find(BLOOD) or layer

    def _show_blood(self, percent: float) -> None:
        by_quantity = {image.quantity: image for _, image in self._images()}
        so2, total = by_quantity.get(SO2), by_quantity.get(HAEMOGLOBIN)
        if so2 is None or total is None:
            self.layers.remove(BLOOD)
            self._masked = None
        elif self.layers.find(BLOOD) is None or self._masked is None or not _same(self._masked, (so2, total, percent)):
            self._masked = (so2, total, percent)  # first, since what is shown is followed
            self.layers.show(in_blood(so2, total, percent), BLOOD, visible=True)

    def _follow(self) -> None:
        """Leave out what has no blood in the frame looked at, too."""
        blood = self.layers.find(BLOOD)
        if self._percent is not None and blood is not None and blood.visible:
            self._show_blood(self._percent)


def in_blood(so2: Image, total: Image, percent: float) -> Image:
    """Return a saturation without the pixels whose haemoglobin is not above a share of its maximum: to look at."""
    values = total.values[0]
    finite = values[np.isfinite(values)]
    least = percent / 100 * float(finite.max()) if finite.size else 0.0
    words = f"total Hb > {percent:g} % of maximum"
    step = {"step": "display", "above_total_haemoglobin": least, "unit": total.unit}
    return replace(
        so2,
        values=np.where(values > least, so2.values, so2.values.dtype.type("nan")),
        history=(*so2.history, step),
        diagnostics={**so2.diagnostics, SHOWN_WHERE: words},
    )


def trust(image: Image, images: list[Image]) -> list[str]:
    """Return sentences on a map: what it was fitted to, how well, and what the methods said of it."""
    said = []
    fitted = image.diagnostics.get("fitted_to")
    if fitted == "initial_pressure":
        said.append("Fitted to the initial pressure, which the light colours: only differences at like depth count.")
    elif fitted:
        said.append(f"Fitted to the {fitted}{', in arbitrary units' if _is_relative(images) else ''}.")
    misfit = next((one.values for one in images if one.quantity == "residual"), None)
    if misfit is not None and np.isfinite(misfit).any():
        said.append(f"The fit misses {100 * float(np.nanmedian(misfit)):.1f} % of the data in the median.")
    notes = {note: None for one in images if _is_map(one) for note in one.diagnostics.get("notes", ())}
    if any(one.diagnostics.get("settled") is False for one in images):
        said.append("The light had not settled.")
    return [*said, *map(_sentence, notes)]


def short(name: str) -> str:
    """Return the name of a map as buttons and tiles have room for it."""
    return name.replace("haemoglobin", "Hb").replace("_", " ")


def _is_relative(images: list[Image]) -> bool:
    return any(one.quantity == "absorption" and one.unit == "a.u." for one in images)


def _sentence(note: str) -> str:
    return f"{note[:1].upper()}{note[1:].rstrip('.')}."


def _quantity(layer: Any) -> str:
    return layer.metadata[KEY]["image"].quantity


def _maps(layers: dict[str, Any]) -> dict[str, Any]:
    return {name: layer for name, layer in layers.items() if _is_map(layer.metadata[KEY]["image"])}


def _is_map(image: Image) -> bool:
    known = image.quantity in (*CHROMOPHORES, *FRACTIONS, HAEMOGLOBIN) or "fitted_to" in image.diagnostics
    return known and image.quantity != "residual"


def _same(one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    return one[0] is other[0] and one[1] is other[1] and one[2] == other[2]
