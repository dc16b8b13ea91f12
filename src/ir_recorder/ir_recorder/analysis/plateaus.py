"""Table II from a recording alone: mean power while mode and load stay, at machine home."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, PowerData
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.modes import REST_MODES, Mode
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_recorder.analysis.loads import LoadTimeline
from ir_recorder.analysis.meter import Meter
from ir_recorder.read.recording import PowerSeries, Recording

AT_HOME = 0.005  # rad: gravity torque changes by less than 0.1 % within it
STILL = 0.002  # rad/s: less than the slowest planned motion, more than the noise of a held joint
_RESTING = [Mode[name].value for name in REST_MODES]
# s left out at both ends of a plateau: the reading that straddles a change, and the drives settling
SETTLING = 0.1
SHORTEST = 0.1  # s: ten readings, so that a mean has the meter's resolution
SAME_MASS = 0.5  # kg: masses in Table II are whole kilograms


@dataclass(frozen=True)
class Plateau:
    """Power [W] in a mode with a payload [kg] of Table II, over `seconds` in total, and the value of
    the table.
    """

    mode: str
    payload: float
    power: float
    expected: float
    seconds: float

    @property
    def error(self) -> float:
        """Relative deviation from the table."""
        return self.power / self.expected - 1.0


def table_2_plateaus(
    recording: Recording, meter: Meter, loads: LoadTimeline, cell: Cell, data: PowerData
) -> tuple[Plateau, ...]:
    """The rows of Table II that the recording shows, each the mean over all its plateaus."""
    power = recording.power
    if power is None or recording.joints is None:
        return ()
    home = _at_home(recording, cell, power.time)
    seconds: dict[tuple[str, float], float] = {}
    joules: dict[tuple[str, float], float] = {}
    for start, end, load in loads.certain(float(power.time[-1])):
        payload = _payload(cell, load)
        for first, last, mode in _stays(power, home, start, end):
            key = (Mode(mode).name, payload)
            first, last = first + SETTLING, last - SETTLING
            if last - first >= SHORTEST:
                seconds[key] = seconds.get(key, 0.0) + last - first
                joules[key] = joules.get(key, 0.0) + meter.energy(first, last)
    rows = []
    for row in data.table_2:
        for key, time in seconds.items():
            if key[0] == row.mode and abs(key[1] - row.payload) < SAME_MASS:
                rows.append(Plateau(row.mode, row.payload, joules[key] / time, row.watts, time))
    return tuple(rows)


def _stays(
    power: PowerSeries, home: np.ndarray, start: float, end: float
) -> Iterator[tuple[float, float, int]]:
    """Stretches within [start, end] in which a resting mode stays, at machine home."""
    good = home & (power.mode == power.target_mode) & np.isin(power.mode, _RESTING)
    good &= (power.time >= start) & (power.time <= end)
    change = np.flatnonzero((np.diff(power.mode) != 0) | (np.diff(good.astype(int)) != 0)) + 1
    for first, last in zip([0, *change], [*change, len(good)], strict=True):
        if good[first] and last - first > 1:
            yield float(power.time[first]), float(power.time[last - 1]), int(power.mode[first])


def _at_home(recording: Recording, cell: Cell, times: FloatArray) -> BoolArray:
    """Whether the robot stood at machine home at `times` (N,); while nothing is published it stays where it
    was.
    """
    joints = recording.joints
    if joints is None or joints.position.shape[1] != cell.robot.n:
        return np.zeros(len(times), dtype=bool)
    nearest = np.clip(np.searchsorted(joints.time, times, side="right") - 1, 0, len(joints.time) - 1)
    near = np.abs(joints.position[nearest] - cell.robot.machine_home).max(axis=1) < AT_HOME
    still = np.nan_to_num(np.abs(joints.velocity[nearest])).max(axis=1) < STILL
    return np.asarray(near & still)


def _payload(cell: Cell, load: str) -> float:
    """Mass [kg] of a load text; NaN where a name isn't the cell's."""
    masses = {part.name: part.load.mass for part in cell.parts}
    if cell.tool is not None:
        masses[cell.tool.name] = cell.tool.mass
    names = [name for name in load.split(LOAD_SEPARATOR) if name != NO_LOAD]
    return float(sum(masses.get(name, float("nan")) for name in names))
