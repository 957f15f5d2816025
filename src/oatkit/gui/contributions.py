"""What the manifest `oatkit/napari.yaml` names: reader, writer, samples."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import napari
from napari.utils.notifications import show_error

from oatkit.errors import OatkitError, ValidationError
from oatkit.export import export
from oatkit.gui.images.layers import KEY
from oatkit.gui.opening import SCAN, can_open, open_path, open_sample
from oatkit.gui.preview.quick_look import awaited
from oatkit.gui.workbench import Workbench, workbench
from oatkit.result import Result

LayerData = tuple[Any, ...]
SHOWN_ALREADY: list[LayerData] = [(None,)]
"""Tells napari that a file was opened and that there is no layer left to add."""


def get_reader(path: str | Sequence[str]) -> Callable[[str], list[LayerData]] | None:
    """Return what opens a path, or None where it is not ours."""
    return read if isinstance(path, str) and can_open(Path(path)) else None


def read(path: str) -> list[LayerData]:
    """Open a path in the viewer of the window, where an error is one sentence; without a window, return its layers.

    Raises what `open_path` raises, without a window.
    """
    viewer = napari.current_viewer()
    if viewer is not None:
        try:
            open_path(workbench(viewer), Path(path))
        except OatkitError as error:  # napari would put its own page of text about it
            show_error(str(error))
        return SHOWN_ALREADY
    bench = _without_window()
    open_path(bench, Path(path))
    return _tuples(bench)


def write(path: str, layers: list[LayerData]) -> list[str]:
    """Write the images that layers show, with how they came about: .zarr, .h5, .ome.tif or .png.

    Of a result of many frames a .zarr gets all, other files the one looked at. Raises `ValidationError` where no layer
    shows an image of oatkit, and what `oatkit.export` raises.
    """
    shown = [layer[1]["metadata"][KEY] for layer in layers if KEY in layer[1].get("metadata", {})]
    if not shown:
        raise ValidationError("none of the chosen layers shows an image of oatkit")
    result: Result | None = shown[0].get("result")
    if path.lower().endswith(".zarr"):
        (result or _images(shown)).save(path, overwrite=True)
    else:
        export(_images(shown, result), path, overwrite=True)
    return [path]


def breast() -> list[LayerData]:
    """Simulate a scan of a breast-like phantom and open it."""
    return _sample("breast")


def oxygen() -> list[LayerData]:
    """Simulate a multispectral scan of a body with vessels and open it."""
    return _sample("oxygen")


def _sample(name: str) -> list[LayerData]:
    """Open a sample in the viewer of the window, where an empty layer holds its place: napari wants one at once."""
    viewer, bench = napari.current_viewer(), _without_window()
    if viewer is None:
        open_sample(bench, name)
    else:
        open_sample(workbench(viewer), name)
        bench.layers.show(awaited(workbench(viewer).session.pipeline), SCAN, f"simulating {name} ...")
    return _tuples(bench)


def _without_window() -> Workbench:
    return workbench(napari.components.ViewerModel())


def _tuples(bench: Workbench) -> list[LayerData]:
    return [layer.as_layer_data_tuple() for layer in bench.viewer.layers]


def _images(shown: list[dict[str, Any]], result: Result | None = None) -> Result:
    """Return a result of the images that are shown; of many frames, the one looked at."""
    if result is not None and result.frames > 1:
        viewer = napari.current_viewer()
        result = result.frame(workbench(viewer).layers.frame if viewer is not None else 0)
    known = {about["key"].rpartition("/")[2]: about["image"] for about in shown}
    if result is None:
        return Result(known)
    return replace(result, images={name: result[name] for name in known if name in result}, stored=None)
