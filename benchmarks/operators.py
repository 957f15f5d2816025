"""Time the acoustic operators against each other and against the bound of the arithmetic, all in one run.

One pass of every operator follows the other, so that whatever else the machine does falls on all of them; medians of
the passes are shown. Read the ratios: milliseconds are those of this machine at this moment.
"""

import argparse
import os
import platform
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np
from numba import njit

import oatkit
from oatkit.data import Detectors, Geometry, Grid
from oatkit.threads import thread_count

BOUND_CYCLES = 2.5
"""Cycles of one core that a pair of a pixel and a detector takes at least."""

MODELS = ("arc", "immi")


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, nargs="+", default=[200, 256], help="pixels along a side of 25 mm")
    parser.add_argument("--detectors", type=int, default=256, help="on an arc of 270 degrees and 40.5 mm")
    parser.add_argument("--repeats", type=int, default=15, help="passes over which medians are taken")
    parser.add_argument("--ghz", type=float, help="clock of a core; measured where it is not given")
    arguments = parser.parse_args()
    ghz = arguments.ghz or measured_ghz()
    source = "given" if arguments.ghz else "measured"
    print(f"{cpu_model()}, {os.cpu_count()} cores, {thread_count()} threads, {ghz:.2f} GHz ({source})")
    geometry = scanner(arguments.detectors)
    for pixels in arguments.pixels:
        report(geometry, Grid((pixels, pixels), 25e-3 / pixels), arguments.repeats, ghz)


def report(geometry: Geometry, grid: Grid, repeats: int, ghz: float) -> None:
    """Print the times of all models on one grid, and their ratios."""
    operators = {name: oatkit.plugin("forward_model", name)().operator(geometry, grid) for name in MODELS}
    times = measure(operators, repeats)
    pairs = grid.shape[0] * grid.shape[1] * geometry.detectors.count
    print(f"\n{grid.shape[0]} x {grid.shape[1]} pixels, {geometry.detectors.count} detectors, {repeats} passes")
    print(f"{'':6}{'forward':>12}{'adjoint':>12}{'pair':>12}{'ns per pixel and detector':>28}")
    for name in MODELS:
        forward, adjoint = times[name]
        each = f"{1e9 * forward / pairs:.2f} + {1e9 * adjoint / pairs:.2f}"
        milliseconds = "".join(f"{1e3 * t:9.1f} ms" for t in (forward, adjoint, forward + adjoint))
        print(f"{name:6}{milliseconds}{each:>28}")
    arc, immi = (sum(times[name]) for name in MODELS)
    bound = 2 * pairs * BOUND_CYCLES / (ghz * 1e9) / thread_count()
    print(f"immi / arc: {immi / arc:.1f}    arc / bound of {BOUND_CYCLES} cycles on {thread_count()} threads: ", end="")
    print(f"{arc / bound:.1f}")


def measure(operators: dict, repeats: int) -> dict[str, tuple[float, float]]:
    """Return the median seconds of forward and adjoint of each operator."""
    rng = np.random.default_rng(0)
    seconds: dict[str, list] = {name: [] for name in operators}
    for _ in range(repeats + 1):
        for name, operator in operators.items():
            image, record = (rng.standard_normal(n, np.float32) for n in reversed(operator.shape))
            start = perf_counter()
            operator.matvec(image)
            middle = perf_counter()
            operator.rmatvec(record)
            seconds[name].append((middle - start, perf_counter() - middle))
    # The first pass compiles and warms the caches.
    return {name: tuple(median(column) for column in zip(*rows[1:], strict=True)) for name, rows in seconds.items()}


def scanner(n_detectors: int) -> Geometry:
    """Return an arc of detectors as in a small-animal scanner."""
    angles = np.deg2rad(np.linspace(-45, 225, n_detectors))
    detectors = Detectors(0.0405 * np.column_stack([np.sin(angles), np.cos(angles)]))
    return Geometry(detectors, 40e6, 2030, speed_of_sound_m_s=1500)


def cpu_model() -> str:
    """Return the name of the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def measured_ghz() -> float:
    """Return the clock of a core: the fastest of 50 runs of a chain of operations of one cycle each."""
    rounds = 1_000_000
    seconds = []
    for _ in range(50):
        start = perf_counter()
        chain(rounds)
        seconds.append(perf_counter() - start)
    return 6 * rounds / min(seconds) / 1e9


@njit
def chain(rounds: int) -> np.uint64:
    """Run a xorshift generator: six operations a round, each of which needs the one before."""
    state = np.uint64(88172645463325252)
    for _ in range(rounds):
        state ^= state << np.uint64(13)
        state ^= state >> np.uint64(7)
        state ^= state << np.uint64(17)
    return state


if __name__ == "__main__":
    main()
