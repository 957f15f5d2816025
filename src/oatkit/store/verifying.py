"""Whether a result folder is complete and as it was written."""

import os
from pathlib import Path

from oatkit.errors import ResultError
from oatkit.store.folder import Store, check_file
from oatkit.store.manifest import FILE_NAME, chunk_file, read_manifest


def verify(path: str | Path) -> list[str]:
    """Read every byte of a result folder and return what is wrong with it, one sentence each; nothing if all is well.

    Files are looked for in the folder, never under a name that the manifest gives.
    """
    folder = Path(path)
    try:
        manifest = read_manifest(folder)
    except ResultError as error:
        return [str(error)]
    found, declared = _files(folder), manifest.files.keys()
    problems = [f"{folder}: {name!r} is missing" for name in sorted(declared - found)]
    problems += [f"{folder}: {name!r} does not belong to the result" for name in sorted(found - declared)]
    for name in sorted(found & declared):
        try:
            check_file(folder, name, manifest)
        except ResultError as error:
            problems.append(str(error))
    return problems or _contradictions(Store(folder, manifest))


def _files(folder: Path) -> set[str]:
    """Return the paths of all files below `folder` from it, links to folders counted as files, but the manifest."""
    found: set[str] = set()
    for parent, folders, files in os.walk(folder):
        links = [name for name in folders if os.path.islink(os.path.join(parent, name))]
        found |= {(Path(parent) / name).relative_to(folder).as_posix() for name in (*files, *links)}
    return found - {FILE_NAME}


def _contradictions(store: Store) -> list[str]:
    """Return where the intact parts of a folder contradict each other."""
    try:
        store.arrays  # noqa: B018  checks what they declare
    except ResultError as error:
        return [str(error)]
    names, declared = store.manifest.images, store.manifest.files.keys()
    expected = {"zarr.json", *(f"{name}/zarr.json" for name in names)}
    expected |= {chunk_file(name, int(i)) for i in store.manifest.records for name in names}
    problems = [f"{store.path}: {name!r} does not belong to any image" for name in sorted(declared - expected)]
    return problems + [f"{store.path}: {name!r} was never written" for name in sorted(expected - declared)]
