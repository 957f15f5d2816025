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
    data, response = as_patato_wants(held)
    y, x = held["positions_m"].T
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
                "irf_model": response,
            },
        )
        built = time.perf_counter()
        image = method._model(data.ravel())
    done = time.perf_counter()
    residual = np.linalg.norm(np.ravel(method._model_matrix[0] @ np.ravel(image)) - data.ravel())
    model, penalty = method._model_matrix
    weight = (norm(penalty, pixels**2) / norm(model, pixels**2)) ** 2  # PATATO's lambda is 1
    table = {
        "build_s": built - start,
        "solve_s": done - built,
        "residual": float(residual / np.linalg.norm(data)),
        "negative": float((image < 0).mean()),
        "weight": weight,
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }
    print(json.dumps(table))


def norm(operator: object, size: int, steps: int = 12) -> float:
    """Return the spectral norm by the power iteration, to a few per cent; it is not part of what is timed."""
    vector = np.random.default_rng(0).standard_normal(size)
    for _ in range(steps):
        vector = np.ravel(operator.rmatvec(np.ravel(operator.matvec(vector / np.linalg.norm(vector)))))
    return float(np.sqrt(np.linalg.norm(vector)))


def as_patato_wants(held: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the signals from time zero on, and the impulse response of their length with time zero in its middle."""
    missing = round(float(held["start_time_s"]) * float(held["sampling_rate_hz"]))
    data = np.pad(np.asarray(held["data"], np.float64), ((0, 0), (missing, 0)))
    response, samples = held["impulse_response"], data.shape[1]
    if not response.size:
        return data, None
    padded = np.pad(response, samples)
    first = samples + len(response) // 2 - samples // 2
    return data, padded[first : first + samples]


if __name__ == "__main__":
    main()
