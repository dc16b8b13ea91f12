"""Costs of a KRL program in the cell, and the requests that users make about KRL."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_krl import Followed, KrlError, KrlMotionError, SourcePlace, follow, parse
from ir_krl.language import SourceFile
from ir_krl.run import Note, SignalRange
from ir_krl.urscript import follow_urscript
from ir_krl.write import PLC_DONE, PLC_PAUSE, FrameNumbers, PlcPause, frame_numbers
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE, PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_planner.checks import Evaluation, evaluate_trajectory, total_report
from ir_planner.curves import turn_of
from ir_planner.errors import RequestError
from ir_planner.krl.execution import DrivenStep, Switched, drive
from ir_planner.krl.export import KrlExport, export
from ir_planner.krl.geometry import Arm, tool_in_flange
from ir_planner.krl.makes import joint_limits
from ir_planner.krl.step_evaluation import evaluator_of
from ir_planner.krl.surroundings import Surroundings, wires_of
from ir_planner.planner import Planner
from ir_planner.program import Charge, PlannedPause, Scenes, spent
from ir_planner.request import POSTURES, check_safety_distance
from ir_planner.scene import PlanningScene, load_text
from ir_planner.timing import standing
from ir_planner.validity import in_scene
from ir_values.arrays import FloatArray

# What a driven program costs in the cell: seconds, joules and clearance of every step, and its
# stations. Movements take what the capacitor holds, pauses are spent in the modes that a PLC asks
# for, and by the controller itself where none does: as planned steps are.


@dataclass(frozen=True, eq=False)
class EvaluatedStep:
    """A step, where it begins and ends (stations, postures, "" elsewhere), what is known about it,
    and in which power mode a standstill is spent, "" as the controller does by itself.
    """

    step: DrivenStep
    from_station: str
    to_station: str
    found: Evaluation
    power_mode: str = ""

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
    def moves(self) -> bool:
        """Whether it has a movement: the first only says where it starts."""
        return any(step.step.moves for step in self.steps)

    @property
    def certified(self) -> bool:
        """Whether every movement is."""
        return all(step.found.verification.certified for step in self.steps if step.step.moves)


@dataclass
class _PlcPauses:
    """Which pause of the PLC's table a wait is: by the number that the program's outputs hold."""

    table: Mapping[int, PlcPause]
    asked: SignalRange | None
    _number: int = 0

    def heard(self, outputs: Sequence[Switched]) -> None:
        """The program has set outputs."""
        for number, value, _ in outputs:
            if self.asked is not None and number in self.asked.numbers:
                bit = 1 << (number - self.asked.first)
                self._number = self._number | bit if value else self._number & ~bit

    def pause(self, step: DrivenStep) -> PlcPause | None:
        """The pause that a step is. Raises KrlMotionError for one that the table hasn't."""
        if step.moves or step.waits_for != PLC_DONE or not self._number:
            return None
        if self._number not in self.table:
            known = ", ".join(map(str, self.table)) or "none"
            raise KrlMotionError(
                f"pause {self._number} of the PLC isn't in its table, which has {known}",
                step.places[0],
            )
        return self.table[self._number]


def evaluate_program(
    program: Followed,
    around: Surroundings,
    start: FloatArray,
    margin: float,
    times: TransitionTimes,
    plc: Mapping[int, PlcPause] | None = None,
) -> EvaluatedProgram:
    """The program driven from `start` (n,), evaluated with S_m `margin` [m]. Raises KrlMotionError.

    A movement may touch what the stations where it begins and ends allow, each in its own zone.
    """
    driven, notes = drive(program, around, start)
    pauses = _PlcPauses(plc or {}, program.signals.get(PLC_PAUSE))
    charge = Charge(times)
    steps = []
    for step in driven:
        pause = pauses.pause(step)
        if pause is not None:
            names = step.scene.cell.robot.joint_names
            still = standing(step.trajectory.positions[0], names, pause.seconds)
            step = replace(step, trajectory=still)
        mode = "" if pause is None else pause.power_mode
        steps.append(_evaluated(step, mode, margin, times, charge))
        pauses.heard(step.outputs)
    if pauses.asked is not None and not plc:
        sentence = (
            "pauses that the PLC spends in power modes are costed as the controller spends them by "
            "itself: without the PLC's table"
        )
        notes = (Note(SourcePlace(program.name), sentence), *notes)
    elapsed = np.cumsum([0.0, *(step.report.duration for step in steps)])[:-1]
    report = total_report(tuple(step.report for step in steps), tuple(elapsed.tolist()))
    stations = tuple(step.to_station for step in steps if step.step.moves and step.to_station)
    return EvaluatedProgram(program.name, tuple(steps), report, stations, notes)


