"""What commands open: results, and the regions that are measured in them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from oatkit.errors import ReadError, ResultError


@contextmanager
def damage_is_unreadable() -> Iterator[None]:
    """Make a damaged result what it is to a command: unreadable input."""
    try:
        yield
    except ResultError as error:
        raise ReadError(str(error)) from None


def stored_frame(path: Path, frame: int | None) -> Any:
    """Read one frame of a result, the first good one unless said; a damaged result is unreadable input."""
    from oatkit.store import load

    with damage_is_unreadable():
        stored = load(path)
        chosen = stored if frame is None else stored.frame(frame)
        return replace(chosen, images=dict(chosen))


def regions_in(files: Sequence[Path], images: Mapping[str, Any]) -> list[Any]:
    """Read the regions in files; a mask lies on the grid of the first of the images."""
    from oatkit.regions import load_regions

    grid = next(iter(images.values())).grid
    return [region for file in files for region in load_regions(file, grid)]
