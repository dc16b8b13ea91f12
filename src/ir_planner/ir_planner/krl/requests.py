"""Costs of a KRL program in the cell, and the requests that users make about KRL."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_krl import Followed, KrlError, Note
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_planner.certificates import in_scene
from ir_planner.checks import Evaluation, evaluate_trajectory, total_report
from ir_planner.curves import turn_of
from ir_planner.errors import RequestError
from ir_planner.krl.execution import DrivenStep, drive
from ir_planner.krl.export import KrlExport, export, judge_of
from ir_planner.planner import Planner
from ir_planner.program import Charge
from ir_planner.request import POSTURES, safety_distance
from ir_planner.scene import PlanningScene

# Which station or posture a configuration stands at.

PLACE_TOLERANCE = 2e-3  # m: taught points differ from a station's pose by about this
TURN_TOLERANCE = np.radians(0.5)
AXIS_TOLERANCE = np.radians(0.2)


def station_at(scene: PlanningScene, q: FloatArray) -> str:
    """Name of the station whose pose the tcp has at q (n,), else ""."""
    tcp = scene.chain.tcp_poses(q[None])[0]
    for station in scene.cell.stations:
        away = float(portable.norm(station.pose[:3, 3] - tcp[:3, 3]))
        turned = turn_of(portable.matmul(station.pose[:3, :3].T, tcp[:3, :3]))
        if away <= PLACE_TOLERANCE and turned <= TURN_TOLERANCE:
            return station.name
    return ""


def posture_at(scene: PlanningScene, q: FloatArray) -> str:
    """Name of the posture that q (n,) is, else ""."""
    for name in POSTURES:
        if np.abs(q - scene.cell.posture(name)).max() <= AXIS_TOLERANCE:
            return name
    return ""


# What a driven program costs in the cell: seconds, joules and clearance of every step, and its
# stations.


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


# What users ask: what a KRL program costs in the planner's cell, and a planned one as KRL.

ASYNCHRONOUS = "asynchronous"


def evaluate_krl(
    planner: Planner, program: Followed, margin: float = 0.02, load: str = ""
) -> EvaluatedProgram:
    """A program as a KR C4 drives it from machine home, S_m `margin` [m], with `load` attached all
    along.

    Raises RequestError, KrlMotionError.
    """
    safety_distance(margin)
    scene = planner.scene(load)
    found = evaluate_program(program, scene, planner.cell.machine_home, margin)
    certify = in_scene(scene)

    def named(step: EvaluatedStep) -> EvaluatedStep:
        report = certify(step.found.report, step.step.trajectory)
        return replace(step, found=replace(step.found, report=report))

    return replace(found, steps=tuple(named(step) for step in found.steps))


def export_krl(
    planner: Planner,
    movements: Sequence[PlannedMovement],
    name: str,
    options: PlanOptions | None = None,
) -> KrlExport:
    """Planned movements as a KRL program, read back, driven by the controller's model and certified
    again.

    options: those that were planned with. Raises RequestError where that can't be.
    """
    chosen = options or PlanOptions()
    if chosen.timing == ASYNCHRONOUS:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            "timing is asynchronous: a controller's motions end all axes together, plan with "
            "synchronous",
        )
    scene = planner.scene("")
    judge = judge_of(
        movements, planner.cell, scene.power, planner.settings.drives, chosen.safety_distance
    )
    try:
        return export(movements, name, scene, judge, Charge(planner.settings.transitions))
    except KrlError as error:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, str(error)) from error


def one_movement(planner: Planner, trajectory_id: str) -> tuple[PlannedMovement, ...]:
    """A stored trajectory as a program of one movement. Raises RequestError for an unknown id."""
    trajectory = planner.trajectories.get(trajectory_id)
    report = planner.evaluate(trajectory, safety_distance=0.0).report
    movement = PlannedMovement(
        kind=MovementKind.REGIONAL,
        trajectory_id=trajectory_id,
        trajectory=trajectory,
        report=report,
        duration=trajectory.duration,
    )
    return (movement,)
