"""The one place that puts images into a viewer: upright, in mm, in colours that say what is shown."""

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from napari.layers import Image as ImageLayer
from psygnal import Signal

from oatkit.data import Image
from oatkit.gui.images.looks import Limits, colours_of
from oatkit.gui.images.stored_planes import StoredPlanes
from oatkit.gui.images.world import outlines, place, to_world, upright
from oatkit.memo import Memo
from oatkit.result import Result
from oatkit.shapes import Region

KEY = "oatkit"
"""Of the metadata of our layers."""
BOUNDARY = "boundary"
"""The quantity that is shown as a line."""
SEEN_AT_FIRST = ("initial_pressure", BOUNDARY, "so2")
"""Of the images that a pipeline makes; the others wait until they are switched on."""
BOTTOM_TO_TOP = ("initial_pressure", "fluence", "absorption")
"""Then come chromophores and what is derived from them."""
KEPT_BYTES = 512_000_000
"""Of the frames of a stored result that were looked at last."""
OUTLINE_MM = 0.15
"""Width of the line around the body."""
DRAWING = "oatkit drawing"
"""Of the metadata of a layer that the user draws into: its key."""
DRAWN, KEPT = "oatkit drawn", "oatkit kept"
"""Of the metadata of an outline: the lines as we drew them, and whether somebody cares for what the user changes."""


