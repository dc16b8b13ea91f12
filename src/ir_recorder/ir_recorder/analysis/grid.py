"""Whether /joint_states lies on a grid without gaps. While the controller hibernates there are none
to come.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.modes import Mode
from ir_recorder.read.recording import JointSeries, PowerSeries

PERIOD_NS = 2_000_000  # /joint_states come at 500 Hz by contract
_ASLEEP = (Mode.TO_HIBERNATION, Mode.HIBERNATION, Mode.FROM_HIBERNATION)


@dataclass(frozen=True)
class GridCheck:
    """Stamps against a grid: how many there are, off the grid, going back; gaps as (time [s],
    length [s]).

    excused: gaps in which the controller hibernated. Each gap-free stretch has a grid of its own
    after such a pause.
    """

    count: int
    off_grid: int
    backward: int
    gaps: tuple[tuple[float, float], ...]
    excused: int

    @property
    def clean(self) -> bool:
        """No gap, nothing off the grid or going back."""
        return self.count > 0 and not (self.off_grid or self.backward or self.gaps)


def check_grid(
    joints: JointSeries, power: PowerSeries | None, period_ns: int = PERIOD_NS
) -> GridCheck:
    """Checks the stamps of /joint_states."""
    steps = np.diff(joints.stamp_ns)
    gaps = []
    excused = 0
    origin = int(joints.stamp_ns[0]) if len(joints.stamp_ns) else 0
    off_grid = 0
    part_start = 0
    for k in [*np.flatnonzero(steps > period_ns).tolist(), len(steps)]:
        stretch = joints.stamp_ns[part_start : k + 1]
        off_grid += int(np.count_nonzero((stretch - origin) % period_ns))
        if k == len(steps):
            break
        part_start = k + 1
        if power is not None and _asleep(power, joints.time[k], joints.time[k + 1]):
            excused += 1
            origin = int(joints.stamp_ns[k + 1])
        else:
            gaps.append((float(joints.time[k]), float(steps[k] * 1e-9)))
    return GridCheck(
        len(joints.stamp_ns), off_grid, int(np.count_nonzero(steps <= 0)), tuple(gaps), excused
    )


def _asleep(power: PowerSeries, start: float, end: float) -> bool:
    inside = (power.time >= start) & (power.time <= end)
    return bool(np.isin(power.mode[inside], [int(mode) for mode in _ASLEEP]).any())
