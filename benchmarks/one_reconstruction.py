"""One reconstruction in a process of its own, so that its time and its peak memory are its own.

Called by `reconstruction.py`: ``one_reconstruction.py PROBLEM.npz PIXELS SOLVER [RESIDUAL WEIGHT]``; prints one line of
JSON. With RESIDUAL, the solver is left at the first iterate whose residual (as a part of the data's norm) is at most
that, and its penalty has the absolute WEIGHT.
"""

import json
import resource
import sys
import time

import numpy as np

from oatkit import Detectors, Geometry, Grid, plugin
from oatkit.api import Problem

FIELD_OF_VIEW_M = 25e-3


def main() -> None:
    """Reconstruct and print what it took."""
    file, pixels, name = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    wanted = float(sys.argv[4]) if len(sys.argv) > 4 else 0.0
    with np.load(file, allow_pickle=False) as held:
        data, geometry = held["data"], geometry_of(held)
    start = time.perf_counter()
    grid = Grid((pixels, pixels), FIELD_OF_VIEW_M / pixels)
    problem = Problem(plugin("forward_model", "arc")().operator(geometry, grid), data, grid.shape, geometry, grid)
    built = time.perf_counter()
    weight = {"weight": float(sys.argv[5]), "scaling": "absolute"} if wanted else {}
    for state in plugin("solver", name)(**weight).iterate(problem):
        if state.residual_norm <= wanted * np.linalg.norm(data):
            break
    done = time.perf_counter()
    table = {
        "build_s": built - start,
        "solve_s": done - built,
        "products": state.products,
        "iterations": state.iteration,
        "residual": state.residual_norm / float(np.linalg.norm(data)),
        "gap": state.relative_gap,
        "negative": float((state.image < 0).mean()),
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }
    print(json.dumps(table))


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
