"""More plugins that are wrong in one way each: those that work on images, on scans and on files."""

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from mutant_plugins import FORM, FORWARD, SOLVERS, altered
from oatkit.api import Image, Proximable
from oatkit.errors import ReadError
from toy_plugins import MAGIC, Exponential, Pseudoinverse, Ridge, Smoothing, Threshold, Toy


class Shrinking(Proximable):
    """|x|_1, with the proximal map of half of it."""

    name: ClassVar[str] = "shrinking"
    degree: ClassVar[int] = 1

    def value(self, image):
        """Return the sum of magnitudes."""
        return float(abs(image).sum())

    def prox(self, image, step):
        """Return a point that moved half as far as it should."""
        return np.sign(image) * np.maximum(abs(image) - step / 2, 0)


class Overstepping(Shrinking):
    """|x|_1, moved a thousandth too far, after [Nobody2020]."""

    def prox(self, image, step):
        """Return a point that moved too far."""
        return np.sign(image) * np.maximum(abs(image) - 1.001 * step, 0)


REGULARIZERS = {
    "value": altered(Ridge, value=lambda self, image: float("nan")),
    "degree": altered(Ridge, degree=1),
    "gradient": altered(Ridge, gradient=lambda self, image: image),
    "proximal": Shrinking,
    "moreau": Overstepping,
    "quadratic": altered(Ridge, value=lambda self, image: 2 * float((image**2).sum()), gradient=lambda s, i: 4 * i),
}


def seen(change):
    """A segmenter whose boundary is changed on its way out."""

    def segment(self, image):
        return change(Threshold.segment(self, image))

    return segment


def fixed_level(self, image):
    """Brighter than 0.5, whatever the unit."""
    return self.distance(image.values[0] > 0.5, image.grid)


def anything(self, image):
    """A body even where there is none."""
    plane = image.values.sum(axis=0)
    inside = plane > 0.5 * plane.max() if plane.any() else np.eye(len(plane)) > 0
    return self.distance(inside, image.grid)


SEGMENTERS = {
    "disc": altered(Threshold, segment=seen(lambda b: replace(b, values=np.swapaxes(b.values, 1, 2)))),
    "distance": altered(Threshold, segment=seen(lambda b: replace(b, values=np.sign(b.values) * 1e-3))),
    "form_of_image": altered(Threshold, segment=seen(lambda b: replace(b, unit="mm"))),
    "brightness": altered(Threshold, segment=fixed_level),
    "nothing": altered(Threshold, segment=anything),
}


def lit(change):
    """A model of light whose image is changed; `change` gets values, the boundary and the optics."""

    def fluence(self, boundary, optics):
        made = Exponential.fluence(self, boundary, optics)
        return replace(made, values=change(made.values, boundary, optics))

    return fluence


def one_sided(values, boundary, optics):
    """More light from below."""
    return values * (1 - 20 * boundary.grid.y_m[:, None])


def by_pictures(values, boundary, optics):
    """Half the light where the optics are images."""
    return values / 2 if optics.absorption_per_m.ndim == 3 else values


def by_place(values, boundary, optics):
    """Light that depends on where the grid lies."""
    return values * (1 + 100 * boundary.grid.centre_m[0])


def bodiless(self, boundary, optics):
    """Light without a body, too."""
    distance = np.nan_to_num(boundary.values, nan=1.0)
    if not (distance < 0).any():
        light = np.ones((len(optics.wavelengths_nm), *boundary.grid.shape))
        return Image(light, "fluence", "", boundary.grid, optics.wavelengths_nm)
    return Exponential.fluence(self, boundary, optics)


FLUENCE = {
    "form_of_image": altered(Exponential, fluence=lit(lambda v, b, o: v - 0.5)),
    "absorption": altered(Exponential, fluence=lit(lambda v, b, o: v[::-1])),
    "depth": altered(Exponential, fluence=lit(lambda v, b, o: np.minimum(v, 0.1))),
    "energy": altered(Exponential, fluence=lit(lambda v, b, o: 10 * v)),
    "slab_between_walls": altered(Exponential, fluence=lit(one_sided)),
    "images_of_optics": altered(Exponential, fluence=lit(by_pictures)),
    "place": altered(Exponential, fluence=lit(by_place)),
    "no_body": altered(Exponential, fluence=bodiless),
}