class Layers:
    """The layers of one viewer that show images of oatkit; each is known by a key, whatever it is called."""

    settled = Signal()
    """Many layers have come or gone at once; what looks at them may look again."""

    def __init__(self, viewer: Any) -> None:
        self.viewer = viewer
        self.unsettled = False
        """Whether many layers come or go just now: nothing needs to follow each of them."""

    def show(self, image: Image, key: str, name: str | None = None, visible: bool | None = None) -> Any:
        """Show an image under `key`, in place of the one that was shown there, and return its layer.

        The layer's metadata hold the image (``metadata["oatkit"]``: ``key`` and ``image``), so that what it was made of
        is at hand. A boundary becomes a line around the body, an image of one plane a layer of two axes, which is seen
        at every wavelength. Limits that the user has moved stay where they are, relative to the image. Without
        `visible`, what a pipeline makes is seen where it is among `SEEN_AT_FIRST`. Only to be called in the thread of
        the window.
        """
        return self._show(image, _planes(image), {"key": key, "image": image}, name, visible)

    def show_result(self, result: Result, group: str = "", visible: bool | None = None) -> None:
        """Show all images of a result; with many frames, along an axis of their own and read when they are looked at.

        The metadata of each layer also hold the `result`, with the pipeline as run, versions and fingerprint. The keys
        are the names of the images; those of another `group` are ``group/name``, so that results lie side by side.
        What the result shown before in the same group had more is taken away. `visible` is that of `show`; a result
        that is not to be seen leaves the layer selected that was.
        """
        names = sorted(result, key=_height)
        memo = Memo(KEPT_BYTES)
        with self.together():
            self._remove_old(group, names)
            for name in names:
                values, more = self._values(result, name, memo)
                about = {"key": key_of(group, name), "image": result[name], "result": result, **more}
                self._show(result[name], values, about, title_of(group, name), visible)
            if visible is not False:
                self.select(next((key_of(group, name) for name in ("so2", *names) if name in names), ""))

    def show_images(self, images: Mapping[str, Sequence[Image]], group: str, visible: bool | None = None) -> None:
        """Show images that no pipeline made, each with one for each frame, under keys as those of a result.

        Raises what reading the first frame of one raises.
        """
        memo = Memo(KEPT_BYTES)
        firsts = {name: frames[0] for name, frames in images.items() if len(frames)}
        with self.together():
            for name, first in firsts.items():
                frames = images[name]
                name = name.replace("/", " ")  # of a key it would divide group and name
                about = {"key": key_of(group, name), "image": first}
                values: Any = _planes(first)
                if len(frames) > 1:
                    values = StoredPlanes(frames.__getitem__, len(frames), first, len(first.values), memo)
                    about["frames"] = values
                self._show(first, values, about, title_of(group, name), visible)

    def show_outlines(self, regions: Sequence[Region], key: str, name: str, visible: bool = True) -> None:
        """Draw the outlines that regions have, with their names, in place of those under the same key."""
        drawn = [region for region in regions if len(region.outline_m)]
        self.remove_drawing(key)
        if drawn:
            layer = self.drawing(key, name=name, visible=visible)
            layer.add(
                [to_world(region.outline_m) for region in drawn],
                shape_type="polygon", edge_width=OUTLINE_MM, edge_color="orange", face_color="transparent",
            )  # fmt: skip
            layer.features = {"name": [region.name for region in drawn]}
            layer.text = {"string": "{name}", "size": 8, "color": "orange", "anchor": "upper_left"}

    def remove_drawing(self, key: str) -> None:
        """Remove a layer of shapes, if it is there."""
        layer = self.find_drawing(key)
        if layer is not None:
            self.viewer.layers.remove(layer)

    @contextmanager
    def together(self) -> Iterator[None]:
        """Let many layers come or go as one: what follows the layers looks at them once, at the end."""
        if self.unsettled:
            yield
            return
        layers = self.viewer.layers
        self.unsettled = True
        # Else napari shows the controls of each new layer for a moment, which takes half of the time.
        layers._activate_on_insert = False
        try:
            yield
        finally:
            layers._activate_on_insert = True
            self.unsettled = False
            if layers and layers.selection.active is None:
                layers.selection.active = layers[-1]
            self.settled.emit()

    def groups(self) -> dict[str, dict[str, Any]]:
        """Return the layers of results by group and name of the image, bottom first; the newest result has no group."""
        found: dict[str, dict[str, Any]] = {}
        for layer in self._ours():
            group, _, name = layer.metadata[KEY]["key"].rpartition("/")
            if group or "result" in layer.metadata[KEY]:
                found.setdefault(group, {})[name] = layer
        return found

    def rename_group(self, old: str, new: str) -> None:
        """Call a group otherwise."""
        for name, layer in self.groups().get(old, {}).items():
            layer.metadata = {**layer.metadata, KEY: {**layer.metadata[KEY], "key": key_of(new, name)}}
            layer.name = title_of(new, name)

    def remove_group(self, group: str) -> None:
        """Remove all layers of a group; with "" all that belong to none: the newest result and what was made of it."""
        with self.together():
            for layer in list(self._ours()):
                if layer.metadata[KEY]["key"].rpartition("/")[0] == group:
                    self.viewer.layers.remove(layer)

    def select(self, key: str) -> None:
        """Make the layer of a key the one that the viewer acts on, if it is there."""
        layer = self.find(key)
        if layer is not None:
            self.viewer.layers.selection.active = layer

    def drawing(self, key: str, **look: Any) -> Any:
        """Return the layer of shapes that the user draws into; if missing it is made with `look`, as of ``add_shapes``.

        It lies in mm as all layers do, shows no image, and is none of those that `find` and `shown` know.
        """
        layer = self.find_drawing(key)
        if layer is None:
            active = self.viewer.layers.selection.active
            layer = self.viewer.add_shapes(
                ndim=2, metadata={DRAWING: key}, units=("mm", "mm"), axis_labels=("y", "x"), **{"name": key} | look
            )
            self.viewer.layers.selection.active = active or layer
        return layer

    def find_drawing(self, key: str) -> Any:
        """Return the layer that the user draws into, or None."""
        return next((layer for layer in self.viewer.layers if layer.metadata.get(DRAWING) == key), None)

    def find(self, key: str) -> Any:
        """Return the layer of a key, or None."""
        return next((layer for layer in self._ours() if layer.metadata[KEY]["key"] == key), None)

    def remove(self, key: str) -> None:
        """Remove the layer of a key, if it is there."""
        layer = self.find(key)
        if layer is not None:
            self.viewer.layers.remove(layer)

    def shown(self) -> Iterator[tuple[Any, str, Image]]:
        """Yield each of our layers with its key and its image, of many frames the one looked at, if it has values."""
        for layer in list(self._ours()):
            image = image_of(layer, self.frame)
            if isinstance(image, Image):
                yield layer, layer.metadata[KEY]["key"], image

    @property
    def frame(self) -> int:
        """Which frame of a result of many frames is looked at."""
        return int(self.viewer.dims.current_step[-4]) if self.viewer.dims.ndim >= 4 else 0

    @property
    def plane(self) -> int:
        """Which wavelength is looked at, as an index."""
        return int(self.viewer.dims.current_step[-3]) if self.viewer.dims.ndim >= 3 else 0

    def _ours(self) -> Iterator[Any]:
        return (layer for layer in self.viewer.layers if KEY in layer.metadata)

    def _remove_old(self, group: str, names: list[str]) -> None:
        for layer in list(self._ours()):
            of, _, name = layer.metadata[KEY]["key"].rpartition("/")
            if "result" in layer.metadata[KEY] and of == group and name not in names:
                self.viewer.layers.remove(layer)

    def _values(self, result: Result, name: str, memo: Memo) -> tuple[Any, dict[str, Any]]:
        """Return what napari shows of an image of a result, and of many frames, where to look for the others."""
        if result.frames == 1:
            return _planes(result[name]), {}
        stored: Any = result.stored
        most = max(len(image.values) for image in result.values())
        frames = StoredPlanes(lambda index: stored.image(index, name), result.frames, result[name], most, memo)
        return frames, {"frames": frames}

    def _show(self, image: Image, values: Any, about: dict[str, Any], name: str | None, visible: bool | None) -> Any:
        assert threading.current_thread() is threading.main_thread(), "layers belong to the thread of the window"
        key = about["key"]
        name = name or key.replace("_", " ")
        layer, look = self.find(key), _look(image, key, name, visible)
        if image.quantity == BOUNDARY:
            return self._show_outline(image, layer, about, look)
        if layer is not None and (layer.ndim, layer.metadata[KEY]["image"].quantity) != (values.ndim, image.quantity):
            self.viewer.layers.remove(layer)
            layer = None
        if layer is None:
            return self._add_image(image, values, about, look)
        self._replace(layer, image, values, about)
        return layer

    def _add_image(self, image: Image, values: Any, about: dict[str, Any], look: dict[str, Any]) -> Any:
        active, first = self.viewer.layers.selection.active, not self.viewer.layers
        limits, colours = Limits.of(image), colours_of(image)
        about["top"] = limits.high
        layer = ImageLayer(
            values,
            metadata={KEY: about},
            colormap=colours,
            contrast_limits=tuple(limits),
            multiscale=False,
            rgb=False,
            **place(image, values.ndim),
            **look,
        )
        if colours.low_color is not None:
            layer.events.contrast_limits.connect(hold_at_zero)
        self.viewer.layers.insert(self._below_lines(), layer)
        if first:  # napari begins in the middle of every axis
            self.viewer.dims.set_current_step(range(values.ndim - 2), [0] * (values.ndim - 2))
        if active is not None and KEY in active.metadata:
            self.viewer.layers.selection.active = active
        return layer

    def _below_lines(self) -> int:
        """Return the place on top of all images, below the shapes and points that lie over them."""
        return 1 + max((i for i, layer in enumerate(self.viewer.layers) if isinstance(layer, ImageLayer)), default=-1)

    def _replace(self, layer: Any, image: Image, values: Any, about: dict[str, Any]) -> None:
        limits = Limits.of(image)
        about["top"] = limits.high
        moved = layer.contrast_limits[1] / layer.metadata[KEY]["top"]
        where = place(image, values.ndim)
        layer.data, layer.metadata = values, {**layer.metadata, KEY: about}
        for name in ("scale", "translate"):
            if not np.array_equal(getattr(layer, name), where[name]):  # each costs napari as much as other values
                setattr(layer, name, where[name])
        low, high = (moved * limit for limit in limits)
        layer.contrast_limits_range = (low, high)
        layer.contrast_limits = (low, high)

    def _show_outline(self, image: Image, layer: Any, about: dict[str, Any], look: dict[str, Any]) -> Any:
        if layer is None:
            active = self.viewer.layers.selection.active
            layer = self.viewer.add_shapes(
                metadata={KEY: about}, units=("mm", "mm"), axis_labels=("y", "x"), ndim=2,
                face_color="transparent", edge_color="yellow", edge_width=OUTLINE_MM, **look,
            )  # fmt: skip
            if active is not None and KEY in active.metadata:
                self.viewer.layers.selection.active = active
            draw_outline(layer, image)
            return layer
        layer.metadata = {**layer.metadata, KEY: about}
        draw_outline(layer, image)
        return layer


