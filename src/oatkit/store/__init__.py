"""Results on disk: a folder that OME-Zarr viewers open, with a checksum of every byte and the full provenance.

``NAME.zarr`` is a zarr v3 group with one array for each image, of axes ``(frame, wavelength, y, x)``, described by
OME-Zarr 0.5 metadata; one file holds one image of one frame. ``manifest.json`` beside them is an
`oatkit.store.manifest.Manifest`. Row 0 lies at the bottom, as in memory: a viewer that draws it on top shows the image
upside down, at the right coordinates.
"""

from oatkit.store.folder import load
from oatkit.store.verifying import verify
from oatkit.store.writer import StoreWriter, save

__all__ = ["StoreWriter", "load", "save", "verify"]
