"""What a driven program costs in the cell: seconds, joules and clearance of every step, and its
stations.
"""

from dataclasses import dataclass

import numpy as np

from ir_krl import Followed, Note
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import TrajectoryReport
from ir_planner.checks import Evaluation, evaluate_trajectory, total_report
from ir_planner.krl.driven import DrivenStep, drive
from ir_planner.krl.stations import posture_at, station_at
from ir_planner.scene import PlanningScene


@dataclass(frozen=True, eq=False)
class EvaluatedStep:
    """A step, where it begins and ends (stations, postures, "" elsewhere), and what is known about
    it.
    """

    step: DrivenStep
    from_station: str
    to_station: str
    found: Evaluation

    @property
    def report(self) -> TrajectoryReport:
        """Seconds, joules, clearance."""
        return self.found.report


@dataclass(frozen=True, eq=False)
class EvaluatedProgram:
    """All steps, the report of all together, the stations in the order of their visits, what was
    assumed.
    """

    name: str
    steps: tuple[EvaluatedStep, ...]
    report: TrajectoryReport
    stations: tuple[str, ...]
    notes: tuple[Note, ...]

    @property
    def certified(self) -> bool:
        """Whether every movement is."""
        return all(step.found.verification.certified for step in self.steps if step.step.moves)


def evaluate_program(
    program: Followed, scene: PlanningScene, start: FloatArray, margin: float
) -> EvaluatedProgram:
    """The program driven from `start` (n,) and judged with S_m `margin` [m]. Raises KrlMotionError.

    A movement may touch what its station allows: the one where it ends, else the one where it
    begins.
    """
    driven, notes = drive(program, scene, start)
    steps = []
    for step in driven:
        ends = [step.trajectory.positions[k] for k in (0, -1)]
        first, last = (station_at(scene, q) for q in ends)
        found = evaluate_trajectory(step.trajectory, scene, margin, last or first)
        first = first or posture_at(scene, ends[0])
        last = last or posture_at(scene, ends[1])
        steps.append(EvaluatedStep(step, first, last, found))
    elapsed = np.cumsum([0.0, *(step.report.duration for step in steps)])[:-1]
    report = total_report(tuple(step.report for step in steps), tuple(elapsed.tolist()))
    stations = tuple(step.to_station for step in steps if step.step.moves and step.to_station)
    return EvaluatedProgram(program.name, tuple(steps), report, stations, notes)
