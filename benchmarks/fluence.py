"""Time the diffusion of light on a disc, and show its error against the Bessel function by the size of the pixel.

One factorization a wavelength; the wavelengths of one call share the threads. Best of several runs are shown.
"""

import argparse
import os
from time import perf_counter

import numpy as np
from scipy.special import iv

import oatkit
from oatkit.api import UnmixProblem
from oatkit.data import Grid, Image, Optics
from oatkit.simulate import OxygenBody, illuminate
from oatkit.spectra import tissue_optics
from oatkit.threads import thread_count
from operators import cpu_model

RADIUS = 10e-3
ABSORPTION, SCATTERING = 20.0, 1200.0


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, help="runs of which the best is taken")
    repeats = parser.parse_args().repeats
    print(f"{cpu_model()}, {os.cpu_count()} cores, {thread_count()} threads, best of {repeats}")
    model = oatkit.plugin("fluence_model", "diffusion-fvm")
    print("\ndisc of 20 mm in 24 mm, seconds")
    for pixels in (200, 256, 512):
        print(f"{pixels:4}^2, 1 wavelength          {seconds(model(), pixels, 1, repeats):8.3f}")
    print(f" 200^2, 12 wavelengths        {seconds(model(), 200, 12, repeats):8.3f}")
    print(f" 200^2, 1 wavelength, band    {seconds(model(band_width=8.0), 200, 1, repeats):8.3f}")
    print(f" 200^2, 12 wavelengths, absorption and light in turn until they agree{loop():8.3f}")
    print("\npixel, mm   relative L2 error   order")
    last = None
    for pixels in (25, 50, 100, 200, 400):
        found = error(model(), pixels)
        order = "" if last is None else f"{np.log2(last / found):8.2f}"
        print(f"{24 / pixels:9.2f}   {found:17.2e}{order}")
        last = found


def disc(pixels: int) -> tuple[Image, np.ndarray]:
    """Return the signed distance of the disc and the distance from its centre, a fraction of a pixel off the grid's."""
    grid = Grid((pixels, pixels), 24e-3 / pixels)
    r = np.hypot(grid.y_m[:, None] - 0.13e-3, grid.x_m - 0.21e-3)
    return Image(r - RADIUS, "boundary", "m", grid), r


def seconds(model: object, pixels: int, wavelengths: int, repeats: int) -> float:
    """Return the shortest time of a call."""
    boundary, _ = disc(pixels)
    scale = np.linspace(1, 2, wavelengths)
    optics = Optics(tuple(700 + 10 * np.arange(wavelengths)), ABSORPTION * scale, SCATTERING / scale)
    times = []
    for _ in range(repeats):
        start = perf_counter()
        model.fluence(boundary, optics)
        times.append(perf_counter() - start)
    return min(times)


def loop() -> float:
    """Return the seconds of unmixing 12 wavelengths of a body of blood with its light computed anew in each pass."""
    wavelengths = tuple(np.linspace(690.0, 910.0, 12))
    grid, body = Grid((200, 200), 25e-3 / 200), OxygenBody.draw(1)
    boundary, optics = body.boundary(grid), tissue_optics("soft-tissue", wavelengths)
    pressure = illuminate(body, wavelengths, spacing_m=0.2e-3).pressure(grid)
    model = oatkit.plugin("fluence_model", "diffusion-fvm")(band_width=8.0)
    light = model.fluence(boundary, optics)
    names = ("oxyhaemoglobin", "deoxyhaemoglobin", "water")
    unmixer = oatkit.plugin("unmixer", "fluence-corrected")(chromophores=names)
    start = perf_counter()
    unmixer.unmix(UnmixProblem(pressure, None, boundary, light, model, optics, 1.0))
    return perf_counter() - start


def error(model: object, pixels: int) -> float:
    """Return the relative L2 error in the disc."""
    boundary, r = disc(pixels)
    image = model.fluence(boundary, Optics((800,), [ABSORPTION], [SCATTERING]))
    diffusion = 1 / (3 * (ABSORPTION + SCATTERING))
    kappa, a = np.sqrt(ABSORPTION / diffusion), image.diagnostics["wall_factor"]
    at_wall = iv(0, kappa * RADIUS) + 2 * a * diffusion * kappa * iv(1, kappa * RADIUS)
    exact = iv(0, kappa * r[r < RADIUS]) / at_wall
    return float(np.linalg.norm(image.values[0][r < RADIUS] - exact) / np.linalg.norm(exact))


if __name__ == "__main__":
    main()
