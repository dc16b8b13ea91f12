"""What one step costs at one size: processor seconds and memory, in a process of its own; and
exponents.
"""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

PAGE = resource.getpagesize()
QUIET_S = 0.02  # a faster step is repeated for this long, and the least time counts
WARM_S = 3.0  # a step that took longer the first time, with cold caches, is not repeated
ALLOWED_S = 600.0  # wall time of one measurement


@dataclass(frozen=True)
class Cost:
    """Processor seconds of one call, and memory [MB] that the process needed for it at most."""

    seconds: float
    megabytes: float


@dataclass(frozen=True)
class Prepared:
    """A call to measure at one size, counted on its axis."""

    size: float
    call: Callable[[], object]


def measured(prepare: Callable[[], Prepared]) -> tuple[float, Cost] | str:
    """Size and cost of what `prepare` returns, in a child of this process; a sentence where it
    failed.
    """
    here, there = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_child, args=(there, prepare))
    child.start()
    there.close()
    try:
        found: tuple[float, Cost] | str
        found = here.recv() if here.poll(ALLOWED_S) else f"not finished after {ALLOWED_S:g} s"
    except EOFError:
        found = f"ended with exit code {child.exitcode}"
    child.kill()
    child.join()
    return found


def _child(there: Connection, prepare: Callable[[], Prepared]) -> None:
    try:
        prepared = prepare()
        before = _resident()
        spent = _timed(prepared.call)
        if spent < WARM_S:  # again, now that caches are filled
            total = 0.0
            most = max(QUIET_S, 2.0 * spent)
            while total < most:
                spent = min(spent, again := _timed(prepared.call))
                total += again
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        there.send((prepared.size, Cost(spent, max(peak - before, 0) / 1e6)))
    except Exception as error:  # whatever a step raises at a size is that size's result
        there.send(f"{type(error).__name__}: {error}")


def _timed(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def _resident() -> int:
    """Bytes that this process holds now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Slope of log(value) over log(size), fitted over the upper half of the range; nan: too few
    sizes.
    """
    x = np.log(np.asarray(sizes))
    y = np.log(np.maximum(values, 1e-9))
    upper = x >= 0.5 * (x.min() + x.max()) - 1e-9 if len(x) else np.zeros(0, bool)
    if upper.sum() < 2:
        upper = np.argsort(np.argsort(x)) >= len(x) - 2
    if upper.sum() < 2 or np.ptp(x[upper]) == 0.0:
        return float("nan")
    return float(np.polyfit(x[upper], y[upper], 1)[0])
