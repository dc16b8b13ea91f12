"""What an analysis finds, as values."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.savings import ProgramSavings
from ir_recorder.analysis.clearance import StepClearance
from ir_recorder.analysis.grid import GridCheck
from ir_recorder.analysis.loads import LoadTimeline
from ir_recorder.analysis.plateaus import Plateau
from ir_recorder.analysis.steps import ExecutedStep
from ir_recorder.read.recording import Recording

NAN = float("nan")


@dataclass(frozen=True, eq=False)
class StepResult:
    """A step with what it took, measured at the mains meter.

    energy, base_energy, dissipated_energy, rectifier_energy [J]; straddling_energy [J]: by which
    energy may be wrong, as readings at its ends belong to other steps as well; joint_energy (n,)
    [J] at the DC bus; peak_power [W];
    indirect_energy [J]: from recorded positions alone; torque_energy [J]: from recorded speed and
    torque; second_opinion [J]: from positions with torques by Pinocchio, where it is installed;
    stored_energy [J]: in the capacitors at the
    start; lost_charge [J]: that the plan counted on in them, and that had gone as the step began
    late; motors_power [W]: at rest with motors on, by the data; tool_deviation [m]: largest between
    commanded and simulated tcp. NaN where it wasn't recorded. clearance is None for pauses.
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
class Unshortened:
    """The cycle with its pauses in power modes at full length: seconds [s] and energy [J],
    computed.

    NaN where the pauses of the run don't match. run_pauses, full_pauses [s]: their sums.
    """

    seconds: float
    energy: float
    run_pauses: float
    full_pauses: float


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

    @property
    def savings(self) -> ProgramSavings | None:
        """What the executed program saves by its plan: the last that was recorded before its first
        step; None where there is none.
        """
        begin = self.steps[0].step.start if self.steps else math.inf
        known = [event.savings for event in self.recording.savings if event.time <= begin]
        return known[-1] if known and known[-1].available else None

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
