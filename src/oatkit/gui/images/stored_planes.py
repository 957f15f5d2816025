"""An image of a stored result with all its frames, as an array that reads a frame when it is looked at."""

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.errors import OatkitError
from oatkit.memo import Memo

PAINTING_S = 0.04
"""How long reading ahead leaves the processor to the picture of the frame that was asked for."""


class StoredPlanes:
    """Looks to napari like an array of shape ``(frame, wavelength, y, x)``, row 0 at the top.

    A frame that failed or is damaged has no values. `first` is any frame that has some; an image without wavelengths
    is the same at each of `planes`. The frames that were looked at last are kept in `memo`, which images may share.
    """

    ndim = 4

    def __init__(self, read: Callable[[int], Image], frames: int, first: Image, planes: int, memo: Memo) -> None:
        self._read = read
        self._memo = memo
        self._last = 0
        self._hurry = threading.Event()
        self._coming, self._reader = -1, threading.Thread()
        """Which frame is read ahead, and who reads it; one that was never started has nothing to do."""
        self.shape = (frames, max(planes, len(first.values)), *first.grid.shape)
        self.dtype = first.values.dtype

    @property
    def size(self) -> int:
        """Number of values."""
        return int(np.prod(self.shape, dtype=np.int64))

    def image(self, frame: int) -> Image | str:
        """Return the image of a frame, or the reason why there is none."""
        reader = self._reader
        if frame == self._coming and reader.is_alive() and reader is not threading.current_thread():
            self._hurry.set()
            reader.join()
        return self._memo.get((id(self), frame), lambda: self._image(frame), _bytes)

    def __getitem__(self, key: Any) -> np.ndarray:
        frame, *rest = key if isinstance(key, tuple) else (key,)
        chosen = np.arange(self.shape[0])[frame]
        planes = [self._planes(int(i))[tuple(rest)] for i in np.atleast_1d(chosen)]
        if len(planes) == 1:  # what napari asks for at each step: a slice of one frame
            self._read_ahead(int(chosen if chosen.ndim == 0 else chosen[0]))
        return np.stack(planes) if chosen.ndim else planes[0]

    def _read_ahead(self, frame: int) -> None:
        """Read the frame beside one that is asked for, on the side to which the slider moves."""
        beside = frame + (1 if frame >= self._last else -1)
        self._last = frame
        if not self._reader.is_alive() and 0 <= beside < self.shape[0] and self._memo.peek((id(self), beside)) is None:
            self._coming = beside
            self._hurry.clear()
            self._reader = threading.Thread(target=self._read_later, args=(beside,), name="oatkit read", daemon=True)
            self._reader.start()

    def _read_later(self, frame: int) -> None:
        self._hurry.wait(PAINTING_S)
        self.image(frame)

    def _image(self, frame: int) -> Image | str:
        try:
            return self._read(frame)
        except OatkitError as error:
            return str(error)

    def _planes(self, frame: int) -> np.ndarray:
        image = self.image(frame)
        if isinstance(image, str):
            return np.broadcast_to(self.dtype.type("nan"), self.shape[1:])
        return np.broadcast_to(image.values[:, ::-1], self.shape[1:])


def _bytes(image: Image | str) -> int:
    return len(image) if isinstance(image, str) else image.values.nbytes
