"""What is looked at: the wavelength in nm, a caption that follows it, and contrast that does not."""

from typing import Any

from psygnal import Signal

from oatkit.data import Image
from oatkit.gui.images.caption import caption, captions
from oatkit.gui.images.layers import BOUNDARY, KEY, Layers, draw_outline, image_of
from oatkit.gui.images.looks import Limits
from oatkit.gui.images.rest import Rest

BOX_BACK_MS = 200
"""After a slider has come to rest."""


class Viewing:
    """Follows the sliders and the layers of one viewer, and moves the sliders to a wavelength."""

    changed = Signal()
    """Another wavelength, frame or layer is looked at, or the wavelengths to choose from are others."""

    def __init__(self, viewer: Any, layers: Layers) -> None:
        self.viewer, self.layers = viewer, layers
        self._held = True
        self.compared: list[Any] = []
        """The layers that lie side by side; none where one picture is seen."""
        self._drawn: dict[str, Any] = {}
        overlays = viewer.canvas.overlays
        overlays.scale_bar.visible = True
        overlays.text.visible = True
        overlays.text.position = "top_left"
        self._rest = Rest(viewer, BOX_BACK_MS, lambda: self._box(True))
        viewer.dims.events.current_step.connect(self._step)
        viewer.layers.selection.events.active.connect(self._follow)
        viewer.layers.events.inserted.connect(self._join)
        viewer.layers.events.removed.connect(self._follow)
        layers.settled.connect(self._follow)

    @property
    def image(self) -> Image | str | None:
        """The image of the layer that is looked at, why it has none, or None where no layer is ours."""
        layer = self._layer()
        return None if layer is None else image_of(layer, self.layers.frame)

    @property
    def wavelengths_nm(self) -> tuple[float, ...]:
        """The wavelengths to choose from: of the layer that is looked at or, where it has one or none, of another."""
        layer = self._layer()
        images = [layer.metadata[KEY]["image"]] if layer is not None else []
        images += [other.metadata[KEY]["image"] for other in self.viewer.layers if KEY in other.metadata]
        return next((image.wavelengths_nm for image in images if len(image.wavelengths_nm) > 1), ())

    @property
    def wavelength_nm(self) -> float | None:
        """The wavelength that is looked at, or None where there is nothing to choose from."""
        wavelengths, plane = self.wavelengths_nm, self.layers.plane
        return wavelengths[plane] if plane < len(wavelengths) else None

    def go_to(self, wavelength_nm: float) -> None:
        """Look at the wavelength that is nearest to the one asked for, if there are any."""
        wavelengths = self.wavelengths_nm
        if wavelengths:
            nearest = min(range(len(wavelengths)), key=lambda i: abs(wavelengths[i] - wavelength_nm))
            self.viewer.dims.set_current_step(self.viewer.dims.ndim - 3, nearest)

    @property
    def contrast_held(self) -> bool:
        """Whether a colour stands for one value at all wavelengths, or each wavelength has limits of its own."""
        return self._held

    @contrast_held.setter
    def contrast_held(self, held: bool) -> None:
        self._held = held
        for layer, _, image in self.layers.shown():
            self._set_limits(layer, image, None if held else self.layers.plane)

    def _join(self, event: Any) -> None:
        event.value.events.metadata.connect(self._follow)  # sent where another image takes the place of one
        self._follow()

    def _step(self, event: Any = None) -> None:
        """Follow a slider; while it runs the caption has no box behind it, whose drawing takes a fifth of a step."""
        if self._rest.is_hurried():
            self._box(False)
        self._follow()

    def _box(self, shown: bool) -> None:
        self.viewer.canvas.overlays.text.box = shown

    def _follow(self, event: Any = None) -> None:
        if self.layers.unsettled:
            return
        self._draw_outlines()
        if not self._held:
            for layer, _, shown in self.layers.shown():
                self._set_limits(layer, shown, self.layers.plane)
        self.show_caption()
        self.changed.emit()

    def show_caption(self) -> None:
        """Say what is looked at."""
        self.viewer.canvas.overlays.text.text = self._caption()

    def _caption(self) -> str:
        frame = self.layers.frame if self.viewer.dims.ndim >= 4 else None
        if self.compared:
            images = {layer.name: image_of(layer, self.layers.frame) for layer in self.compared}
            return captions(images, self.layers.plane, frame)
        image = self.image
        return "" if image is None else caption(image, self.layers.plane, frame)

    def _layer(self) -> Any:
        """Return the selected layer if it is ours, else the topmost visible one, images before lines."""
        active = self.viewer.layers.selection.active
        if active is not None and KEY in active.metadata:
            return active
        ours = [layer for layer in self.viewer.layers if KEY in layer.metadata and layer.visible]
        ours.sort(key=lambda layer: layer.metadata[KEY]["image"].quantity != BOUNDARY)
        return ours[-1] if ours else None

    def _set_limits(self, layer: Any, image: Image, plane: int | None) -> None:
        if image.quantity != BOUNDARY and (plane is None or plane < len(image.values)):
            layer.contrast_limits = tuple(Limits.of(image, plane))

    def _draw_outlines(self) -> None:
        """Let the outlines of a result of many frames follow the frame."""
        for layer in self.viewer.layers:
            about = layer.metadata.get(KEY, {})
            if "frames" in about and about["image"].quantity == BOUNDARY:
                image = image_of(layer, self.layers.frame)
                if self._drawn.get(about["key"]) is not image:
                    self._drawn[about["key"]] = image
                    draw_outline(layer, image if isinstance(image, Image) else None)
