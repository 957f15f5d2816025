"""The places that are probed, as shapes that the user sees and moves. No Qt."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from psygnal import Signal

from oatkit.drawing.plot import ON_DARK
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import Layers
from oatkit.gui.images.world import from_world
from oatkit.gui.probe.probe import LIVE
from oatkit.gui.regions.corners import region_of, shape_of
from oatkit.regions import EllipseRegion, Region
from oatkit.regions.profile import Point

KEY = "probe"
PLACE = "place"
"""The feature of a shape that holds its number; empty for the one that moves with the mouse."""
WIDTH_MM = 0.12
TEXT = {"string": "{place}", "size": 11, "color": "white", "anchor": "upper_left"}


@dataclass(frozen=True, eq=False)
class Drawn:
    """A shape of the layer."""

    kind: str
    corners_mm: np.ndarray
    place: str

    @property
    def is_line(self) -> bool:
        """Whether it is a line, along which there is a profile, and no region."""
        return self.kind == "line"

    @property
    def colour(self) -> str:
        """Its colour: that of its curves in a plot."""
        return ON_DARK[colour_of(self.place or LIVE) % len(ON_DARK)]


def colour_of(place: str) -> int:
    """Return the number of the colour of a place."""
    return 0 if place == LIVE else int(place)


class ProbeLayer:
    """The shapes of one viewer that say what is probed: one that is live, one line, and those that are pinned."""

    changed = Signal()
    """Shapes were drawn, moved or removed."""

    def __init__(self, layers: Layers) -> None:
        self._layers = layers
        self._watched: Any = None
        self._before: Any = None
        """The layer that was selected before this one."""
        self._drawing = False
        self.layer()

    def layer(self) -> Any:
        """Return the layer, or None where there is none yet or the user has removed it."""
        layer = self._layers.find_drawing(KEY)
        if layer is not None and layer is not self._watched:
            self._watched, self._drawing = layer, False
            layer.events.data.connect(self._follow)
            layer.events.set_data.connect(self._tell)
        return layer

    def open(self) -> Any:
        """Return the layer, made where it is missing."""
        if self.layer() is None:
            nothing = {PLACE: np.array([], dtype=object)}
            look = {"face_color": "transparent", "edge_color": ON_DARK[0], "edge_width": WIDTH_MM, "opacity": 1.0}
            self._layers.drawing(KEY, name="probe", features=nothing, text=TEXT, **look)
        return self.layer()

    def places(self) -> list[Region]:
        """Return the live place and the pinned ones; what encloses nothing (yet) is left out."""
        found = []
        for shape in _newest(self._shapes()):
            if not shape.is_line:
                try:
                    found.append(region_of(shape.kind, shape.corners_mm, shape.place or LIVE))
                except ValidationError:
                    continue
        return found

    def line(self) -> tuple[Point, Point] | None:
        """Return the ends of the line, m."""
        lines = [shape for shape in self._shapes() if shape.is_line]
        if not lines or np.array_equal(*lines[-1].corners_mm):
            return None
        (y0, x0), (y1, x1) = from_world(lines[-1].corners_mm).tolist()
        return (y0, x0), (y1, x1)

    def show(self, region: Region) -> None:
        """Make a region the live place."""
        layer, shapes = self.open(), self._shapes()
        live = next((i for i, shape in enumerate(shapes) if not shape.place and not shape.is_line), None)
        kind, corners = shape_of(region)
        if live is not None and shapes[live].kind == kind:
            layer.data = [corners if i == live else shape.corners_mm for i, shape in enumerate(shapes)]
        else:
            kept = [shape for i, shape in enumerate(shapes) if i != live]
            self._write([*kept, Drawn(kind, corners, "")])

    def point(self, centre_m: Point, radius_m: float) -> None:
        """Make a small disc the live place."""
        self.show(EllipseRegion(LIVE, centre_m, (radius_m, radius_m)))

    def pinned(self) -> list[str]:
        """Return the names of the pinned places."""
        return [shape.place for shape in self._shapes() if shape.place]

    def pin(self) -> str | None:
        """Keep the live place under the lowest number that is free, and return it; None where nothing is live."""
        shapes, taken = self._shapes(), self.pinned()
        name = next(str(n) for n in range(1, len(taken) + 2) if str(n) not in taken)
        for i, shape in enumerate(shapes):
            if not shape.place and not shape.is_line:
                shapes[i] = replace(shape, place=name)
                self._write(shapes)
                return name
        return None

    def unpin(self, names: Sequence[str]) -> None:
        """Remove pinned places."""
        self._write([shape for shape in self._shapes() if shape.place not in names])

    def tidy(self) -> None:
        """Remove what a shape that was just drawn takes the place of."""
        shapes = self._shapes()
        kept = _newest(shapes)
        if not self._drawing and len(kept) < len(shapes):
            self._write(kept)

    def use(self, tool: str) -> None:
        """Let the user draw, or move, with one of the tools of the layer; ``"pan_zoom"`` lets go of it."""
        if tool == "pan_zoom":
            self._let_go()
            return
        layer, selection = self.open(), self._layers.viewer.layers.selection
        if selection.active is not layer:
            self._before, selection.active = selection.active, layer
        layer.selected_data = set()  # what is drawn next looks like what is selected
        layer.current_edge_color, layer.current_edge_width = ON_DARK[0], WIDTH_MM
        layer.mode = tool

    def _let_go(self) -> None:
        layer, layers = self.layer(), self._layers.viewer.layers
        if layer is not None:
            layer.mode = "pan_zoom"
            if layers.selection.active is layer and self._before in layers:
                layers.selection.active = self._before

    def _shapes(self) -> list[Drawn]:
        layer = self.layer()
        if layer is None:
            return []
        names = [name if isinstance(name, str) else "" for name in layer.features.get(PLACE, [])]
        names += [""] * (layer.nshapes - len(names))
        if self._drawing and names:
            names[-1] = ""  # a shape takes over the features of the one that was selected
        corners = [np.asarray(corners, float) for corners in layer.data]
        return [Drawn(*about) for about in zip(map(str, layer.shape_type), corners, names, strict=True)]

    def _write(self, shapes: Sequence[Drawn]) -> None:
        layer = self.open()
        with layer.events.data.blocker(), layer.events.set_data.blocker():
            layer.selected_data = set(range(layer.nshapes))
            layer.remove_selected()
            if shapes:
                layer.add(
                    [(shape.corners_mm, shape.kind) for shape in shapes],
                    edge_color=[shape.colour for shape in shapes], edge_width=WIDTH_MM, face_color="transparent",
                )  # fmt: skip
        layer.features = {PLACE: np.array([shape.place for shape in shapes], dtype=object)}
        layer.feature_defaults = {PLACE: ""}
        layer.refresh()

    def _follow(self, event: Any) -> None:
        action = str(event.action)
        self._drawing = action == "adding"
        self._tell()

    def _tell(self, event: Any = None) -> None:
        self.changed.emit()


def _newest(shapes: Sequence[Drawn]) -> list[Drawn]:
    """Return the pinned shapes, and of those that are not the newest region and the newest line."""
    last = {shape.is_line: i for i, shape in enumerate(shapes) if not shape.place or shape.is_line}
    return [shape for i, shape in enumerate(shapes) if (shape.place and not shape.is_line) or last[shape.is_line] == i]
