"""Images beside one another in tiles of the canvas, and back to what was seen before."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from psygnal import Signal

from oatkit.data import Image
from oatkit.gui.images.layers import KEY, Layers
from oatkit.gui.images.looks import Limits
from oatkit.gui.images.viewing import Viewing

LIVE = ("iterate", "preview")
"""Keys of images that come while something is computed: they get a tile beside those of their quantity."""
GAP = 0.01
"""Between tiles, of their width."""
BAR = {"size": (12.0, 90.0), "font_size": 8.0, "position": "bottom_left"}
"""How a colour bar in a tile looks; sizes in dots."""


@dataclass
class Tile:
    """What a layer looked like before it got a tile."""

    image: Image
    """The one that it shows now."""
    limits: tuple[float, ...]
    name: str
    look: Mapping[str, Any]
    bar: Mapping[str, Any]


class SideBySide:
    """One mode of the canvas: each chosen layer in a tile of its own, all others hidden.

    napari moves camera and sliders of all tiles together.
    """

    changed = Signal()
    """The mode began, ended, or shows other layers."""

    def __init__(self, layers: Layers, viewing: Viewing) -> None:
        self.viewer, self.layers, self.viewing = layers.viewer, layers, viewing
        self._tiles: dict[Any, Tile] = {}
        self._before: dict[Any, bool] = {}
        """Of all layers, whether they are seen without the mode."""
        self._keys: list[str] = []
        self._grid: dict[str, Any] = {}
        self._bars, self._active = False, None
        self._linked = True
        self.purpose = ""
        """What the mode that is on was begun for; "" without it."""
        self._busy = False

    @property
    def active(self) -> bool:
        """Whether the mode is on."""
        return bool(self._before)

    @property
    def tiles(self) -> list[Any]:
        """The layers that have a tile."""
        return list(self._tiles)

    @property
    def linked(self) -> bool:
        """Whether one colour stands for one value in all tiles that show the same quantity in the same unit."""
        return self._linked

    @linked.setter
    def linked(self, linked: bool) -> None:
        self._linked = linked
        if self.active:
            self._set_limits()
            self.changed.emit()

    def begin(self, tiles: Mapping[Any, str], purpose: str, bars: bool = False) -> None:
        """Show these layers side by side under their names and hide the others, in place of tiles that are shown.

        With `bars` each has a colour bar, and no caption speaks of one of them.
        """
        self.leave()
        if not tiles:
            return
        self.purpose, self._bars = purpose, bars
        grid = self.viewer.canvas.grid
        self._grid = {name: getattr(grid, name) for name in ("enabled", "stride", "shape", "spacing")}
        self._before = {layer: layer.visible for layer in self.viewer.layers}
        self._keys = [layer.metadata[KEY]["key"] for layer in tiles]
        self._active = self.viewer.layers.selection.active
        self.viewer.layers.selection.active = next(iter(tiles))
        for layer in self.viewer.layers:
            layer.visible = layer in tiles
        for layer, name in tiles.items():
            self._dress(layer, name)
        self._set_limits()
        self.viewer.canvas.overlays.text.position = "bottom_right"  # above the scale bar
        self.viewer.canvas.overlays.text.visible = not bars
        grid.stride, grid.shape, grid.spacing, grid.enabled = 1, (-1, -1), GAP, True
        for event, slot in self._watched():
            event.connect(slot)
        self._tell()
        self.viewer.reset_view()
        self.changed.emit()

    def leave(self, event: Any = None) -> None:
        """End the mode: what was seen before it is seen again, and nothing else.

        The button of napari that takes the tiles away ends it, too.
        """
        if not self.active:
            return
        for event, slot in self._watched():
            event.disconnect(slot)
        before, tiles = self._before, self._tiles
        self._before, self._tiles, self.purpose = {}, {}, ""
        _set(self.viewer.canvas.grid, self._grid)
        self.viewer.canvas.overlays.text.position = "top_left"
        self.viewer.canvas.overlays.text.visible = True
        if self._active in self.viewer.layers:
            self.viewer.layers.selection.active = self._active
        self._active = None
        for layer, tile in tiles.items():
            self._undress(layer, tile)
        for layer, visible in before.items():
            layer.visible = visible
        self._tell()
        self.viewer.reset_view()
        self.changed.emit()

    def _dress(self, layer: Any, name: str) -> None:
        """Write its name on a tile, which nothing lies under, and let its limits lead those of the others."""
        look = {"blending": layer.blending, "opacity": layer.opacity}
        bar = {name: getattr(layer.colorbar, name) for name in ("visible", *BAR)}
        self._tiles[layer] = Tile(layer.metadata[KEY]["image"], tuple(layer.contrast_limits), layer.name, look, bar)
        layer.name, layer.name_overlay.visible = name, True
        layer.blending, layer.opacity = "translucent_no_depth", 1.0
        _set(layer.colorbar, {**BAR, "visible": self._bars})
        layer.events.contrast_limits.connect(self._link)

    def _undress(self, layer: Any, tile: Tile) -> None:
        layer.events.contrast_limits.disconnect(self._link)
        layer.name, layer.name_overlay.visible = tile.name, False
        layer.contrast_limits = tile.limits
        _set(layer, tile.look)
        _set(layer.colorbar, tile.bar)

    def _tell(self) -> None:
        """Let the caption speak of all tiles."""
        self.viewing.compared = self.tiles
        self.viewing.show_caption()

    def _watched(self) -> list[tuple[Any, Callable[..., None]]]:
        """Return what may happen while the mode is on, and what is done then."""
        events = self.viewer.layers.events
        return [(events.inserted, self._take_in), (events.removed, self._drop),
                (self.viewer.canvas.grid.events.enabled, self.leave), (self.viewing.changed, self._follow)]  # fmt: skip

    def _take_in(self, event: Any) -> None:
        """Give a layer that comes a tile where it belongs to those shown, else hide it."""
        layer = event.value
        self._before[layer] = layer.visible
        about = layer.metadata.get(KEY, {})
        shown = {tile.metadata[KEY]["image"].quantity for tile in self._tiles}
        live = about.get("key") in LIVE and about["image"].quantity in shown
        if live or about.get("key") in self._keys:
            self._dress(layer, layer.name)
            self._set_limits()
            self._tell()
        else:
            layer.visible = False

    def _drop(self, event: Any) -> None:
        """Forget a layer that was removed; the last tile ends the mode."""
        self._before.pop(event.value, None)
        if event.value in self._tiles:
            self._tiles.pop(event.value)
            self._tell()
            self.changed.emit()
        if not self._tiles:
            self.leave()

    def _follow(self) -> None:
        """Look for limits again where each wavelength has its own, or a tile shows another image than before."""
        new = {layer: image for layer, tile in self._tiles.items()
               if (image := layer.metadata[KEY]["image"]) is not tile.image}  # fmt: skip
        for layer, image in new.items():
            self._tiles[layer].image, self._tiles[layer].limits = image, tuple(Limits.of(image))
        if new or not self.viewing.contrast_held:
            self._set_limits()

    def _set_limits(self) -> None:
        """Give the tiles the widest of their limits, or each its own."""
        plane = None if self.viewing.contrast_held else self.layers.plane
        found: dict[Any, Limits] = {layer: Limits.of(image, plane) for layer, _, image in self.layers.shown()
                 if layer in self._tiles and (plane is None or plane < len(image.values))}  # fmt: skip
        with self._alone():
            for layer, limits in found.items():
                alike = [found[other] for other in self._alike(layer) if other in found] if self._linked else [limits]
                widest: Limits = max(alike, key=lambda one: one.high)
                layer.contrast_limits = tuple(widest)

    def _link(self, event: Any) -> None:
        """Give the limits that a user has moved to all tiles like the one moved."""
        if not self._linked or self._busy:
            return
        with self._alone():
            for other in self._alike(event.source):
                other.contrast_limits = event.source.contrast_limits

    def _alike(self, layer: Any) -> list[Any]:
        return [other for other in self._tiles if _scale(other) == _scale(layer)]

    @contextmanager
    def _alone(self) -> Iterator[None]:
        self._busy = True
        try:
            yield
        finally:
            self._busy = False


def _set(thing: Any, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        setattr(thing, name, value)


def _scale(layer: Any) -> tuple[str, str]:
    """Return what must be the same where one colour is to stand for one value."""
    image: Image = layer.metadata[KEY]["image"]
    return image.quantity, image.unit
