"""Finished images in a file, read as they are asked for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NoReturn, overload

from oatkit.data import Image
from oatkit.errors import ReadError

COMPONENTS = {
    "hb": "deoxyhaemoglobin", "hbo2": "oxyhaemoglobin", "melanin": "melanin", "icg": "icg", "lipid": "lipid",
    "h2o": "water", "water": "water",
}  # fmt: skip
"""What a component of an unmixing is called here, by what other programs call it, in small letters."""


@dataclass(frozen=True)
class StoredImages(Sequence[Image]):
    """One image for each frame. Reading one raises `ReadError` where the file holds no image of a plane there."""

    frames: int
    read_frame: Callable[[int], Image]

    def __len__(self) -> int:
        return self.frames

    @overload
    def __getitem__(self, index: int) -> Image: ...
    @overload
    def __getitem__(self, index: slice) -> list[Image]: ...
    def __getitem__(self, index: int | slice) -> Image | list[Image]:
        chosen = range(self.frames)[index]
        return self.read_frame(chosen) if isinstance(chosen, int) else [self.read_frame(frame) for frame in chosen]


def refuse(message: str, frame: int) -> NoReturn:
    """Raise `ReadError`; stands in for the reading of images that are there but cannot be had."""
    raise ReadError(message)


def component_name(name: str) -> str:
    """Return our name of a component; another program's where we have none."""
    return COMPONENTS.get(name.strip().lower(), name.strip())
