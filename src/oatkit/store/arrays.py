"""The zarr arrays of a result folder, and their description by OME-Zarr 0.5."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from oatkit.store.manifest import FILE_NAME, ImageEntry


def attributes(images: Mapping[str, ImageEntry]) -> dict[str, Any]:
    """Return the group's attributes: OME-Zarr 0.5, one multiscale of a single level for each image."""
    axes = [{"name": "t", "type": "time"}, {"name": "c", "type": "channel"}]
    axes += [{"name": name, "type": "space", "unit": "micrometer"} for name in "yx"]
    multiscales = [
        {"name": name, "axes": axes, "datasets": [{"path": name, "coordinateTransformations": _transforms(entry)}]}
        for name, entry in images.items()
    ]
    note = "row 0 of every image is at the bottom: y points up"
    return {"ome": {"version": "0.5", "multiscales": multiscales}, "oatkit": {"manifest": FILE_NAME, "rows": note}}


def create_array(group: Any, name: str, entry: ImageEntry, frames: int) -> Any:
    """Return a new zarr array for one image of all frames."""
    from zarr.codecs import ZstdCodec

    return group.create_array(
        name,
        shape=(frames, *entry.shape),
        dtype=entry.dtype,
        # A file is one frame; within it, each wavelength can be read alone.
        shards=(1, *entry.shape),
        chunks=(1, 1, *entry.grid.shape),
        compressors=ZstdCodec(level=1, checksum=True),
        fill_value=np.nan,
        dimension_names=("t", "c", "y", "x"),
        attributes={"quantity": entry.quantity, "unit": entry.unit, "wavelengths_nm": list(entry.wavelengths_nm)},
        # An image that is NaN everywhere is still an image: without a file it would look lost.
        config={"write_empty_chunks": True},
    )


def _transforms(entry: ImageEntry) -> list[dict[str, Any]]:
    grid = entry.grid.grid()
    pixel, y, x = (round(1e6 * float(metres), 9) for metres in (grid.pixel_size_m, grid.y_m[0], grid.x_m[0]))
    return [
        {"type": "scale", "scale": [1.0, 1.0, pixel, pixel]},
        {"type": "translation", "translation": [0.0, 0.0, y, x]},
    ]
