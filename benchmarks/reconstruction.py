"""Whole reconstructions in time and memory, each a process of its own, as ratios of one run.

    python benchmarks/reconstruction.py [--scan SCAN] [--pixels 200 256] [--rounds 3] [--patato VENV]

Without `--scan`, a simulated one. With `--patato`, PATATO 0.7.0 runs beside in the environment VENV, which is made and
filled by pip where it does not exist. Rounds are interleaved (A B C A B C ...), medians are printed: the machine is
shared, so read ratios, not seconds.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from oatkit import Pipeline, read
from oatkit.reconstruction import preprocess
from operators import cpu_model

HERE = Path(__file__).parent
SOLVERS = ("lsqr", "nnls", "tv", "l1", "maxent-nlcg", "backprojection")
PATATO = "patato==0.7.0"


def main() -> None:
    """Measure and print the table."""
    options = arguments()
    with tempfile.TemporaryDirectory() as folder:
        problem = Path(folder) / "problem.npz"
        write_problem(problem, options.scan)
        print(f"machine: {machine()}; medians of {options.rounds} interleaved rounds; one process each, JIT warm")
        for pixels in options.pixels:
            measure(problem, pixels, options)


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scan", type=Path, help="a real scan; its first frame and wavelength are taken")
    parser.add_argument("--pixels", type=int, nargs="+", default=[200, 256])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--patato", type=Path, metavar="VENV", help="run PATATO beside, in this environment")
    return parser.parse_args()


def write_problem(file: Path, scan_path: Path | None) -> None:
    """Write the preprocessed signals of one frame, and where they were taken, for all contestants alike."""
    if scan_path is None:
        from oatkit.demo import simulated

        scan, _ = simulated("breast", snr_db=32.0, seed=0)
    else:
        scan = read(scan_path)
    clean = preprocess(Pipeline.load("maxent"), scan, 0)
    geometry = clean.geometry
    response = geometry.impulse_response
    np.savez(
        file,
        data=np.asarray(clean.signals)[0, 0],
        positions_m=geometry.detectors.positions_m,
        sampling_rate_hz=geometry.sampling_rate_hz,
        start_time_s=geometry.start_time_s,
        speed_of_sound_m_s=geometry.speed_of_sound_m_s,
        impulse_response=np.zeros(0) if response is None else response,
    )


def measure(problem: Path, pixels: int, options: argparse.Namespace) -> None:
    """Run all contestants in rounds and print a line for each."""
    ours = [sys.executable, str(HERE / "one_reconstruction.py"), str(problem), str(pixels)]
    contestants = {name: [*ours, name] for name in SOLVERS}
    contestants["maxent-nlcg, the next data"] = [*ours, "maxent-nlcg", "next"]
    for command in contestants.values():
        run(command)  # compiles, and warms the disk
    peer_command: list[str] = []
    if options.patato:
        peer_command = [str(peer_python(options.patato)), str(HERE / "peer_patato.py"), str(problem), str(pixels)]
        peer = run(peer_command)
        # Its weight is 1 in its own units, next to nothing; so is ours in the comparison.
        print(f"\nPATATO: weight 1, which is {peer['weight']:.1e} |A|^2 / |L|^2")
        contestants["lsqr to PATATO's residual"] = [*ours, "lsqr", str(peer["residual"]), "1.0"]
        contestants["PATATO, 10 LSQR steps"] = peer_command
    rows: dict[str, list[dict[str, float]]] = {name: [] for name in contestants}
    for _ in range(options.rounds):
        for name, command in contestants.items():
            rows[name].append(run(command))
    print(f"\n{pixels} x {pixels} pixels")
    print(f"{'':<28}{'build s':>9}{'solve s':>9}{'products':>9}{'residual':>9}{'gap':>9}{'negative':>9}{'peak MB':>9}")
    for name, runs in rows.items():
        print(line(name, runs))
    if options.patato:
        print_ratios(rows["PATATO, 10 LSQR steps"], rows["lsqr to PATATO's residual"])


def line(name: str, runs: list[dict[str, float]]) -> str:
    """Return the medians of one contestant as a line of the table."""
    one = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
    return (
        f"{name:<28}{one['build_s']:9.2f}{one['solve_s']:9.2f}{one.get('products', float('nan')):9.0f}"
        f"{one['residual']:9.3f}{one.get('gap', float('nan')):9.1e}{100 * one['negative']:8.1f}%"
        f"{one['peak_bytes'] / 1e6:9.0f}"
    )


def print_ratios(peer: list[dict[str, float]], ours: list[dict[str, float]]) -> None:
    """Print PATATO's figures over ours, pair by pair of the rounds."""
    pairs = list(zip(peer, ours, strict=True))
    whole = [(p["build_s"] + p["solve_s"]) / (o["build_s"] + o["solve_s"]) for p, o in pairs]
    solving = [p["solve_s"] / o["solve_s"] for p, o in pairs]
    memory = [o["peak_bytes"] / p["peak_bytes"] for p, o in pairs]
    print("PATATO over oatkit's lsqr to the same residual (median, min, max):")
    for text, values in (
        ("time, building the operators counted", whole),
        ("time, without building the operators", solving),
        ("oatkit's peak memory as a part of PATATO's", memory),
    ):
        print(f"  {text:<44}{statistics.median(values):8.2f}{min(values):8.2f}{max(values):8.2f}")


def run(command: list[str]) -> dict[str, float]:
    """Run one contestant and return what it printed."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def peer_python(venv: Path) -> Path:
    """Return the Python of an environment with PATATO, made on the first call."""
    python = venv / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "-q", PATATO], check=True)
    return python


def machine() -> str:
    """Name processor, cores and Python."""
    return f"{cpu_model()}, {os.cpu_count()} cores, Python {platform.python_version()}"


if __name__ == "__main__":
    main()
