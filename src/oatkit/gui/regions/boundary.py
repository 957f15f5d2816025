"""The outline of the body, edited by hand: what is drawn, what was changed, and how it comes into the pipeline."""

from typing import Any

import numpy as np
from psygnal import Signal

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import BOUNDARY, DRAWN, KEPT, KEY, draw_lines, image_of, is_edited
from oatkit.gui.images.world import from_world, outlines, to_world
from oatkit.gui.regions.corners import region_of
from oatkit.gui.workbench import Workbench
from oatkit.pipeline import Pipeline
from oatkit.polygons import area
from oatkit.shapes import EllipseRegion

MANY = 60
"""Corners of an outline above which it is simplified for editing, as far as `NEAR` allows."""
NEAR = 0.4
"""How far a simplified outline may leave the one that was drawn, pixels; that leaves the contour by 0.1 at most."""
STEPS = (0.15, 0.2, 0.3, NEAR)
"""Tolerances of the simplification that are tried in turn, pixels."""
ROUND = 64
"""Corners of the outline of an ellipse: a circle of 10 mm is left by 0.012 mm at most."""
DECIMALS = 4
"""Of the corners in the pipeline, mm."""
EDITING = ("direct", "vertex_insert", "vertex_remove")
"""Modes of a layer of shapes in which corners are moved."""
NONE = "no outline to edit: run a pipeline with a Segment step, or draw one"
OPEN = "a line encloses nothing: draw a polygon, a rectangle or an ellipse around the body"

SEVERAL = "Of several outlines one was taken: the newest, or the one that encloses most."
STORED = "The outline is in the pipeline; here that of the stored result is shown."
GONE = "The outline that was changed by hand is gone with its image."


