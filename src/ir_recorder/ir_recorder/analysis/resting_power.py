"""Power at rest from a recording alone: its mean while mode and load stay, at machine home.

Each is held against the data of controller and tool; Table II of the paper stands beside it only
where the load is the paper's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, Load, PowerData, data_sheet_of
from ir_msgs_py.modes import REST_MODES, Mode
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_recorder.analysis.loads import LoadTimeline, carried
from ir_recorder.analysis.meter import Meter
from ir_recorder.analysis.predicted_power import MOTORS, Predictor, resting_watts
from ir_recorder.reading.recording import PowerSeries, Recording
from ir_values.arrays import BoolArray, FloatArray

AT_HOME = 0.005  # rad: gravity torque changes by less than 0.1 % within it
STILL = 0.002  # rad/s: less than the slowest planned motion, more than the noise of a held joint
_RESTING = [Mode[name].value for name in REST_MODES]
# s left out at both ends of a plateau: the reading that straddles a change, and the drives settling
SETTLING = 0.1
SHORTEST = 0.1  # s: ten readings, so that a mean has the meter's resolution
SAME_MASS = 0.5  # kg: masses in Table II are whole kilograms
SAME_WATTS = 0.5  # W: powers in Table II are whole watts
NAN = float("nan")


@dataclass(frozen=True)
class Plateau:
    """Power [W] in a mode with a load over `seconds` in total.

    payload [kg]: mass of the load. expected [W]: by the data of controller, tool and robot. table_2
    [W]: the paper's value, NaN where the load is another one. low, high [W]: the 90 % interval of
    what is expected, of a robot that holds itself: drives draw more than the data know. NaN: none.
    """

    mode: str
    load: str
    payload: float
    power: float
    expected: float
    table_2: float
    seconds: float
    low: float = NAN
    high: float = NAN

    @property
    def error(self) -> float:
        """Relative deviation from the data."""
        return self.power / self.expected - 1.0


def plateaus(
    recording: Recording, meter: Meter, timeline: LoadTimeline, cell: Cell, data: PowerData
) -> tuple[Plateau, ...]:
    """Each mode and load that the recording shows at rest, as the mean over all its stretches."""
    power = recording.power
    if power is None or recording.joints is None:
        return ()
    home = _at_home(recording, cell, power.time)
    seconds: dict[tuple[str, str], float] = {}
    joules: dict[tuple[str, str], float] = {}
    for start, end, load in timeline.certain(float(power.time[-1])):
        for first, last, mode in _stays(power, home, start, end):
            key = (Mode(mode).name, load)
            first = first + SETTLING
            last = last - SETTLING
            if last - first >= SHORTEST:
                seconds[key] = seconds.get(key, 0.0) + last - first
                joules[key] = joules.get(key, 0.0) + meter.energy(first, last)
    rows = [
        _plateau(mode, load, joules[mode, load] / time, time, cell, data)
        for (mode, load), time in seconds.items()
    ]
    return tuple(sorted(rows, key=lambda row: (-row.payload, REST_MODES.index(row.mode))))


def _plateau(
    mode: str, load: str, power: float, seconds: float, cell: Cell, data: PowerData
) -> Plateau:
    loads = carried(cell, load)
    known = load == NO_LOAD or len(loads) == len(load.split(LOAD_SEPARATOR))
    payload = float(sum(item.mass for item in loads)) if known else NAN
    expected = resting_watts(mode, cell.robot.machine_home, cell, loads, data) if known else NAN
    of_the_paper = (
        known and cell.robot.name == data.table_2_robot and _is_of_the_paper(loads, payload, data)
    )
    table_2 = data.measured(round(payload), mode) if of_the_paper else NAN
    modelled = known and mode == MOTORS and data.measured_rest(mode) is None
    low, high = _interval(expected, cell, loads, data) if modelled else (NAN, NAN)
    return Plateau(mode, load, payload, power, expected, table_2, seconds, low, high)


def _interval(
    expected: float, cell: Cell, loads: tuple[Load, ...], data: PowerData
) -> tuple[float, float]:
    """The 90 % interval of a power [W] on motors at machine home, by the marks of the data."""
    predictor = Predictor(cell.robot, data.dc_link, cell.base_pose, data_sheet_of(cell.robot, data))
    watts, low, high = predictor.standing(cell.robot.machine_home, loads)
    return expected + low - watts, expected + high - watts


def _is_of_the_paper(loads: tuple[Load, ...], payload: float, data: PowerData) -> bool:
    """Whether Table II was measured with this load: its mass, and the watts that its rows
    contain.
    """
    listed = {row.payload for row in data.table_2}
    if not any(abs(payload - mass) < SAME_MASS for mass in listed):
        return False
    always = sum(load.watts(drive_bus=False) for load in loads)
    awake = sum(load.watts(drive_bus=True) for load in loads)
    for mode, watts in (("HIBERNATION", always), ("STAND_ON_BRAKES", awake)):
        tool = data.measured(round(payload), mode) - data.mode(mode).controller_watts
        if abs(tool - watts) > SAME_WATTS:
            return False
    return True


def _stays(
    power: PowerSeries, home: BoolArray, start: float, end: float
) -> Iterator[tuple[float, float, int]]:
    """Stretches within [start, end] in which a resting mode stays, at machine home."""
    good = home & (power.mode == power.target_mode) & np.isin(power.mode, _RESTING)
    good &= (power.time >= start) & (power.time <= end)
    change = np.flatnonzero((np.diff(power.mode) != 0) | (np.diff(good.astype(int)) != 0)) + 1
    for first, last in zip([0, *change], [*change, len(good)], strict=True):
        if good[first] and last - first > 1:
            yield float(power.time[first]), float(power.time[last - 1]), int(power.mode[first])


def _at_home(recording: Recording, cell: Cell, times: FloatArray) -> BoolArray:
    """Whether the robot stood at machine home at `times` (N,); while nothing is published it stays
    where it was.
    """
    joints = recording.joints
    if joints is None or joints.position.shape[1] != cell.robot.n:
        return np.zeros(len(times), dtype=bool)
    nearest = np.clip(
        np.searchsorted(joints.time, times, side="right") - 1, 0, len(joints.time) - 1
    )
    near = np.abs(joints.position[nearest] - cell.robot.machine_home).max(axis=1) < AT_HOME
    still = np.nan_to_num(np.abs(joints.velocity[nearest])).max(axis=1) < STILL
    return np.asarray(near & still)
