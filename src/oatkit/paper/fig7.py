"""Fig. 7: spectra of two regions by least squares, signed and thresholded, and by maximum entropy."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.data import Image
from oatkit.drawing.page import Figure
from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.metrics import negative_pixels
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.paper.spectral import SpectralMouse
from oatkit.regions import Region, RegionRow, region_table

STEPS = 20
"""Of the least squares that are stopped early, as is usual: what is large is not filled by then."""
STOPPED = f"L2, {STEPS} steps"
METHODS = {
    STOPPED: ("lsqr", f"reconstruct.n_iterations={STEPS}", "reconstruct.preconditioner=none"),
    "L2": ("lsqr",),
    "L2, thresholded": ("lsqr-threshold",),
    "MaxEnt": ("maxent",),
}
"""Preset and what is changed in it."""
TRUTH = "truth"
PAPER_BELOW_ZERO = dict.fromkeys((STOPPED, "L2"), "below 700 nm in one region, none in another")
STEPS_DECIDE = "the number of steps decides, as the two kinds of L2 show; the paper states neither it nor its filters"
ANOTHER = "another body; the paper's scan of a mouse with a tumour is not public"
SETTING = Setting(field_of_view_mm=25.0)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One region of one image, by rising wavelength."""

    wavelengths_nm: np.ndarray
    mean: np.ndarray
    std: np.ndarray
    """Within the region."""
    negative_share: float
    """Of the pixels of the region at all wavelengths."""

    @classmethod
    def of(cls, rows: Sequence[RegionRow]) -> "Spectrum":
        """Gather the rows of one region and one image."""
        columns = np.array([(row.wavelength_nm, row.mean, row.std, row.negative_share) for row in rows], dtype=float)
        wavelengths, mean, std, negative = columns[np.argsort(columns[:, 0], kind="stable")].T
        return cls(wavelengths, mean, std, float(negative.mean()))

    @property
    def below_zero(self) -> str:
        """At how many wavelengths the mean is negative."""
        return f"{(self.mean < 0).sum()} of {len(self.mean)}"

    def distance(self, other: "Spectrum") -> float:
        """Return the distance of the means, as vectors over the wavelengths, relative to the length of the other."""
        size = float(np.linalg.norm(other.mean))
        return float(np.linalg.norm(self.mean - other.mean)) / size if size > 0 else float("inf")


Spectra = dict[tuple[str, str], Spectrum]
"""By the names of region and image."""


