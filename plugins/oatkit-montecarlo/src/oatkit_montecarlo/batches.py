"""Batches of photons on all cores, and what their spread says of the error."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

N_BATCHES = 20
"""Of one run. A standard error from 20 of them is itself uncertain by 1 / sqrt(38), 16 %."""


@dataclass(frozen=True)
class Estimate:
    """Mean over the batches, its standard error, and the sums of where the light went."""

    mean: np.ndarray
    standard_error: np.ndarray
    totals: np.ndarray


def thread_count() -> int:
    """Return ``OATKIT_THREADS`` where it is a number of at least 1, else the number of cores this process may use."""
    text = os.environ.get("OATKIT_THREADS", "").strip()
    if text.isascii() and text.isdigit() and int(text) >= 1:
        return int(text)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def sizes(n_photons: int) -> list[int]:
    """Return the number of photons of each batch; they differ by one at most."""
    return [n_photons // N_BATCHES + (index < n_photons % N_BATCHES) for index in range(N_BATCHES)]


def estimate(run: Callable[[int, int], tuple[np.ndarray, np.ndarray]], counts: Sequence[int]) -> Estimate:
    """Run batches of these counts and average them, weighted by their counts.

    ``run(first, count)`` returns the mean per photon and the totals of photons number `first` and on. Sums are taken
    in the order of the batches, so that the number of threads does not show in the last digit.
    """
    firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    jobs = list(zip(firsts.tolist(), counts, strict=True))
    mean, spread, totals = np.zeros((3, 1))
    seen = 0
    threads = min(thread_count(), len(jobs))
    with ThreadPoolExecutor(threads, thread_name_prefix="oatkit-montecarlo") as pool:
        # In rounds of one batch a thread, so that no more images than threads are held.
        for start in range(0, len(jobs), threads):
            ready = jobs[start : start + threads]
            for (_, count), (found, where) in zip(ready, pool.map(lambda job: run(*job), ready), strict=True):
                seen += count
                step = found - mean
                mean = mean + step * (count / seen)
                spread = spread + count * step * (found - mean)
                totals = totals + where
    return Estimate(mean, np.sqrt(spread / (sum(counts) * (len(counts) - 1))), totals)