def unmixed(change):
    """An unmixer whose planes are changed, by name."""

    def unmix(self, problem):
        made = Pseudoinverse.unmix(self, problem)
        return {name: replace(image, values=change(image.values)) for name, image in made.items()}

    return unmix


def filled(values):
    """What is undefined taken for the mean of the rest."""
    return np.where(np.isfinite(values), values, np.nanmean(values))


UNMIXERS = {
    "form_of_images": altered(Pseudoinverse, unmix=unmixed(lambda v: np.where(np.isnan(v), np.inf, v))),
    "exact_mixture": altered(Pseudoinverse, unmix=unmixed(lambda v: 1.01 * v)),
    "proportion": altered(Pseudoinverse, unmix=unmixed(lambda v: v + 1e-3)),
    "pixels": altered(Pseudoinverse, unmix=unmixed(lambda v: v + 0.1 * np.nan_to_num(np.roll(v, 1, axis=2)))),
    "undefined": altered(Pseudoinverse, unmix=unmixed(filled)),
}


def processed(change):
    """A preprocessor whose scan is changed; `change` gets the scan before, too."""

    def process(self, scan):
        return change(Smoothing.process(self, scan), scan)

    return process


def in_place(self, scan):
    """The scan itself, changed."""
    scan.signals.setflags(write=True)
    scan.signals[:] *= 2
    return scan


def by_loudness(done, scan):
    """A geometry that the signals set."""
    speed = 1500.0 + min(1.0, float(np.abs(scan.signals).max()) * 1e-3)
    return replace(done, geometry=replace(done.geometry, speed_of_sound_m_s=speed))


def wrapping(self, scan):
    """Twice the numbers in their own type."""
    with np.errstate(all="ignore"):
        signals = np.asarray(scan.signals) * np.array(2, scan.signals.dtype)
    return replace(scan, signals=signals, valid=scan.valid & np.isfinite(signals).all(axis=3))


def late_crop(self, scan):
    """A shorter record that says it begins where the whole one did."""
    told = replace(scan.geometry, n_samples=scan.geometry.n_samples - 3)
    valid = scan.valid & np.isfinite(scan.signals).all(axis=3)
    return replace(scan, signals=scan.signals[..., 3:], geometry=told, valid=valid)


PREPROCESSORS = {
    "form_of_scan": altered(Smoothing, process=processed(lambda done, scan: replace(done, notes=()))),
    "untouched": altered(Smoothing, process=in_place),
    "validity": altered(Smoothing, process=processed(lambda done, scan: replace(done, valid=None))),
    "geometry": altered(Smoothing, process=processed(by_loudness)),
    "predicted (crop)": altered(Smoothing, process=late_crop),
    "predicted": altered(Smoothing, process=processed(lambda done, scan: replace(done, geometry=scan.geometry))),
    "whole_numbers": altered(Smoothing, process=wrapping),
    "broken_channels": altered(Smoothing, process=processed(lambda done, scan: replace(done, valid=scan.valid))),
}


def careless(self, path):
    """No look at the length."""
    if path.read_bytes()[:4] != MAGIC:
        raise ReadError("not mine")
    numbers = np.frombuffer(path.read_bytes()[4:])
    whole = Path(path).with_suffix(".tmp")
    whole.write_bytes(MAGIC + numbers[:100].reshape(100).tobytes())
    return replace(Toy.read(self, whole), source=str(path))


READERS = {
    "foreign": altered(Toy, can_read=lambda self, path: True),
    "sample": altered(Toy, read=lambda self, path: replace(Toy.read(self, path), reader="somebody else")),
    "beside": altered(Toy, regions=lambda self, path: ("a region",)),
    "damaged": altered(Toy, read=careless),
}

MUTANTS = {
    "form": FORM,
    "forward_model": FORWARD,
    "solver": SOLVERS,
    "regularizer": REGULARIZERS,
    "segmenter": SEGMENTERS,
    "fluence_model": FLUENCE,
    "unmixer": UNMIXERS,
    "preprocessor": PREPROCESSORS,
    "reader": READERS,
}
"""By kind, and by the check that is to find the fault."""