class Outline:
    """The outline that is shown in one viewer, which the user may change.

    Where the pipeline holds an outline by hand that one is drawn, else the one that was found last. What the user has
    changed stays as it is, whatever is computed meanwhile, until it is taken or put back.
    """

    changed = Signal()
    """An outline was changed, taken, put back, or is gone."""

    def __init__(self, bench: Workbench) -> None:
        self.bench, self.word = bench, ""
        """What happened last, in a sentence."""
        self._joined: list[Any] = []
        self._drawing = False
        layers = bench.viewer.layers
        self._watched = (
            (layers.events.inserted, self._inserted),
            (layers.events.removed, self._removed),
            (layers.selection.events.active, self._selected),
            (bench.pipeline_changed, self.refresh),
            (bench.result_changed, self.refresh),
        )
        for signal, slot in self._watched:
            signal.connect(slot)
        for layer in layers:
            self._join(layer)

    def close(self) -> None:
        """Care for the outline no more."""
        for signal, slot in self._watched:
            signal.disconnect(slot)
        for layer in list(self._joined):
            self._leave(layer)

    @property
    def layer(self) -> Any:
        """The layer of the outline: the selected one if it is an outline, else that of the last run, else any."""
        active = self.bench.viewer.layers.selection.active
        if active in self._joined:
            return active
        return self._own() or (self._joined[-1] if self._joined else None)

    @property
    def edited(self) -> bool:
        """Whether the user has changed it since it was drawn, taken or put back."""
        return self.layer is not None and is_edited(self.layer)

    @property
    def at_work(self) -> bool:
        """Whether the user is in the midst of drawing a new outline."""
        return self.layer is not None and bool(self.layer._is_creating)

    @property
    def corners_mm(self) -> np.ndarray:
        """The corners of the outline as it is drawn now, each ``(y, x)``, y upwards.

        A new outline stands for the old one; else, of several, the one that encloses most. Raises `ValidationError`
        where none is drawn.
        """
        layer = self.layer
        if layer is None or not layer.nshapes:
            raise ValidationError(NONE)
        lines = [_corners_mm(*shape) for shape in zip(layer.shape_type, layer.data, strict=True)]
        new = layer.nshapes > len(layer.metadata.get(DRAWN, []))
        return lines[-1] if new else max(lines, key=lambda line: abs(area(line)))

    def take(self) -> None:
        """Put the outline that is drawn into the pipeline, as one edit that can be undone, and tell everybody.

        It is drawn in the layer of the last run from then on; that of another result goes back to what it was. Raises
        `ValidationError` where it encloses nothing, crosses itself or has too many corners.
        """
        layer = self.layer
        _finish(layer)
        corners = self.corners_mm
        several = layer.nshapes > 1
        self.bench.session.document.put("segment", {"use": "polygon", "vertices": corners.tolist()})
        self._draw(layer)
        if layer is not (own := self._made()):
            self.bench.viewer.layers.selection.active = own
            self._draw(own)
        self.word = SEVERAL if several else STORED if "frames" in own.metadata[KEY] else ""
        self.bench.pipeline_changed.emit()

    def put_back(self) -> None:
        """Draw the outline again that the pipeline holds or that was found last."""
        self.word = ""
        if self.layer is not None:
            _finish(self.layer)
            self._draw(self.layer)
        self.changed.emit()

    def refresh(self) -> None:
        """Draw what the pipeline or the last result says, unless the user has changed the outline."""
        own = self._own()
        if own is not None and not is_edited(own):
            self._draw(own)
        self.changed.emit()

    def edit(self) -> None:
        """Let the user move the corners of the outline. Raises `ValidationError` where there is none."""
        layer = self.layer
        if layer is None or not layer.nshapes:
            raise ValidationError(NONE)
        self._begin(layer, "direct")
        layer.selected_data = {layer.nshapes - 1}

    def draw_anew(self) -> None:
        """Let the user draw an outline, also where there was none."""
        self._begin(self._made(), "add_polygon")

    def _begin(self, layer: Any, mode: str) -> None:
        layer.visible = True
        self.bench.viewer.layers.selection.active = layer
        layer.mode = mode

    def _own(self) -> Any:
        return self.bench.layers.find(BOUNDARY)

    def _made(self) -> Any:
        """Return the layer of the last run; one without a body where there is none."""
        if self._own() is None:
            images = [image for _, _, image in self.bench.layers.shown()]
            grid = images[-1].grid if images else self.bench.session.pipeline.grid.grid()
            self.bench.layers.show(Image(np.full(grid.shape, 1.0), BOUNDARY, "m", grid), BOUNDARY, visible=True)
        return self._own()

    def _expected(self, layer: Any) -> list[np.ndarray]:
        """Return the lines that are to be drawn, with fewer corners where the user is about to move them."""
        about = layer.metadata[KEY]
        given = outline_of(self.bench.session.pipeline)
        if given is not None and about["key"] == BOUNDARY and "frames" not in about:
            return [to_world(1e-3 * given)]
        image = image_of(layer, self.bench.layers.frame)
        lines = outlines(image) if isinstance(image, Image) else []
        if isinstance(image, Image) and str(layer.mode) in EDITING:
            lines = [simplified(line, 1e3 * image.grid.pixel_size_m) for line in lines]
        return lines

    def _draw(self, layer: Any) -> None:
        lines, drawn = self._expected(layer), layer.metadata.get(DRAWN, [])
        same = len(drawn) == len(lines) == layer.nshapes and all(
            np.array_equal(old, np.float32(new)) for old, new in zip(drawn, lines, strict=True)
        )
        if same and not is_edited(layer):
            return
        self._drawing = True
        try:
            draw_lines(layer, lines)
        finally:
            self._drawing = False
        if lines and str(layer.mode) in EDITING:
            layer.selected_data = {layer.nshapes - 1}

    def _inserted(self, event: Any) -> None:
        self._join(event.value)

    def _removed(self, event: Any) -> None:
        if event.value in self._joined:
            self.word = GONE if is_edited(event.value) else ""
            self._leave(event.value)
            self.changed.emit()

    def _join(self, layer: Any) -> None:
        if KEY in layer.metadata and layer.metadata[KEY]["image"].quantity == BOUNDARY:
            layer.metadata[KEPT] = True
            layer.events.data.connect(self._look)
            layer.events.mode.connect(self._simplify)
            self._joined.append(layer)
            self.changed.emit()

    def _leave(self, layer: Any) -> None:
        layer.metadata.pop(KEPT, None)
        layer.events.data.disconnect(self._look)
        layer.events.mode.disconnect(self._simplify)
        self._joined.remove(layer)

    def _look(self, event: Any) -> None:
        if not self._drawing and str(event.action) in ("added", "changed", "removed"):
            self.word = ""
            self.changed.emit()

    def _selected(self, event: Any) -> None:
        self.changed.emit()

    def _simplify(self, event: Any) -> None:
        """Draw fewer corners where the user begins to move them, and all again where he stops without a change."""
        if not is_edited(event.source):
            self._draw(event.source)


def _finish(layer: Any) -> None:
    """End the drawing of a new outline: corners that wait for the next one would stay behind."""
    if layer is not None and str(layer.mode).startswith("add"):
        layer.mode = "pan_zoom"


def outline_of(pipeline: Pipeline) -> np.ndarray | None:
    """Return the corners of the outline that a pipeline holds, mm, each ``(y, x)``, y upwards; None without one."""
    segmenter: Any = pipeline.segment
    if segmenter is None or segmenter.name != "polygon" or not segmenter.vertices:
        return None
    return np.array(segmenter.vertices)


def simplified(line_mm: np.ndarray, pixel_mm: float) -> np.ndarray:
    """Return a closed line with at most `MANY` corners where that is possible within `NEAR` of a pixel.

    Each corner is one of the line's, and neither line is further than that from the other (Douglas and Peucker 1973).
    """
    from skimage.measure import approximate_polygon

    closed = np.vstack([line_mm, line_mm[:1]])
    for tolerance in STEPS:
        if len(line_mm) <= MANY:
            break
        line_mm = approximate_polygon(closed, tolerance * pixel_mm)[:-1]
    return line_mm


def _corners_mm(kind: str, corners: np.ndarray) -> np.ndarray:
    """Return the corners of a shape as they go into the pipeline."""
    if kind in ("line", "path"):
        raise ValidationError(OPEN)
    if kind == "ellipse":
        region = region_of(kind, corners, "outline")
        assert isinstance(region, EllipseRegion)
        points = region.outline_m[:: len(region.outline_m) // ROUND]
    else:
        points = from_world(corners)
    return np.round(1e3 * points, DECIMALS) + 0.0
