"""Small plugin packages, installed by pip from wheels made on the spot: real distributions, without an index."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

from oatkit.registry import OURS, installed


def built_in(kind: str) -> list[type]:
    """The plugins of a kind that ship with oatkit, whatever else is installed."""
    return [e.cls for e in installed().entries if e.distribution == OURS and e.kind == kind]


def install(target: Path, name: str, module: str, version: str = "1.0") -> Path:
    """Install a one-module distribution with an entry point of the group ``oatkit`` into the folder `target`."""
    safe = name.replace("-", "_")
    wheel = target.parent / f"{safe}-{version}-py3-none-any.whl"
    info = f"{safe}-{version}.dist-info"
    files = {
        f"{safe}.py": module,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": f"[oatkit]\n{name} = {safe}\n",
    }
    record = "".join(f"{path},,\n" for path in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, text in {**files, f"{info}/RECORD": record}.items():
            archive.writestr(path, text)
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--no-deps", "--target", str(target), str(wheel)]
    subprocess.run(pip, check=True, capture_output=True)
    return target


def run_oatkit(*arguments: str, path: Path | None = None, **options) -> subprocess.CompletedProcess[str]:
    """Run the command line as a process of its own, with the packages installed in `path` visible to it."""
    environment = options.pop("env", None) or dict(os.environ) | ({"PYTHONPATH": str(path)} if path else {})
    command = [sys.executable, "-c", "from oatkit.cli import main; main()", *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=200, **options)
