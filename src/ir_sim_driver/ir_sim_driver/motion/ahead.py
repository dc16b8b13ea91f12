"""Commands of the steps ahead: while path time passes evenly, many cost what one does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.motion.path import Path

_STEPS = 64
"""At once: the array functions' own time is spread over them, and few are dropped when the speed
changes.
"""


def ahead(path: Path, s: float, step: float) -> Iterator[tuple[float, FloatArray]]:
    """Path times [s] and commands (n,) after one, two, ... steps of path time from s < duration on.

    Path times are summed as one step after another would; the last pair, if it is reached, is the
    end.
    """
    times = np.add.accumulate(np.concatenate(([s], np.full(_STEPS, step))))[1:]
    within = times[times < path.duration]
    commands = path.positions(within)
    commands.setflags(write=False)  # they are handed out
    yield from zip(within.tolist(), commands, strict=True)
    if len(within) < _STEPS:
        yield path.duration, path.end
