"""The regions of interest that the user draws: a layer of shapes with names, as regions of oatkit and back."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from psygnal import Signal

from oatkit.drawing.plot import ON_DARK
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import Layers
from oatkit.gui.regions.corners import region_of, shape_of
from oatkit.shapes import Region

KEY = "regions"
"""Of the layer."""
EDGE_MM = 0.12
"""Width of the lines."""
TEXT = {"string": "{name}", "size": 9, "color": ON_DARK[0], "anchor": "upper_left", "translation": [0.0, 0.0]}
LOOK = {"face_color": "transparent", "edge_width": EDGE_MM, "opacity": 1.0}


class DrawnRegions:
    """The regions drawn in one viewer.

    A region that was put in comes back as it is, to the last bit (viewers keep corners in single precision), until the
    user changes its shape; pixels stay pixels until then.
    """

    changed = Signal()
    """A region came, went, or has another shape, name or colour."""

    def __init__(self, layers: Layers) -> None:
        self.layers = layers
        self._given: dict[tuple[str, bytes], Region] = {}
        """The regions that were put in, by their shape in the viewer."""
        self._layer: Any = None
        self._seen: Any = ()
        self._busy = False
        layers.viewer.layers.events.inserted.connect(self._follow)
        layers.viewer.layers.events.removed.connect(self._follow)
        self._follow()

    def close(self) -> None:
        """Care for the regions no more."""
        self.layers.viewer.layers.events.inserted.disconnect(self._follow)
        self.layers.viewer.layers.events.removed.disconnect(self._follow)
        self._watch(None)

    @property
    def layer(self) -> Any:
        """The layer of the regions, made if it is missing."""
        if self._layer is None:
            features = pd.DataFrame({"name": pd.Series([], dtype=str)})
            self.layers.drawing(KEY, features=features, text=dict(TEXT), edge_color=ON_DARK[0], **LOOK)
        return self._layer

    @property
    def names(self) -> list[str]:
        """The names of all shapes, in the order in which they were drawn; no two are equal."""
        return [] if self._layer is None else [str(name) for name in self._layer.features["name"]]

    @property
    def colours(self) -> list[str]:
        """The colours of all shapes, as ``"#rrggbb"``."""
        edges = [] if self._layer is None else self._layer.edge_color
        return ["#" + "".join(f"{round(255 * float(part)):02x}" for part in edge[:3]) for edge in edges]

    def read(self) -> tuple[list[Region], list[str]]:
        """Return the regions, and a sentence for each shape that is none; one that is being drawn is left out."""
        found: list[Region] = []
        wrong = []
        names = self.names
        for i, name in enumerate(names[:-1] if names and self._layer._is_creating else names):
            try:
                found.append(self._region(i, name))
            except ValidationError as error:
                wrong.append(str(error))
        return found, wrong

    def add(self, regions: Sequence[Region]) -> None:
        """Draw regions, named as they are, with a number where the name is taken.

        Raises `ValidationError`, and draws none, where one has no shape to be drawn.
        """
        shapes = [shape_of(region) for region in regions]
        if not shapes:
            return
        layer, names = self.layer, self.names
        for region, (kind, corners) in zip(regions, shapes, strict=True):
            self._given[kind, np.asarray(corners, np.float32).tobytes()] = region
            names.append(_free(region.name.strip() or "region", names))
        self._busy = True
        try:
            layer.add(
                [corners for _, corners in shapes], shape_type=[kind for kind, _ in shapes],
                edge_color=[ON_DARK[i % len(ON_DARK)] for i in range(layer.nshapes, len(names))],
                face_color="transparent", edge_width=EDGE_MM,
            )  # fmt: skip
            self._name(names)
        finally:
            self._busy = False
        self._look()

    def draw(self, mode: str) -> None:
        """Let the user draw (``"add_polygon"``, ``"add_rectangle"``, ``"add_ellipse"``) or change shapes."""
        layer = self.layer
        layer.visible = True
        self.layers.viewer.layers.selection.active = layer
        layer.mode = mode

    def rename(self, index: int, name: str) -> None:
        """Give a region another name. Raises `ValidationError` for an empty one and for one that is taken."""
        names, name = self.names, name.strip()
        if not name:
            raise ValidationError("a region needs a name")
        if name in names[:index] + names[index + 1 :]:
            raise ValidationError(f"two regions cannot have the name '{name}'")
        self._name([*names[:index], name, *names[index + 1 :]])

    def recolour(self, index: int, colour: str) -> None:
        """Give a region another colour."""
        colours = self.colours
        colours[index] = colour
        self.layer.edge_color = colours
        self._name(self.names)

    def remove(self, index: int) -> None:
        """Take a region away."""
        self.layer.selected_data = {index}
        self.layer.remove_selected()

    def _region(self, index: int, name: str) -> Region:
        kind, corners = self._layer.shape_type[index], self._layer.data[index]
        given: Any = self._given.get((kind, corners.tobytes()))
        return region_of(kind, corners, name) if given is None else replace(given, name=name)

    def _name(self, names: list[str]) -> None:
        layer = self._layer
        if self.names != names:
            layer.features = pd.DataFrame({"name": pd.Series(names, dtype=str)})
        layer.feature_defaults = {"name": _free("region", names)}
        layer.text.color = layer.edge_color
        layer.refresh_text()
        self._look()

    def _follow(self, event: Any = None) -> None:
        """Find the layer again where the user has removed it, or a file brought it."""
        found = self.layers.find_drawing(KEY)
        if found is not self._layer:
            self._watch(found)
            if found is not None:
                self._look()
            else:
                self.changed.emit()

    def _watch(self, layer: Any) -> None:
        if self._layer is not None:
            self._layer.events.data.disconnect(self._look)
            self._layer.events.set_data.disconnect(self._look)
        self._layer, self._seen = layer, ()
        if layer is not None:
            layer.current_edge_width = EDGE_MM
            layer.events.data.connect(self._look)
            layer.events.set_data.connect(self._look)

    def _look(self, event: Any = None) -> None:
        """Name what was drawn, and tell of what has changed; a shape that is being drawn is none yet."""
        layer = self._layer
        if self._busy or layer._is_creating or len(layer.features) != layer.nshapes:
            return
        names: list[str] = []
        for name in self.names:
            names.append(_free(name if name not in ("", "nan") else "region", names))
        if names != self.names or layer.nshapes != len(self._seen):
            self._busy = True
            with layer.block_update_properties():  # else the shape that is selected would change
                layer.current_edge_color = ON_DARK[layer.nshapes % len(ON_DARK)]
            self._name(names)
            self._busy = False
        seen = list(zip(names, layer.shape_type, (line.tobytes() for line in layer.data), self.colours, strict=True))
        if seen != self._seen:
            self._seen = seen
            self.changed.emit()


def _free(name: str, taken: Sequence[str]) -> str:
    """Return a name that is not taken: the one given, or it with the least number that makes it new."""
    if name not in taken and name != "region":
        return name
    return next(new for n in range(1 if name == "region" else 2, len(taken) + 3) if (new := f"{name} {n}") not in taken)