def key_of(group: str, name: str) -> str:
    """Return the key of an image of a group."""
    return f"{group}/{name}" if group else name


def title_of(group: str, name: str) -> str:
    """Return how the layer of an image of a group is called."""
    words = name.replace("_", " ")
    return f"{group}: {words}" if group else words


def image_of(layer: Any, frame: int) -> Image | str:
    """Return the image that one of our layers shows, or why that frame has none."""
    about: Mapping[str, Any] = layer.metadata[KEY]
    frames: StoredPlanes | None = about.get("frames")
    return frames.image(min(frame, frames.shape[0] - 1)) if frames else about["image"]


def draw_outline(layer: Any, image: Image | None) -> None:
    """Draw the outline of a body, or nothing, into the shapes layer of a boundary.

    An outline that the user has changed stays as it is where somebody takes care of it.
    """
    if not (layer.metadata.get(KEPT) and is_edited(layer)):
        draw_lines(layer, [] if image is None else outlines(image))


def draw_lines(layer: Any, lines: Sequence[np.ndarray]) -> None:
    """Draw closed lines, in the viewer's mm, in place of all that a layer of shapes shows."""
    layer.metadata[DRAWN] = [np.asarray(line, np.float32) for line in lines]
    layer.selected_data = set(range(layer.nshapes))
    layer.remove_selected()
    if lines:
        layer.add(
            list(lines), shape_type="polygon", edge_width=OUTLINE_MM, edge_color="yellow", face_color="transparent"
        )


def is_edited(layer: Any) -> bool:
    """Say whether an outline is not the one that we drew; one that was removed is not edited."""
    drawn = layer.metadata.get(DRAWN, [])
    return layer.nshapes > 0 and (layer.nshapes != len(drawn) or not all(map(np.array_equal, layer.data, drawn)))


def hold_at_zero(event: Any) -> None:
    """Take the lower limit back to zero: negative pixels, and only they, are red."""
    layer = event.source
    low, high = layer.contrast_limits
    held = tuple(Limits.below(high, True)) if high > 0 else (low, high)
    if not np.isclose(low, held[0], rtol=1e-3, atol=0):
        layer.contrast_limits = held


def _height(name: str) -> int:
    return BOTTOM_TO_TOP.index(name) if name in BOTTOM_TO_TOP else len(BOTTOM_TO_TOP)


def _planes(image: Image) -> np.ndarray:
    values = upright(image)
    return values[0] if len(values) == 1 else values


def _look(image: Image, key: str, name: str, visible: bool | None) -> dict[str, Any]:
    made_by_a_pipeline = key.rpartition("/")[2] == image.quantity
    seen = not made_by_a_pipeline or image.quantity in SEEN_AT_FIRST if visible is None else visible
    return {"name": name, "visible": seen}
