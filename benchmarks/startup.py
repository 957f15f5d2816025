"""How long the command line takes to start, alone and beside many broken plugins.

    python benchmarks/startup.py

Prints medians of seven starts of `oatkit --help`, and of `oatkit plugins`, which imports all plugins, with their ratio.
The broken packages are those of the tests.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from operators import cpu_model
from packages import install
from test_registry import BROKEN, GOOD

STARTS = 7


def median_s(argument: str, path: Path | None = None) -> float:
    """Return the median time of a command, s, with the packages of a folder beside those that are installed."""
    environment = {**os.environ, **({"PYTHONPATH": str(path)} if path else {})}
    command = [sys.executable, "-c", "from oatkit.cli import main; main()", argument]
    times = []
    for _ in range(STARTS):
        start = time.perf_counter()
        subprocess.run(command, env=environment, capture_output=True, check=True)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main() -> None:
    """Install, start, print."""
    with tempfile.TemporaryDirectory() as folder:
        packages = Path(folder) / "packages"
        install(packages, "oatkit-good", GOOD.format(name="landweber"))
        for name, (module, _) in BROKEN.items():
            install(packages, f"oatkit-{name}", module)
        alone, beside = median_s("plugins"), median_s("plugins", packages)
    print(f"{cpu_model()}: {median_s('--help'):.2f} s for help; all plugins: {alone:.2f} s")
    print(f"beside {len(BROKEN)} broken plugins: {beside:.2f} s, {beside / alone:.2f} times that")


if __name__ == "__main__":
    main()
