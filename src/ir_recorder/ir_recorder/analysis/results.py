"""Results of an analysis, as values."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ir_description import Cell
from ir_msgs_py.modes import Mode
from ir_msgs_py.names import JOINT_NAMES, axis_labels
from ir_msgs_py.report import MovementKind
from ir_msgs_py.savings import ProgramSavings
from ir_recorder.analysis.clearance import StepClearance
from ir_recorder.analysis.loads import LoadTimeline
from ir_recorder.analysis.resting_power import Plateau
from ir_recorder.analysis.steps import ExecutedStep
from ir_recorder.analysis.tending import Tending
from ir_recorder.format import contents
from ir_recorder.reading.recording import JointSeries, PowerSeries, Recording
from ir_values.arrays import FloatArray

# Whether /joint_states lies on a grid without gaps. While the controller hibernates there are none
# to come.

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


def check_grid(joints: JointSeries, power: PowerSeries | None) -> GridCheck:
    """Checks the stamps of /joint_states."""
    steps = np.diff(joints.stamp_ns)
    gaps = []
    excused = 0
    origin = int(joints.stamp_ns[0]) if len(joints.stamp_ns) else 0
    off_grid = 0
    part_start = 0
    for k in [*np.flatnonzero(steps > PERIOD_NS).tolist(), len(steps)]:
        stretch = joints.stamp_ns[part_start : k + 1]
        off_grid += int(np.count_nonzero((stretch - origin) % PERIOD_NS))
        if k == len(steps):
            break
        part_start = k + 1
        if power is not None and _is_asleep(power, joints.time[k], joints.time[k + 1]):
            excused += 1
            origin = int(joints.stamp_ns[k + 1])
        else:
            gaps.append((float(joints.time[k]), float(steps[k] * 1e-9)))
    return GridCheck(
        len(joints.stamp_ns), off_grid, int(np.count_nonzero(steps <= 0)), tuple(gaps), excused
    )


def _is_asleep(power: PowerSeries, start: float, end: float) -> bool:
    inside = (power.time >= start) & (power.time <= end)
    return bool(np.isin(power.mode[inside], [int(mode) for mode in _ASLEEP]).any())


# What an analysis finds, as values.

NAN = float("nan")


@dataclass(frozen=True, eq=False)
class StepResult:
    """A step with what it took, measured at the mains meter.

    energy, base_energy, dissipated_energy, rectifier_energy [J]; straddling_energy [J]: by which
    energy may be wrong, as readings at its ends belong to other steps as well; joint_energy (n,)
    [J] at the DC link; peak_power [W];
    indirect_energy [J]: from recorded positions alone; torque_energy [J]: from recorded speed and
    torque; second_opinion [J]: from positions with torques by Pinocchio, where it is installed;
    stored_energy [J]: in the capacitors at the start; lost_charge [J]: that the plan counted on in
    them, and that had gone as the step began late; slip [s]: by which the plant's time slipped
    against the recorder's clock; motors_power [W]: at rest with motors on, by the data;
    tool_deviation [m]: largest between commanded and simulated tcp. NaN where it wasn't recorded.
    clearance is None for pauses.
    """

    step: ExecutedStep
    energy: float
    straddling_energy: float
    joint_energy: FloatArray
    base_energy: float
    dissipated_energy: float
    rectifier_energy: float
    peak_power: float
    indirect_energy: float
    torque_energy: float
    second_opinion: float
    stored_energy: float
    motors_power: float
    tool_deviation: float
    clearance: StepClearance | None
    lost_charge: float = 0.0
    slip: float = 0.0

    @property
    def seconds(self) -> float:
        """How long it took [s]."""
        return self.step.seconds

    @property
    def mean_power(self) -> float:
        """Mean W at the mains."""
        return self.energy / self.seconds if self.seconds > 0.0 else float("nan")


@dataclass(frozen=True)
class Share:
    """Time [s] and energy [J] of one mode, or of one kind of work at a station."""

    name: str
    seconds: float
    energy: float


@dataclass(frozen=True)
class StationUse:
    """Time [s] and energy [J] that belong to a station: pauses, service movements, and the
    movements to it.
    """

    station: str
    rest: Share
    service: Share
    travel: Share

    @property
    def seconds(self) -> float:
        """All time of the station [s]."""
        return self.rest.seconds + self.service.seconds + self.travel.seconds

    @property
    def energy(self) -> float:
        """All energy of the station [J]."""
        return self.rest.energy + self.service.energy + self.travel.energy


@dataclass(frozen=True)
class FullPause:
    """What the full length of a shortened pause adds to the run, computed.

    step: its place among the results; mode: where the time is spent. seconds [s], energy [J]:
    beyond what was measured; planned_seconds, predicted_energy: beyond what was planned;
    common_energy [J]: the same for the common program, whose controller closes the brakes by its
    own timer. saved_added (N,) J: what drawn robots add to what is saved in the whole pause at its
    full length.
    """

    step: int
    mode: str
    seconds: float
    planned_seconds: float
    energy: float
    predicted_energy: float
    common_energy: float
    saved_added: FloatArray = field(compare=False)


@dataclass(frozen=True)
class Unshortened:
    """The cycle with its pauses in power modes at full length: seconds [s] and energy [J],
    computed.

    NaN where the pauses of the run don't match. run_pauses, full_pauses [s]: their sums; added: by
    pause.
    """

    seconds: float
    energy: float
    run_pauses: float
    full_pauses: float
    added: tuple[FullPause, ...] = ()


@dataclass(frozen=True)
class ProgramTotals:
    """Seconds and joules of the whole program, of its movements and of its pauses, measured and
    planned.

    unshortened: the cycle as it is in production, None where the run's pauses are not shortened.
    """

    whole: Share
    movements: Share
    pauses: Share
    planned_movements: Share
    planned_pauses: Share
    unshortened: Unshortened | None

    @property
    def waiting(self) -> Share:
        """Between the steps: signals of machines and answers of nodes, which no plan contains."""
        steps = (self.movements, self.pauses)
        return Share(
            "waiting between steps",
            self.whole.seconds - sum(share.seconds for share in steps),
            self.whole.energy - sum(share.energy for share in steps),
        )


def _number(fact: str, unit: str) -> float:
    """The number of a fact with its unit; 0 where it says none."""
    found = re.fullmatch(rf"(\d+\.\d+) {unit}", fact)
    return float(found[1]) if found else 0.0


@dataclass(frozen=True, eq=False)
class Analysis:
    """All results; parts whose topics are missing are empty or NaN, `problems` names which and why.

    seconds, energy [J], mean_power, peak_power [W]: of the whole recording, at the mains meter.
    safety_distance [m]: S_m that the movements were planned with, NaN where the recording carries
    none.
    """

    recording: Recording
    cell: Cell | None
    loads: LoadTimeline
    seconds: float
    energy: float
    mean_power: float
    peak_power: float
    steps: tuple[StepResult, ...]
    program: ProgramTotals | None
    safety_distance: float
    stations: tuple[StationUse, ...]
    modes: tuple[Share, ...]
    grid: GridCheck | None
    plateaus: tuple[Plateau, ...]
    problems: tuple[str, ...]
    tending: Tending | None = None

    @property
    def savings(self) -> ProgramSavings | None:
        """What the executed program saves by its plan: the last that was recorded before its first
        step; None where there is none.
        """
        begin = self.steps[0].step.start if self.steps else math.inf
        known = [event.savings for event in self.recording.savings if event.time <= begin]
        if not known or not known[-1].available:
            return None
        return replace(
            known[-1],
            common_seconds=_number(self.recording.fact(contents.COMMON_SECONDS), "s"),
            common_demand=_number(self.recording.fact(contents.COMMON_DEMAND), "W"),
        )

    @property
    def axes(self) -> tuple[str, ...]:
        """Labels of the robot's axes: of the recorded joints, else of the cell's."""
        if self.recording.joints is not None:
            return self.recording.joints.axes
        return axis_labels(JOINT_NAMES if self.cell is None else self.cell.robot.joint_names)

    @property
    def movements(self) -> tuple[StepResult, ...]:
        """The steps in which the robot moved."""
        return tuple(result for result in self.steps if not result.step.movement.is_pause)

    @property
    def elsewhere(self) -> Share:
        """Time and energy outside of the program's steps: before, between and after them."""
        return Share(
            "outside of the program's steps",
            self.seconds - sum(result.seconds for result in self.steps),
            self.energy - sum(result.energy for result in self.steps),
        )


