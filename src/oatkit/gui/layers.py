"""The one place that puts images into a viewer: upright, in mm, in colours that say what is shown."""

import threading
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.gui.looks import Limits, colours_of
from oatkit.gui.stored_planes import StoredPlanes
from oatkit.gui.world import outlines, place, upright
from oatkit.memo import Memo
from oatkit.result import Result

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


class Layers:
    """The layers of one viewer that show images of oatkit; each is known by a key, whatever it is called."""

    def __init__(self, viewer: Any) -> None:
        self.viewer = viewer

    def show(self, image: Image, key: str, name: str | None = None, visible: bool | None = None) -> Any:
        """Show an image under `key`, in place of the one that was shown there, and return its layer.

        The layer's metadata hold the image (``metadata["oatkit"]``: ``key`` and ``image``), so that what it was made of
        is at hand. A boundary becomes a line around the body, an image of one plane a layer of two axes, which is seen
        at every wavelength. Limits that the user has moved stay where they are, relative to the image. Without
        `visible`, what a pipeline makes is seen where it is among `SEEN_AT_FIRST`. Only to be called in the thread of
        the window.
        """
        return self._show(image, _planes(image), {"key": key, "image": image}, name, visible)

    def show_result(self, result: Result, group: str = "") -> None:
        """Show all images of a result; with many frames, along an axis of their own and read when they are looked at.

        The metadata of each layer also hold the `result`, with the pipeline as run, versions and fingerprint. The keys
        are the names of the images; those of another `group` are ``group/name``, so that results lie side by side.
        What the result shown before in the same group had more is taken away.
        """
        names = sorted(result, key=lambda n: BOTTOM_TO_TOP.index(n) if n in BOTTOM_TO_TOP else len(BOTTOM_TO_TOP))
        prefix, title = (f"{group}/", f"{group}: ") if group else ("", "")
        self._remove_old(group, names)
        memo = Memo(KEPT_BYTES)
        for name in names:
            image, key = result[name], prefix + name
            values, more = self._values(result, name, memo)
            about = {"key": key, "image": image, "result": result, **more}
            self._show(image, values, about, title + name.replace("_", " "), None)
        self.select(next((prefix + name for name in ("so2", *names) if name in names), ""))

    def select(self, key: str) -> None:
        """Make the layer of a key the one that the viewer acts on, if it is there."""
        layer = self.find(key)
        if layer is not None:
            self.viewer.layers.selection.active = layer

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
        layer = self.viewer.add_image(
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
        self._below_lines(layer)
        if first:  # napari begins in the middle of every axis
            self.viewer.dims.set_current_step(range(values.ndim - 2), [0] * (values.ndim - 2))
        if active is not None and KEY in active.metadata:
            self.viewer.layers.selection.active = active
        return layer

    def _below_lines(self, layer: Any) -> None:
        """Move a layer below the shapes and points that lie on top of all images."""
        layers = self.viewer.layers
        images = [i for i, other in enumerate(layers) if type(other) is type(layer) and other is not layer]
        layers.move(layers.index(layer), 1 + max(images, default=-1))

    def _replace(self, layer: Any, image: Image, values: Any, about: dict[str, Any]) -> None:
        limits = Limits.of(image)
        about["top"] = limits.high
        moved = layer.contrast_limits[1] / layer.metadata[KEY]["top"]
        where = place(image, values.ndim)
        layer.data, layer.metadata = values, {**layer.metadata, KEY: about}
        layer.scale, layer.translate = where["scale"], where["translate"]
        low, high = (moved * limit for limit in limits)
        layer.contrast_limits_range = (low, high)
        layer.contrast_limits = (low, high)

    def _show_outline(self, image: Image, layer: Any, about: dict[str, Any], look: dict[str, Any]) -> Any:
        lines = outlines(image)
        if layer is None:
            active = self.viewer.layers.selection.active
            layer = self.viewer.add_shapes(
                lines, shape_type="polygon", metadata={KEY: about}, units=("mm", "mm"), axis_labels=("y", "x"),
                face_color="transparent", edge_color="yellow", edge_width=OUTLINE_MM, ndim=2, **look,
            )  # fmt: skip
            if active is not None and KEY in active.metadata:
                self.viewer.layers.selection.active = active
            return layer
        layer.metadata = {**layer.metadata, KEY: about}
        draw_outline(layer, image)
        return layer


def image_of(layer: Any, frame: int) -> Image | str:
    """Return the image that one of our layers shows, or why that frame has none."""
    about: Mapping[str, Any] = layer.metadata[KEY]
    frames: StoredPlanes | None = about.get("frames")
    return frames.image(min(frame, frames.shape[0] - 1)) if frames else about["image"]


def draw_outline(layer: Any, image: Image | None) -> None:
    """Draw the outline of a body, or nothing, into the shapes layer of a boundary."""
    layer.data = []
    if image is not None and (lines := outlines(image)):
        layer.add(lines, shape_type="polygon", edge_width=OUTLINE_MM, edge_color="yellow", face_color="transparent")


def hold_at_zero(event: Any) -> None:
    """Take the lower limit back to zero: negative pixels, and only they, are red."""
    layer = event.source
    low, high = layer.contrast_limits
    held = tuple(Limits.below(high, True)) if high > 0 else (low, high)
    if not np.isclose(low, held[0], rtol=1e-3, atol=0):
        layer.contrast_limits = held


def _planes(image: Image) -> np.ndarray:
    values = upright(image)
    return values[0] if len(values) == 1 else values


def _look(image: Image, key: str, name: str, visible: bool | None) -> dict[str, Any]:
    made_by_a_pipeline = key.rpartition("/")[2] == image.quantity
    seen = not made_by_a_pipeline or image.quantity in SEEN_AT_FIRST if visible is None else visible
    return {"name": name, "visible": seen}
