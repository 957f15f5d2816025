"""Compare photons with the diffusion of light by depth, in bodies where diffusion holds and where it does not.

Prints a table for each case and the time of a run; with --figure,
draws the tables. Needs matplotlib for the figure.
"""

import argparse
import os
import platform
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

import oatkit
from oatkit.api import Grid, Image, Optics
from oatkit_montecarlo.batches import thread_count
from oatkit_montecarlo.model import MonteCarlo

PIXELS = 200
RUNS = 5
"""Runs with seeds of their own, whose spread gives the error of a mean over pixels."""


@dataclass(frozen=True)
class Case:
    """A disc of one tissue under light."""

    title: str
    radius_mm: float
    absorption_per_cm: float
    scattering_per_cm: float
    depths_mm: tuple[float, ...]
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def optics(self) -> Optics:
        """At one wavelength."""
        return Optics((800,), [100 * self.absorption_per_cm], [100 * self.scattering_per_cm])

    @property
    def boundary(self) -> Image:
        """A disc a fraction of a pixel off the grid's middle, six fifths of its diameter wide."""
        grid = Grid((PIXELS, PIXELS), 2.4e-3 * self.radius_mm / PIXELS)
        r = np.hypot(grid.y_m[:, None] - 0.3 * grid.pixel_size_m, grid.x_m - 0.4 * grid.pixel_size_m)
        return Image(r - 1e-3 * self.radius_mm, "boundary", "m", grid)


CASES = (
    Case("tissue, diffuse light", 10, 0.2, 12, (0.1, 0.3, 0.6, 1, 2, 4, 6, 9)),
    Case("tissue, collimated light", 10, 0.2, 12, (0.1, 0.3, 0.6, 1, 2, 4, 6, 9), {"illumination": "collimated"}),
    Case("dark: mu_a = mu_s'", 10, 5, 5, (0.1, 0.3, 0.6, 1, 2, 3, 4, 5)),
    Case("small: a body of two free paths", 1, 1, 10, (0.02, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95)),
)


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photons", type=int, default=1_000_000, help="of each of the five runs of a case")
    parser.add_argument("--figure", type=Path, help="where to draw the tables")
    arguments = parser.parse_args()
    print(f"{cpu_model()}, {os.cpu_count()} cores, {thread_count()} threads, {PIXELS}^2 pixels")
    MonteCarlo(n_photons=1000).fluence(CASES[0].boundary, CASES[0].optics)
    tables = [compared(case, arguments.photons) for case in CASES]
    if arguments.figure:
        draw(tables, arguments.figure)


def compared(case: Case, n_photons: int) -> np.ndarray:
    """Print and return the rows depth (mm), photons, their standard error, diffusion."""
    boundary, wall, cpu = case.boundary, perf_counter(), process_time()
    runs = [MonteCarlo(n_photons=n_photons, seed=s, **case.extra).fluence(boundary, case.optics) for s in range(RUNS)]
    wall, cpu = (perf_counter() - wall) / RUNS, (process_time() - cpu) / RUNS
    means = np.array([at_depths(run, case) for run in runs])
    diffusion = oatkit.plugin("fluence_model", "diffusion-fvm")(**case.extra).fluence(boundary, case.optics)
    columns = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(RUNS), at_depths(diffusion, case)
    noise = runs[0].diagnostics["relative_error_median"][0]
    path = 10 / (case.absorption_per_cm + case.scattering_per_cm)
    print(
        f"\n{case.title}: disc of {2 * case.radius_mm:g} mm, mu_a {case.absorption_per_cm:g} and mu_s' "
        f"{case.scattering_per_cm:g} per cm, free path {path:.2g} mm\n"
        f"one run of {n_photons:,} photons: {wall:.1f} s, {cpu:.1f} s of CPU; median error of a pixel {noise:.2%}\n"
        "depth mm   free paths   photons     error   diffusion   diffusion / photons"
    )
    for depth, photons, error, light in zip(case.depths_mm, *columns, strict=True):
        print(
            f"{depth:8.2f} {depth / path:12.2f} {photons:9.4g} {error:9.1g} {light:11.4g} {light / photons:21.3f}",
            flush=True,
        )
    return np.array([case.depths_mm, *columns])


def at_depths(image: Image, case: Case) -> np.ndarray:
    """Return the mean over a ring of pixels, two wide, at each depth."""
    depth = -1e3 * case.boundary.values[0]
    near = [abs(depth - d) <= 1e3 * image.grid.pixel_size_m for d in case.depths_mm]
    return np.array([image.values[0][ring & (depth > 0)].mean() for ring in near])


def draw(tables: list[np.ndarray], path: Path) -> None:
    """Draw the fluence by depth, and below it what diffusion says over what photons say."""
    from matplotlib.figure import Figure

    figure = Figure((3.4 * len(tables), 5.2), layout="constrained")
    above, below = figure.subplots(2, len(tables), height_ratios=(2, 1), sharex="col")
    for case, (depth, photons, error, diffusion), top, bottom in zip(CASES, tables, above, below, strict=True):
        top.plot(depth, diffusion, "-", color="C1", label="diffusion-fvm")
        top.errorbar(depth, photons, 2 * error, fmt="o", color="C0", ms=4, label="monte-carlo, 2 standard errors")
        top.set(title=case.title, yscale="log" if photons.max() > 10 * photons.min() else "linear")
        bottom.errorbar(depth, diffusion / photons, 2 * error * diffusion / photons**2, fmt="o-", color="C1", ms=4)
        bottom.axhline(1, color="0.6", lw=1)
        bottom.set(xlabel="depth, mm", ylim=(0.4, 1.6))
    above[0].set_ylabel("fluence, relative")
    below[0].set_ylabel("diffusion / photons")
    above[0].legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def cpu_model() -> str:
    """Return the name of the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


if __name__ == "__main__":
    main()
