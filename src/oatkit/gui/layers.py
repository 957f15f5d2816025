"""The one place that puts images into a viewer: upright, in mm, in colours that say what is shown."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from oatkit.data import Image

KEY = "oatkit"
"""Of the metadata of our layers."""


class Layers:
    """The layers of one viewer that show images of oatkit; each is known by a key, whatever it is called."""

    def __init__(self, viewer: Any) -> None:
        self.viewer = viewer

    def show(self, image: Image, key: str, name: str | None = None, visible: bool = True) -> Any:
        """Show an image under `key`, in place of the one that was shown there, and return its layer.

        The layer's metadata hold the image (``metadata["oatkit"]``: ``key`` and ``image``), so that what it was made of
        is at hand. Only to be called in the thread of the window.
        """
        about = {KEY: {"key": key, "image": image}}
        layer = self.find(key)
        if layer is not None:
            layer.data, layer.metadata = upright(image), about
            return layer
        y, x = (1e3 * side for side in (image.grid.y_m[-1], image.grid.x_m[0]))
        pixel = 1e3 * image.grid.pixel_size_m
        return self.viewer.add_image(
            upright(image),
            name=name or key.replace("_", " "),
            metadata=about,
            scale=(1, pixel, pixel),
            translate=(0, -y, x),
            units=("pixel", "mm", "mm"),
            axis_labels=("wavelength", "y", "x"),
            visible=visible,
        )

    def find(self, key: str) -> Any:
        """Return the layer of a key, or None."""
        return next((layer for layer, found, _ in self.shown() if found == key), None)

    def shown(self) -> Iterator[tuple[Any, str, Image]]:
        """Yield each of our layers with its key and its image."""
        for layer in self.viewer.layers:
            about = layer.metadata.get(KEY)
            if about:
                yield layer, about["key"], about["image"]


def upright(image: Image) -> np.ndarray:
    """Return the values as viewers draw them: row 0, which lies at the bottom, last."""
    return np.asarray(image.values[:, ::-1])
