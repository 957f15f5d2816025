"""The one pool of threads of this package.

Kernels are serial and release the GIL; whoever has independent pieces of work hands them to `for_each`. The pool has
``OATKIT_THREADS`` threads, or as many as there are usable cores. It is made when first needed, once per process, so
that forked and spawned workers get their own.
"""

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

from oatkit.errors import ValidationError

_PREFIX = "oatkit-pool"


def thread_count() -> int:
    """Return the number of threads: ``OATKIT_THREADS``, else the number of cores this process may use.

    Raises `ValidationError` where the variable is no whole number of at least 1.
    """
    text = os.environ.get("OATKIT_THREADS", "").strip()
    if not text:
        return _usable_cores()
    if not (text.isascii() and text.isdigit() and int(text) >= 1):
        raise ValidationError(f"OATKIT_THREADS: must be a whole number of at least 1, got '{text}'")
    return int(text)


def for_each(function: Callable[[Any], None], items: Iterable[Any]) -> None:
    """Call `function` with each item, on all threads of the pool; the first exception is raised.

    Called from one of the pool's own threads, it works in that thread, since waiting there could wait for ever.
    """
    count = thread_count()
    if count == 1 or threading.current_thread().name.startswith(_PREFIX):
        for item in items:
            function(item)
        return
    for _ in _pool(os.getpid(), count).map(function, items):
        pass


@cache
def _pool(process: int, count: int) -> ThreadPoolExecutor:
    # The process is part of the key because a forked child inherits the pool but none of its threads.
    return ThreadPoolExecutor(count, thread_name_prefix=_PREFIX)


def _usable_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
