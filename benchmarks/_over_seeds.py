"""The same for many seeds, on all cores."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

_work: Callable[[int], Any] | None = None  # what the processes inherit: it need not be pickled


def over_seeds(work: Callable[[int], Any], seeds: Sequence[int]) -> list[Any]:
    """Results in the order of the seeds; a process for each core, forked with all that is planned
    by then.

    Raises BrokenProcessPool where one of them is killed, as for want of memory.
    """
    global _work
    _work = work
    fork = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(
        os.cpu_count(), mp_context=fork
    ) as pool:  # waits: their processor time counts
        return list(pool.map(_one, seeds))


def _one(seed: int) -> Any:
    assert _work is not None  # set before the fork
    return _work(seed)


def processor_time() -> float:
    """Seconds of processor of this process and of its children that have ended."""
    return sum(os.times()[:4])
