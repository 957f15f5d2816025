"""One reconstruction in a process of its own, so that its time and its peak memory are its own.

Called by `reconstruction.py`: ``one_reconstruction.py PROBLEM.npz PIXELS SOLVER [RESIDUAL WEIGHT | next]``; prints one
line of JSON. With RESIDUAL, the solver is left at the first iterate whose residual (as a part of the data's norm) is at
most that, and its penalty has the absolute WEIGHT. With "next", what is timed is the reconstruction after another one
of the same operator, as of the next wavelength of a scan: its data are the first ones, weaker and with other noise.
The libraries are imported before the clock starts, PATATO's as ours.
"""

import json
import resource
import sys
import time
from dataclasses import replace
from importlib import import_module

import numpy as np

from oatkit import Detectors, Geometry, Grid, plugin
from oatkit.api import Problem

FIELD_OF_VIEW_M = 25e-3


def main() -> None:
    """Reconstruct and print what it took."""
    file, pixels, name = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    following = sys.argv[4:] == ["next"]
    wanted = float(sys.argv[4]) if len(sys.argv) == 6 else 0.0
    with np.load(file, allow_pickle=False) as held:
        data, geometry = held["data"], geometry_of(held)
    import_libraries()
    start = time.perf_counter()
    grid = Grid((pixels, pixels), FIELD_OF_VIEW_M / pixels)
    problem = Problem(plugin("forward_model", "arc")().operator(geometry, grid), data, grid.shape, geometry, grid)
    build_s = time.perf_counter() - start
    weight = {"weight": float(sys.argv[5]), "scaling": "absolute"} if wanted else {}
    solver = plugin("solver", name)(**weight)
    if following:
        problem = replace(problem, data=changed(data), start=solver.solve(problem).image)
    start = time.perf_counter()
    for state in solver.iterate(problem):
        if state.residual_norm <= wanted * np.linalg.norm(problem.data):
            break
    done = time.perf_counter()
    table = {
        "build_s": build_s,
        "solve_s": done - start,
        "products": state.products,
        "iterations": state.iteration,
        "residual": state.residual_norm / float(np.linalg.norm(problem.data)),
        "gap": state.relative_gap,
        "negative": float((state.image < 0).mean()),
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }
    print(json.dumps(table))


def import_libraries() -> None:
    """Import what a first call would import."""
    for library in ("numba", "scipy.ndimage", "scipy.special"):
        import_module(library)
    for kind, name in (("forward_model", "arc"), ("solver", sys.argv[3])):
        plugin(kind, name)


def changed(data: np.ndarray) -> np.ndarray:
    """Return the data of a neighbour: 10 % weaker, with fresh noise of 3 % of their root mean square."""
    noise = np.random.default_rng(1).standard_normal(data.shape)
    return 0.9 * data + 0.03 * np.sqrt((data**2).mean()) * noise


def geometry_of(held: dict[str, np.ndarray]) -> Geometry:
    """Return the geometry that the problem file holds."""
    response = held["impulse_response"]
    return Geometry(
        Detectors(held["positions_m"]),
        float(held["sampling_rate_hz"]),
        held["data"].shape[1],
        float(held["start_time_s"]),
        float(held["speed_of_sound_m_s"]),
        response if response.size else None,
    )


if __name__ == "__main__":
    main()
