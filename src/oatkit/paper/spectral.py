"""The mouse of Fig. 7: a real scan of several wavelengths where one is given, else a simulated body with vessels."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import uniform_filter

from oatkit.api import Segmenter
from oatkit.data import Image, Scan
from oatkit.engine import run
from oatkit.errors import ValidationError
from oatkit.memo import Memo
from oatkit.paper.setting import Setting
from oatkit.paper.simulated import pipeline_for, scan_of
from oatkit.pipeline import Pipeline
from oatkit.reading import read, read_regions
from oatkit.registry import plugin
from oatkit.shapes import RectangleRegion, Region, core, rim
from oatkit.simulate import Inclusion, LitBody, OxygenBody, illuminate
from oatkit.simulate.multispectral import SPACING_M

BODY_SEED = 0
PATCH_M = 1.5e-3
"""Side of the square of tissue."""
BELOW_SKIN_M, OFF_VESSELS_M = 1e-3, 0.3e-3
"""How far that square keeps from the surface and from the walls of vessels."""
ERODED_M = 0.1e-3
"""Left out of the vessel: its blurred edge."""
RIM_M, CORE_M = 1e-3, 3e-3
"""Greatest depth of the rim and least of the core, where a real scan has no regions."""


@dataclass(frozen=True)
class SpectralMouse:
    """One slice at many wavelengths."""

    setting: Setting

    @property
    def real(self) -> bool:
        """Whether it is a real scan."""
        return self.setting.scan is not None

    @cached_property
    def lit(self) -> LitBody:
        """The simulated body in the light that its own absorption leaves."""
        pixel_m = self.setting.field_of_view_mm * 1e-3 / self.setting.fine_pixels
        body = OxygenBody.draw(BODY_SEED)
        return illuminate(body, self.setting.wavelengths_nm, spacing_m=max(SPACING_M, pixel_m))

    @cached_property
    def scan(self) -> Scan:
        """Its signals. Raises `ValidationError` for a scan of a single wavelength."""
        if self.setting.scan is None:
            return scan_of(self.lit.pressure, self.setting)
        scan = read(self.setting.scan)
        if len(set(scan.wavelengths_nm)) < 2:
            raise ValidationError(
                f"{self.setting.scan}: it was taken at {scan.wavelengths_nm[0]:g} nm only; fig7 shows spectra and "
                "needs two wavelengths or more; leave the scan out to see it on a simulated body"
            )
        return scan

    @cached_property
    def truth(self) -> Image | None:
        """The initial pressure of the simulated body on the grid of the reconstruction."""
        return None if self.real else self.lit.pressure(self.setting.grid)

    @cached_property
    def _memo(self) -> Memo:
        return Memo()

    def pressure(self, preset: str, *changes: str) -> Image:
        """Reconstruct the first frame at every wavelength."""
        pipeline = Pipeline.load(preset, changes) if self.real else pipeline_for(preset, self.setting, *changes)
        return run(pipeline, self.scan, memo=self._memo)["initial_pressure"]

    def boundary(self, image: Image) -> Image:
        """Return the true outline of the simulated body, or that which is found in an image of a real one."""
        if not self.real:
            return self.lit.body.boundary(image.grid)
        segmenter = plugin("segmenter", "active-contour")()
        assert isinstance(segmenter, Segmenter)
        return segmenter.segment(image)

    def regions(self, image: Image, boundary: Image) -> tuple[Region, ...]:
        """Return the regions whose spectra are shown: two, or the only one that was drawn in a real scan.

        Of a simulated body, the deepest vessel, and the square of tissue in which `image` is lowest.
        """
        if self.setting.scan is None:
            deepest = max(self.lit.body.vessels, key=lambda vessel: self.lit.body.depth_m(vessel.centre_m))
            return deepest.region(ERODED_M), lowest_square(image, boundary, self.lit.body.vessels)
        drawn = {region.name: region for region in read_regions(self.setting.scan) if region.mask(image.grid).any()}
        return tuple(drawn.values())[:2] or (rim(boundary, RIM_M), core(boundary, CORE_M))

    def words(self) -> str:
        """Say what it is, for a caption."""
        if self.real:
            return f"{self.scan.name}, frame 0, {len(self.scan.wavelengths_nm)} wavelengths"
        return f"an invented body with seven vessels, lit by itself; {self.setting.words()}"


def lowest_square(image: Image, boundary: Image, vessels: tuple[Inclusion, ...]) -> RectangleRegion:
    """Return the square of `PATCH_M` in which an image is lowest, averaged over pixels and wavelengths.

    It keeps `BELOW_SKIN_M` from the surface and `OFF_VESSELS_M` from vessels. Raises `ValidationError` where there is
    no room for it.
    """
    grid = image.grid
    side = max(1, round(PATCH_M / grid.pixel_size_m)) | 1
    taken = boundary.values[0] > -BELOW_SKIN_M
    for vessel in vessels:
        shape = vessel.region()
        y, x = (half + OFF_VESSELS_M for half in shape.half_axes_m)
        taken |= replace(shape, half_axes_m=(y, x)).mask(grid)
    crowded = uniform_filter(taken.astype(float), side, mode="constant", cval=1.0) > 1e-9
    if crowded.all():
        raise ValidationError(f"no square of {1e3 * PATCH_M:g} mm without vessels fits into the body")
    mean = uniform_filter(image.values.mean(axis=0, dtype=float), side)
    row, column = np.unravel_index(np.argmin(np.where(crowded, np.inf, mean)), grid.shape)
    half = side * grid.pixel_size_m / 2
    return RectangleRegion("tissue", (float(grid.y_m[row]), float(grid.x_m[column])), (half, half))