def fig7(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    mouse = SpectralMouse(setting)
    yield f"{len(mouse.scan.wavelengths_nm)} wavelengths: {mouse.words()}"
    images: dict[str, Image] = {}
    for name, (preset, *changes) in METHODS.items():
        images[name] = mouse.pressure(preset, *changes)
        yield f"{name}: {100 * np.mean(images[name].values < 0):.1f} % of the pixels of the picture are negative"
    boundary = mouse.boundary(images["L2, thresholded"])
    regions = mouse.regions(images[STOPPED], boundary)
    if mouse.truth is not None:
        images[TRUTH] = mouse.truth
    spectra = spectra_of(images, regions)
    inside = boundary.values[0] < 0
    title = "Fig. 7: spectra of two regions"
    figure = _figure(images, regions, spectra, inside, title, mouse.words())
    beside, notes = _beside(images, spectra, inside), _notes(mouse.real, regions, spectra)
    yield Outcome("fig7", title, figure, tuple(beside), _table(spectra), tuple(notes))


def spectra_of(images: dict[str, Image], regions: Sequence[Region]) -> Spectra:
    """Return the spectrum of each region in each image."""
    found: dict[tuple[str, str], list[RegionRow]] = {}
    for row in region_table(images, regions):
        found.setdefault((row.region, row.image), []).append(row)
    return {key: Spectrum.of(rows) for key, rows in found.items()}


def always_negative(image: Image, inside: np.ndarray) -> float:
    """Return the share of the body's pixels that are negative at every wavelength."""
    return float(np.mean((image.values[:, inside] < 0).all(0)))


def _figure(
    images: dict[str, Image], regions: Sequence[Region], spectra: Spectra, inside: np.ndarray, title: str, words: str
) -> Figure:
    grid, first = images[STOPPED].grid, int(np.argmin(images[STOPPED].wavelengths_nm))
    outlined = Image(_signed(regions, images[STOPPED]), "boundary", "m", grid)
    panels = []
    for name, image in images.items():
        count = negative_pixels(image.values[first], inside)
        lines = (f"{count.count:,} negative pixels in the body ({100 * count.share:.2f} %)",)
        panels.append(Panel(name, image, lines, first, outlined))
    plots = [_spectra_plot(region, spectra) for region in regions]
    where = "; ".join(_place(region, images[STOPPED]) for region in regions)
    caption = f"{words} · at {images[STOPPED].wavelengths_nm[first]:g} nm · outlined: {where}"
    below = f"{caption} · spectra: mean ± standard deviation within the region"
    return sheet([panels], [*plots, _negative_plot(images, inside)], title, below)


def _signed(regions: Sequence[Region], image: Image) -> np.ndarray:
    """Return what is below zero in the regions, as a boundary is."""
    mask = np.any([region.mask(image.grid) for region in regions], axis=0)
    return np.where(mask, -1.0, 1.0) * image.grid.pixel_size_m


def _place(region: Region, image: Image) -> str:
    """Say which region it is, and where."""
    mask = region.mask(image.grid)
    y, x = (
        1e3 * axis[index].mean() for axis, index in zip((image.grid.y_m, image.grid.x_m), mask.nonzero(), strict=True)
    )
    return f"{region.name} ({mask.sum()} pixels about x = {x:.1f}, y = {y:.1f} mm from the middle)"


def _spectra_plot(region: Region, spectra: Spectra) -> Plot:
    curves = tuple(
        Curve(image, found.wavelengths_nm, found.mean, "--" if image == TRUTH else "o-", found.std)
        for (name, image), found in spectra.items()
        if name == region.name
    )
    return Plot(region.name, curves, "wavelength, nm", "initial pressure, a.u.")


def _negative_plot(images: dict[str, Image], inside: np.ndarray) -> Plot:
    curves = []
    for name in (STOPPED, "L2", "MaxEnt"):
        order = np.argsort(images[name].wavelengths_nm, kind="stable")
        shares = [100 * negative_pixels(plane, inside).share for plane in images[name].values[order]]
        curves.append(Curve(name, np.array(images[name].wavelengths_nm)[order], shares, "o-"))
    return Plot("negative pixels in the body", tuple(curves), "wavelength, nm", "%")


def _table(spectra: Spectra) -> tuple[Sequence[str], ...]:
    heading = (
        "region", "method", "mean, a.u.", "spread within the region", "wavelengths with a mean below 0",
        "negative pixels", "spectrum off the truth",
    )  # fmt: skip
    return (heading, *(_row(spectra, *key) for key in sorted(spectra, key=lambda key: key[0])))


def _row(spectra: Spectra, region: str, method: str) -> Sequence[str]:
    found, truth = spectra[region, method], spectra.get((region, TRUTH))
    return (
        region,
        method,
        f"{found.mean.mean():.2f}",
        f"{found.std.mean():.2f}",
        found.below_zero,
        f"{100 * found.negative_share:.1f} %",
        "not known" if truth is None else f"{100 * found.distance(truth):.1f} %",
    )


def _beside(images: dict[str, Image], spectra: Spectra, inside: np.ndarray) -> Iterator[Beside]:
    for (region, method), found in spectra.items():
        what = f"wavelengths at which the mean of {region} is below 0, {method}"
        if method in PAPER_BELOW_ZERO:
            yield Beside(what, PAPER_BELOW_ZERO[method], found.below_zero, STEPS_DECIDE)
        if method == "MaxEnt":
            yield Beside(what, "none", found.below_zero, "they agree: maximum entropy cannot be negative")
            apart = 100 * found.distance(spectra[region, "L2, thresholded"])
            yield Beside(f"MaxEnt from thresholded L2, {region}", "similar (shown)", f"{apart:.1f} % apart", ANOTHER)
    for name in PAPER_BELOW_ZERO:
        share = 100 * always_negative(images[name], inside)
        what = f"body below 0 at every wavelength, {name}"
        yield Beside(what, "some parts (shown by an arrow)", f"{share:.2f} % of its pixels", STEPS_DECIDE)


def _notes(real: bool, regions: Sequence[Region], spectra: Spectra) -> Iterator[str]:
    if real:
        yield f"Regions: {' and '.join(region.name for region in regions)}; rim and core where the scan has none."
        return
    vessel, tissue = (region.name for region in regions)
    yield (
        f"Regions, by rule: {vessel} is the deepest vessel; {tissue} is the square of 1.5 mm, off vessels and skin, in "
        f"which {STOPPED}, is lowest: it shows the fault where it is largest, as the paper's arrow does."
    )
    yield (
        "The truth is mu_a Phi of the simulated body, on the scale of the reconstructions (K = 1). Detectors are ideal "
        "and the speed of sound is known: a real scan has more reasons for negative values."
    )
    maxent, truth = (spectra[tissue, method].mean.mean() for method in ("MaxEnt", TRUTH))
    yield (
        f"Not negative is not yet right: in {tissue}, MaxEnt is {maxent / truth:.2f} times the truth, averaged over "
        "the wavelengths."
    )
