"""The layout's promise: imports run one way, and what is heavy is loaded only when it is needed."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import oatkit

SOURCE = Path(oatkit.__file__).parent

HEAVY = (
    "numba",
    "zarr",
    "matplotlib",
    "napari",
    "dask",
    "scipy.fft",
    "scipy.special",
    "scipy.sparse",
    "h5py",
    "skimage",
    "tifffile",
    "typer",
)

ORDER = [
    {"checkpoint", "compiled", "errors", "laplacian", "names", "vectors"},
    {"content", "atomic", "threads", "plain", "hdf5_heaps"},
    {"hostile", "data"},
    {
        "parameters", "checked", "csv_cell", "label_files", "light", "metrics", "polygons", "scale", "scanfile",
        "slips", "spectra", "wavelengths", "words",
    },
    {"problem", "ipasc", "masking", "outlines", "shapes", "tables"},
    {"api"},
    {"blame", "events", "hookspecs", "simulate"},
    {"registry", "weights"},
    {"pipeline", "reading", "scaffold", "testing"},
    {"result"},
    {"memo", "drawing"},
    {"figure", "kinetics", "motion", "reconstruction", "regions"},
    {"quantification", "focus"},
    {"store", "engine", "describe", "citing"},
    {"batch", "convert", "export", "report"},
    {"demo", "paper"},
    {"gui"},
    {"cli"},
]  # fmt: skip
"""Layers of modules from the ground up: a module imports only from layers below its own."""

UPWARDS = {("result", "store")}
"""The one exception: `Result.save` is promised, and imports the store when it is called."""

FOR_BUILTINS = {
    "api", "checkpoint", "compiled", "content", "data", "errors", "hostile", "ipasc", "label_files", "laplacian",
    "light", "masking", "parameters", "polygons", "scanfile", "spectra", "threads", "vectors",
}  # fmt: skip


def imported(path: Path) -> set[str]:
    """The oatkit modules that a file imports anywhere in it, by their first name below the package."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "oatkit":
            parts = node.module.split(".")[1:]
            found |= {parts[0]} if parts else {alias.name for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {a.name.split(".")[1] for a in node.names if a.name.startswith("oatkit.")}
    return found


def module_of(path: Path) -> str:
    """The first name of a file's module below the package."""
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", sorted(SOURCE.rglob("*.py")), ids=lambda p: str(p.relative_to(SOURCE)))
def test_imports_run_one_way(path):
    """A module imports only from below its own layer; nobody imports `builtin`, which imports only what is its."""
    module = module_of(path)
    if module == "__init__":
        return
    names = imported(path) - {module}
    if module == "builtin":
        assert names <= FOR_BUILTINS
        return
    layer = {name: level for level, names_ in enumerate(ORDER) for name in names_}
    assert module in layer, f"{module} has no layer: give it one in ORDER"
    assert "builtin" not in names
    wrong = [name for name in names if layer[name] >= layer[module] and (module, name) not in UPWARDS]
    assert not wrong, f"{module} imports {wrong}, which are not below it"


def loaded_after(code: str, looked_for: tuple[str, ...] = HEAVY) -> set[str]:
    """Which of some modules a fresh interpreter holds after running `code`."""
    script = f"{code}\nimport sys\nprint(*[m for m in {looked_for!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_oatkit_loads_nothing_heavy():
    """`import oatkit` pays for no library that is not needed yet."""
    assert loaded_after("import oatkit") == set()


def test_the_command_line_starts_with_next_to_nothing():
    """Help and the version wait for neither numpy nor pydantic, nor for any module that computes."""
    assert loaded_after("import oatkit.cli", ("numpy", "pydantic", "oatkit.data", "oatkit.registry")) == set()


def test_every_public_name_is_there_though_it_is_imported_late():
    """What the stub says is what the package has, and modules are reached as attributes; other names are an error."""
    code = "import oatkit; print(*[n for n in [*oatkit.__all__, 'weights', 'spectra'] if not getattr(oatkit, n)])"
    assert loaded_after(code) <= set(HEAVY)
    assert set(oatkit.__all__) <= set(dir(oatkit))
    with pytest.raises(AttributeError, match="module 'oatkit' has no attribute 'reed'"):
        oatkit.reed  # noqa: B018


def test_declaring_plugins_loads_nothing_heavy():
    """Listing every installed plugin and loading a preset pays for no library that is not needed yet."""
    code = "import oatkit; from oatkit.registry import installed; installed(); oatkit.Pipeline.load('maxent')"
    assert loaded_after(code) == set()