def _evaluated(
    step: DrivenStep, mode: str, margin: float, times: TransitionTimes, charge: Charge
) -> EvaluatedStep:
    scene = step.scene
    ends = [step.trajectory.positions[k] for k in (0, -1)]
    first, last = (station_at(scene, q) for q in ends)
    between = (station_at(scene, q) for q in step.between)
    stops = tuple(dict.fromkeys(name for name in between if name))
    found = evaluate_trajectory(step.trajectory, scene, margin, stops, step.at_rest)
    first = first or posture_at(scene, ends[0])
    last = last or posture_at(scene, ends[1])
    if step.moves:
        planned = PlannedMovement(
            kind=MovementKind.REGIONAL,
            from_station=first,
            to_station=last,
            trajectory=step.trajectory,
            report=found.report,
        )
        report = charge.moved(planned, found.energy, scene).report
    else:
        pause = PlannedPause(last, step.trajectory.duration, mode, ends[1], scene)
        paid = charge.stood(spent(pause, times), pause).report
        report = replace(
            found.report, energy=paid.energy, base_energy=paid.energy, peak_power=paid.peak_power
        )
    return EvaluatedStep(step, first, last, replace(found, report=report), mode)


# What users ask: what a KRL program costs in the planner's cell, and a planned one as KRL.

ASYNCHRONOUS = "asynchronous"


def follow_krl(
    planner: Planner,
    sources: Sequence[SourceFile],
    *,
    routine: str = "",
    inputs: Mapping[int, bool] | None = None,
    loop_passes: int = 1,
    settings: Sequence[SourceFile] = (),
) -> Followed:
    """A program followed as `ir_krl.follow` does, by the planner's robot: its home, its tool, where
    its motions lead. Raises KrlError with the place.
    """
    cell = planner.cell
    return follow(
        sources,
        cell.machine_home,
        tool_in_flange(cell.tcp),
        routine=routine,
        inputs=inputs,
        loop_passes=loop_passes,
        settings=settings,
        kinematics=Arm(planner.scene("")),
    )


def follow_ur(planner: Planner, text: str, file: str) -> Followed:
    """A URScript followed by the planner's robot. Raises KrlError with the place."""
    scene = planner.scene("")
    return follow_urscript(text, file, tool_in_flange(planner.cell.tcp), joint_limits(scene))


def evaluate_krl(
    planner: Planner,
    program: Followed,
    margin: float = DEFAULT_SAFETY_DISTANCE,
    load: str = "",
    plc: Mapping[int, PlcPause] | None = None,
) -> EvaluatedProgram:
    """A program as a KR C4 drives it from machine home, S_m `margin` [m], with `load` attached all
    along; "": the tool, with the parts that the gripper's output takes and leaves. plc: pauses that
    a PLC spends in power modes.

    Raises RequestError, KrlMotionError.
    """
    check_safety_distance(margin)
    asked = planner.scene(load)
    around = surroundings(planner, program, load)
    times = planner.heard.transitions
    found = evaluate_program(program, around, planner.cell.machine_home, margin, times, plc)

    def named(step: EvaluatedStep) -> EvaluatedStep:
        certify = in_scene(replace(step.step.scene, cell_hash=asked.cell_hash))
        report = certify(step.found.report, step.step.trajectory if step.step.moves else None)
        return replace(step, found=replace(step.found, report=report))

    return replace(found, steps=tuple(named(step) for step in found.steps))


def surroundings(planner: Planner, program: Followed, load: str = "") -> Surroundings:
    """What a program moves among in the planner's cell. Raises RequestError."""
    asked = planner.scene(load)
    cell = planner.cell
    scenes = Scenes(cell, asked.power, planner.settings.drives(cell.robot))
    doors = planner.heard.doors(cell)
    wires = wires_of(cell, program.signals)
    around = Surroundings(scenes, wires, station_at, cell.parts_at_start(), doors)
    if load or asked.load_text != load_text(cell):
        around.fixed = asked
    return around


def export_krl(
    planner: Planner,
    movements: Sequence[PlannedMovement],
    name: str,
    options: PlanOptions | None = None,
    style: str = "spline",
    numbers: FrameNumbers | None = None,
) -> KrlExport:
    """Planned movements as a KRL program, read back, driven by the controller's model and certified
    again.

    options: those that were planned with; style: "spline", which keeps the plan, or inline forms of
    "kss8" or "krc2", or "urscript"; numbers: of tools and bases in inline forms. Raises
    RequestError where that can't be.
    """
    chosen = options or PlanOptions()
    if chosen.timing == ASYNCHRONOUS:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            "timing is asynchronous: a controller's motions end all axes together, plan with "
            "synchronous",
        )
    scene = planner.scene("")
    evaluator = evaluator_of(
        movements, planner.cell, scene.power, scene.drives, chosen.safety_distance
    )
    try:
        return export(
            movements,
            name,
            scene,
            evaluator,
            planner.heard.transitions,
            style,
            lambda program: surroundings(planner, program),
            numbers,
        )
    except KrlError as error:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, str(error)) from error


def numbers_asked(tools: Sequence[str], bases: Sequence[str], plant: str) -> FrameNumbers:
    """Numbers of inline forms as `frame_numbers` takes them; plant: text of the plant's
    $config.dat, or "". Raises RequestError.
    """
    try:
        return frame_numbers(tools, bases, parse(plant, "$config.dat") if plant else None)
    except KrlError as error:
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, str(error)) from error


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
