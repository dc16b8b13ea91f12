"""A recording as typed values on one time axis. Times are seconds since the first message."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ir_msgs_py.names import axis_labels
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.search_log import SearchLog
from ir_recorder.format import contents
from ir_values.arrays import FloatArray, IntArray


class _ReadOnlyArrays:
    """Makes the arrays of a frozen dataclass read-only."""

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


@dataclass(frozen=True)
class TopicSummary:
    """A topic of the file: its type, how many messages, and how it is encoded."""

    name: str
    type: str
    count: int
    encoding: str


@dataclass(frozen=True, eq=False)
class JointSeries(_ReadOnlyArrays):
    """/joint_states: stamp_ns (N,), time (N,) s, position (N, n) rad, velocity (N, n) rad/s, effort
    (N, n) Nm; of an external axis in m, m/s, N.
    """

    names: tuple[str, ...]
    stamp_ns: IntArray
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray

    @property
    def axes(self) -> tuple[str, ...]:
        """What people call the joints' axes."""
        return axis_labels(self.names)


@dataclass(frozen=True, eq=False)
class PowerSeries(_ReadOnlyArrays):
    """The mains meter, N readings: mode and target numbers of ir_msgs/PowerMode; power, base_power,
    burnt_power (N,) W; energy (N,) J since the meter's start; bus_voltage (N,) V; joint_power (N,
    n) W at the DC link, joint_torque (N, n) Nm; tool_power (N,) W, part of base_power;
    rectifier_loss (N,) W; joint_temperature (N, n) deg C. What the plant doesn't have is NaN.

    A power is the mean since the reading before. heard (N,) [s]: when the recorder had each
    reading, which is later than its time by what the plant lagged. plant: what the meter measures,
    "" where it has no name.
    """

    time: FloatArray
    mode: IntArray
    target_mode: IntArray
    power: FloatArray
    energy: FloatArray
    base_power: FloatArray
    bus_voltage: FloatArray
    burnt_power: FloatArray
    joint_power: FloatArray
    joint_torque: FloatArray
    tool_power: FloatArray
    rectifier_loss: FloatArray
    joint_temperature: FloatArray
    heard: FloatArray
    plant: str = ""


@dataclass(frozen=True, eq=False)
class ControllerSeries(_ReadOnlyArrays):
    """The trajectory executor, N states: trajectory_id ("" while holding), path_time (N,) s along
    the trajectory, speed_scaling (N,), tool_deviation (N,) m between commanded and simulated tcp,
    joint_error (N, n) rad between commanded and simulated joints.
    """

    time: FloatArray
    trajectory_id: tuple[str, ...]
    path_time: FloatArray
    speed_scaling: FloatArray
    tool_deviation: FloatArray
    joint_error: FloatArray


@dataclass(frozen=True, eq=False)
class BitSeries(_ReadOnlyArrays):
    """Levels by name: names (B,), levels (N, B)."""

    time: FloatArray
    names: tuple[str, ...]
    levels: IntArray


@dataclass(frozen=True, eq=False)
class ProgramEvent:
    """A movement or pause started, ended, failed or was cancelled."""

    time: float
    program_id: str
    index: int
    total: int
    event: str
    movement: PlannedMovement
    note: str


@dataclass(frozen=True)
class SavingsEvent:
    """What a program that was planned then saves."""

    time: float
    savings: ProgramSavings


@dataclass(frozen=True)
class TextEvent:
    """A text with its time: an attached load, the level of a signal, a warning of a log."""

    time: float
    name: str
    text: str


@dataclass(frozen=True)
class GoalEnd:
    """The last state of a goal: its action ("plan"), the number of action_msgs/GoalStatus, and in
    words.
    """

    action: str
    status: int
    outcome: str


@dataclass(frozen=True, eq=False)
class Recording:
    """All that could be read; a series is None where its topic is missing, `problems` names what is
    wrong.

    start_ns: node clock of time 0. hardware: the driver's name of its plant ("..., simulated").
    cell_yaml and urdf are "" where none is attached, so are power_yaml (data of the controller) and
    plant_yaml (the simulated plant with its figures). facts: texts by key. planned: steps of the
    last planned program, where nothing was driven; planned_interval [J]: of its energy, 90 %, None
    where its answer has none; planned_certified: whether its answer is proved. machines: their
    states by name, "closed>open" while they change; contacts: what the robot touched, by body.
    savings: of the driven programs, or of the last planned one, where their plans are in it.
    searches: what the searches of the driven programs did, or of the last planned one where none
    was driven, where they keep a log.
    """

    path: Path
    start_ns: int
    duration: float
    topics: tuple[TopicSummary, ...]
    joints: JointSeries | None
    power: PowerSeries | None
    controller: ControllerSeries | None
    plc_inputs: BitSeries | None
    plc_outputs: BitSeries | None
    events: tuple[ProgramEvent, ...]
    loads: tuple[TextEvent, ...]
    signals: tuple[TextEvent, ...]
    warnings: tuple[TextEvent, ...]
    goals: tuple[GoalEnd, ...]
    savings: tuple[SavingsEvent, ...]
    hardware: str
    cell_yaml: str
    urdf: str
    facts: tuple[tuple[str, str], ...]
    problems: tuple[str, ...]
    power_yaml: str = ""
    plant_yaml: str = ""
    planned: tuple[PlannedMovement, ...] = ()
    planned_interval: tuple[float, float] | None = None
    planned_certified: bool = False
    machines: tuple[TextEvent, ...] = ()
    contacts: tuple[TextEvent, ...] = ()
    searches: tuple[SearchLog, ...] = ()

    @property
    def only_planned(self) -> bool:
        """Whether it holds a plan that was not driven, and no robot."""
        return bool(self.planned)

    @property
    def never_driven(self) -> bool:
        """Whether it was written for a plan, found or not, without a robot."""
        return bool(self.fact(contents.PLAN))

    @property
    def origin(self) -> str:
        """The word for its watts: "simulated", "measured", "recorded" where the plant is not
        named.
        """
        if not self.hardware:
            return "recorded"
        return "simulated" if "simulated" in self.hardware else "measured"

    @property
    def plant(self) -> str:
        """Name of the simulated plant, "" where none is recorded."""
        return "" if self.power is None else self.power.plant

    def fact(self, key: str) -> str:
        """A fact of the file, "" where it is missing."""
        return next((value for name, value in reversed(self.facts) if name == key), "")
