"""PATATO's model-based reconstruction of the same data; runs in PATATO's own environment, without oatkit.

Called by `reconstruction.py`: ``peer_patato.py PROBLEM.npz PIXELS``; prints one line of JSON. Ten LSQR steps with
PATATO's Laplacian at its default weight: what its class does unless told otherwise.
"""

import contextlib
import json
import resource
import sys
import time
import warnings

import numpy as np

FIELD_OF_VIEW_M = 25e-3


def main() -> None:
    """Reconstruct and print what it took."""
    warnings.simplefilter("ignore")
    file, pixels = sys.argv[1], int(sys.argv[2])
    held = np.load(file, allow_pickle=False)
    data = np.asarray(held["data"], np.float64)
    y, x = held["positions_m"].T
    response = held["impulse_response"]
    from patato.recon.model_based.model_based import ModelBasedReconstruction

    start = time.perf_counter()
    with contextlib.redirect_stdout(sys.stderr):
        method = ModelBasedReconstruction(
            (pixels, pixels, 1),
            (FIELD_OF_VIEW_M, FIELD_OF_VIEW_M, 0.0),
            regulariser="laplacian",
            kwargs_model={
                "geometry": np.column_stack([x, y, np.zeros_like(x)]),
                "fs": float(held["sampling_rate_hz"]),
                "nt": data.shape[1],
                "c": float(held["speed_of_sound_m_s"]),
                "irf_model": response if response.size else None,
                "gpu": False,
            },
        )
        built = time.perf_counter()
        image = method._model(data.ravel())
    done = time.perf_counter()
    residual = np.linalg.norm(method._model_matrix[0] @ np.ravel(image) - data.ravel())
    table = {
        "build_s": built - start,
        "solve_s": done - built,
        "residual": float(residual / np.linalg.norm(data)),
        "negative": float((image < 0).mean()),
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }
    print(json.dumps(table))


if __name__ == "__main__":
    main()
