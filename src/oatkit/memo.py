"""What the engine has computed already, so that only what changed is computed again."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, TypeVar

T = TypeVar("T")


class Memo:
    """A cache by key that forgets the least recently used once its values exceed `limit_bytes`.

    Safe to share between threads; two threads that miss the same key both compute it.
    """

    def __init__(self, limit_bytes: int = 256_000_000) -> None:
        self.limit_bytes = limit_bytes
        self._values: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._newest: tuple[Hashable, Any] | None = None
        self._lock = Lock()

    def get(self, key: Hashable, compute: Callable[[], T], size: Callable[[T], int]) -> T:
        """Return the value of `key`, computed on the first call; `size` tells its bytes."""
        found = self.peek(key)
        if found is None:
            found = compute()
            self.put(key, found, size(found))
        return found

    def keep(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return the value of `key`; of these only the newest is held, whatever its size: an acoustic operator."""
        if self._newest is None or self._newest[0] != key:
            self._newest = (key, compute())
        return self._newest[1]

    def peek(self, key: Hashable) -> Any:
        """Return the value of `key`, or None."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def put(self, key: Hashable, value: Any, size: int) -> None:
        """Remember a value of `size` bytes; the newest is kept whatever its size."""
        with self._lock:
            self._values[key] = (value, size)
            self._values.move_to_end(key)
            while len(self._values) > 1 and sum(s for _, s in self._values.values()) > self.limit_bytes:
                self._values.popitem(last=False)

    def forget(self, *beginning: Hashable) -> None:
        """Drop the values of all keys that are tuples which begin so."""
        with self._lock:
            for key in [key for key in self._values if isinstance(key, tuple) and key[: len(beginning)] == beginning]:
                del self._values[key]

    def __len__(self) -> int:
        return len(self._values)