# Time and energy by mode of the controller and by station of the program.


def mode_name(number: int) -> str:
    """The name of a mode's number."""
    try:
        return Mode(number).name
    except ValueError:
        return f"mode {number}"


def mode_shares(power: PowerSeries) -> tuple[Share, ...]:
    """Seconds and joules of each mode; a reading belongs to the mode it reports."""
    seconds = np.diff(power.time, prepend=power.time[:1])
    joules = np.diff(power.energy, prepend=power.energy[:1])
    shares = []
    for number in np.unique(power.mode):
        own = power.mode == number
        shares.append(
            Share(mode_name(int(number)), float(seconds[own].sum()), float(joules[own].sum()))
        )
    return tuple(shares)


def station_uses(results: Sequence[StepResult]) -> tuple[StationUse, ...]:
    """Every step belongs to one stop: service movements, paths and pauses to theirs, a regional
    movement to the one where it ends.
    """
    kinds: dict[str, dict[str, list[StepResult]]] = {}
    for result in results:
        movement = result.step.movement
        if movement.is_pause:
            kind = "rest"
            station = movement.to_station or movement.from_station
        elif movement.kind == MovementKind.SERVICE_EXIT:
            kind = "service"
            station = movement.from_station
        elif movement.kind in (MovementKind.SERVICE_ENTRY, MovementKind.CARTESIAN):
            kind = "service"
            station = movement.to_station
        else:
            kind = "travel"
            station = movement.to_station
        kinds.setdefault(station or "elsewhere", {}).setdefault(kind, []).append(result)
    return tuple(
        StationUse(
            station, *(_share(kind, own.get(kind, [])) for kind in ("rest", "service", "travel"))
        )
        for station, own in kinds.items()
    )


def _share(kind: str, results: Sequence[StepResult]) -> Share:
    return Share(
        kind, sum(result.seconds for result in results), sum(result.energy for result in results)
    )
