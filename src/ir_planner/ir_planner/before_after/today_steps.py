"""Today's program as steps: its request, the doors at its start, what it costs."""

from dataclasses import dataclass, replace

import numpy as np

from ir_description import Cell, Equipment, ProgramStep, Station
from ir_description.cell import CellPath, Zone
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_planner.before_after.today import Today, TodayMotion, driven_as, nothing_moves, same_poses
from ir_planner.checks import evaluate_trajectory
from ir_planner.krl import posture_at, station_at
from ir_planner.program import (
    AUTO,
    MOTORS,
    Charge,
    Doors,
    PlannedPause,
    ProgramRequest,
    Scenes,
    placed_steps,
    spent,
)
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

# Where today's program stops to work, as steps that a planner can be asked for.
#
# A standstill at a station, at a posture, before a pause, and where outputs are set, is a stop.
# Other standstills are only passed through: no program needs them. A stop that is nowhere in the
# cell becomes a station of its own there. A process is a stop that is a path: it begins where the
# path does.

POINTS = "todays_points"  # the equipment that stations of today's own stand at
_ZONE = 1e-3  # m: there is no machine
_SAME_PAUSE = 0.05  # s


@dataclass(frozen=True, eq=False)
class StepToday:
    """A step of the program, and what today's program does in it."""

    step: ProgramStep
    stretches: tuple[TodayMotion, ...]


@dataclass(frozen=True, eq=False)
class AskedProgram:
    """The cell with the stations that were added, its program, and what was noticed."""

    cell: Cell
    steps: tuple[StepToday, ...]
    notes: tuple[str, ...]


def asked_program(today: Today, scene: PlanningScene) -> AskedProgram:
    """Today's program as the planner is asked for it. Raises RequestError where it goes nowhere."""
    scene = _carrying(today, scene)
    stops = _Stops(scene)
    steps: list[StepToday] = []
    moves: list[TodayMotion] = []
    last = len(today.stretches) - 1
    for k, stretch in enumerate(today.stretches):
        if stretch.trajectory is not None:
            moves.append(stretch)
            after = today.stretches[k + 1] if k < last else None
            if stretch.process is not None:
                if after is None or after.process is not stretch.process:
                    steps.append(
                        StepToday(ProgramStep("PATH", stops.path(stretch.process)), tuple(moves))
                    )
                    moves = []
                continue
            if after is not None and after.process is not None:
                continue  # the beginning of a path is no stop of its own
            waits = after is not None and after.trajectory is None
            waits = waits or (after is not None and after.load != stretch.load)
            name = stops.name(stretch.q, needed=stretch.works or waits or k == last)
            if name:
                steps.append(StepToday(stops.step(name), tuple(moves)))
                moves = []
        elif stretch.seconds > 0.0:
            pause = ProgramStep("PAUSE", dwell=stretch.seconds, power_mode=AUTO)
            steps.append(StepToday(pause, (stretch,)))
        elif steps:  # a standstill of no time: what is done in it belongs to the stop
            steps[-1] = replace(steps[-1], stretches=(*steps[-1].stretches, stretch))
    if not any(step.step.kind != "PAUSE" for step in steps):
        raise nothing_moves(today.name)
    steps, notes = _at_stops(steps, today, scene)
    steps = _with_loads(steps, today)
    cell = replace(stops.cell(), program=tuple(step.step for step in steps))
    return AskedProgram(cell, tuple(steps), (*stops.notes(), *notes))


def _at_stops(
    steps: list[StepToday], today: Today, scene: PlanningScene
) -> tuple[list[StepToday], list[str]]:
    """The steps with parts and signals: the program's own, else the cell's where it makes the same
    stops.
    """
    if any(stretch.handled or stretch.signals or stretch.awaited for stretch in today.stretches):
        note = "parts and signals at the stops are those of the program's own outputs and waits"
        return _with_signals(steps), [note]
    return _handled(steps, scene.cell, posture_at(scene, today.start))


def _carrying(today: Today, scene: PlanningScene) -> PlanningScene:
    """The scene with what today's program says that it carries."""
    if not today.loads:
        return scene
    cell = replace(scene.cell, tool=today.loads[0], whole_loads=today.loads)
    return replace(scene, cell=cell, loads=cell.loads())


def _with_loads(steps: list[StepToday], today: Today) -> list[StepToday]:
    """The steps with what is carried after each, where today's program says it."""
    if not today.loads:
        return steps
    now = today.loads[0].name
    result = []
    for k, step_today in enumerate(steps):
        following = (stretch for later in steps[k + 1 :] for stretch in later.stretches)
        carries = next((stretch.load for stretch in following), now)
        changes = carries != now
        step = replace(step_today.step, carries=carries) if changes else step_today.step
        result.append(replace(step_today, step=step))
        now = carries
    return result


def _with_signals(steps: list[StepToday]) -> list[StepToday]:
    """The steps with what the program itself waits for, sets, takes and leaves at them. What is
    waited for in a standstill counts before the next movement; what is taken or left in one is at
    the stop before, once more.
    """
    result: list[StepToday] = []
    awaited: list[Signal] = []
    at = ProgramStep("POSTURE", "home")
    for step in steps:
        done = step.stretches
        waits = tuple(signal for stretch in done for signal in stretch.awaited)
        signals = tuple(signal for stretch in done for signal in stretch.signals)
        handled, *more = [stretch.handled for stretch in done if stretch.handled] or [""]
        if step.step.kind == "PAUSE":
            awaited += waits
            result.append(replace(step, step=replace(step.step, set_signals=signals)))
            more = [handled, *more]
        else:
            at = step.step
            there = replace(at, wait_for=(*awaited, *waits), set_signals=signals)
            awaited = []
            result.append(replace(step, step=_handling(there, handled)))
        result += [
            StepToday(_handling(at, part), ()) for part in more if part and at.kind == "STATION"
        ]
    return result


def _handling(step: ProgramStep, handled: str) -> ProgramStep:
    """A step with the part that is taken ("+gear") or left ("-gear") where a station is."""
    if step.kind != "STATION":
        return step
    taken = handled[1:] if handled[:1] == "+" else ""
    left = handled[1:] if handled[:1] == "-" else ""
    return replace(step, attach=taken, detach=left)


def _handled(steps: list[StepToday], cell: Cell, start: str) -> tuple[list[StepToday], list[str]]:
    """The steps with what the cell's program handles at its stops, where it makes the same ones; a
    program that only begins in the posture `start` begins where today's does.
    """
    program_steps = [step for step in cell.program if step.kind != "PAUSE"]
    if program_steps and start and program_steps[0] == ProgramStep("POSTURE", start):
        program_steps = program_steps[1:]
    stopping = [step.step for step in steps if step.step.kind != "PAUSE"]
    if not program_steps or [s.target for s in program_steps] != [s.target for s in stopping]:
        held = cell.tool.name if cell.tool is not None else "nothing"
        handles = any(step.attach or step.detach for step in program_steps)
        return steps, [f"what is held all along: {held}"] if handles else []
    handling = iter(program_steps)
    result = []
    for step in steps:
        if step.step.kind == "PAUSE":
            result.append(step)
        else:
            result.append(replace(step, step=replace(next(handling), dwell=0.0)))
    return result, ["parts and signals at the stops are those of the cell's own program"]


class _Stops:
    """Names of places: the cell's, and those that are added."""

    def __init__(self, scene: PlanningScene) -> None:
        self._scene = scene
        self._added: list[tuple[str, FloatArray]] = []
        self._paths: list[CellPath] = []

    def name(self, q: FloatArray, needed: bool) -> str:
        """Of the stop at q (n,); "" where there is none and none is needed."""
        place = station_at(self._scene, q) or posture_at(self._scene, q)
        if place or not needed:
            return place
        pose = self._scene.chain.tcp_poses(q[None])[0]
        for name, configuration in self._added:
            if np.abs(configuration - pose).max() < 2e-3:
                return name
        taken = {station.name for station in self._scene.cell.stations}
        taken |= set(dict(self._added))
        name = next(name for k in range(1, 10_000) for name in [f"point_{k}"] if name not in taken)
        self._added.append((name, pose))
        return name

    def path(self, driven: CellPath) -> str:
        """Of the path that today's program drives: the cell's own where it has the same poses."""
        same = next(
            (path for path in self._scene.cell.paths if same_poses(path.path, driven.path)), None
        )
        named = driven if same is None else driven_as(same, driven)
        taken = {path.name for path in self._paths}
        if named.name in taken:  # the cell's own once more: perhaps at another speed
            named = replace(named, name=driven.name)
        self._paths.append(named)
        return named.name

    def step(self, name: str) -> ProgramStep:
        """The step that goes there."""
        postures = name in ("home", "park") and name not in [
            s.name for s in self._scene.cell.stations
        ]
        return ProgramStep("POSTURE" if postures else "STATION", name)

    def cell(self) -> Cell:
        """The cell with the added stations."""
        cell = self._scene.cell
        driven = {path.name for path in self._paths}
        paths = (*(path for path in cell.paths if path.name not in driven), *self._paths)
        if self._paths:
            cell = replace(cell, paths=paths, program=())
        if not self._added:
            return cell
        zone = Zone("OPEN", np.eye(4), np.full(3, _ZONE))
        holder = Equipment(POINTS, np.eye(4), (), zone)
        added = [Station(name, POINTS, pose, zone.kind, pose) for name, pose in self._added]
        return replace(
            cell, equipment=(*cell.equipment, holder), stations=(*cell.stations, *added), program=()
        )

    def notes(self) -> list[str]:
        """What was added, in words."""
        names = ", ".join(name for name, _ in self._added)
        return [f"stops that are no station of the cell: {names}"] if names else []


def freed_rests(cell: Cell, asked: AskedProgram) -> tuple[str, ...]:
    """What the cell's own program fixes of today's pauses: the planner's programs are free there,
    so that they may save against a plan of the cell's program as well.
    """
    today = [one.step.dwell for one in asked.steps if one.step.kind == "PAUSE"]
    fixed: dict[str, list[str]] = {}
    for step in cell.program:
        mode = step.power_mode or MOTORS
        stands = any(abs(step.dwell - seconds) < _SAME_PAUSE for seconds in today)
        if step.dwell > 0.0 and stands and mode != AUTO:
            fixed.setdefault(mode, []).append(f"{step.dwell:g}")
    if not fixed:
        return ()
    rests = "; ".join(f"{mode} ({', '.join(dict.fromkeys(s))} s)" for mode, s in fixed.items())
    return (
        "the planner's programs spend every pause in the modes of least energy; the cell's own "
        f"program fixes the mode of some, which is freed here: {rests}",
    )


# Today's program costed as a planned one is: the same loads, the same doors, the capacitor's
# charge carried from step to step, pauses as the controller spends them by itself.


def costed_steps(
    asked: tuple[StepToday, ...], request: ProgramRequest
) -> tuple[PlannedMovement, ...]:
    """The steps of today's program from the request's start. Raises RequestError for one that
    handles what isn't there.
    """
    cell = request.cell
    times = request.settings.transitions
    steps = tuple(step.step for step in asked)
    placed = placed_steps(cell, steps, cell.parts_at_start(), request.doors)
    scenes = Scenes(cell, request.power, request.settings.drives(cell.robot))
    costing = _Costing(request, Charge(times))
    here = ""
    for step, at in zip(asked, placed, strict=True):
        there = here if step.step.kind == "PAUSE" else step.step.target
        for stretch in step.stretches:
            doors = at.doors_before if stretch.doors is None else stretch.doors
            scene = scenes.of(at.before, doors)
            if stretch.trajectory is None and stretch.seconds == 0.0:
                continue
            if stretch.trajectory is None:
                costing.pause(stretch, here, scene)
            else:
                costing.movement(stretch, here, there, scene)
        here = there
    return tuple(costing.steps)


class _Costing:
    """The steps so far, and where the robot stands after them."""

    def __init__(self, request: ProgramRequest, charge: Charge) -> None:
        self.steps: list[PlannedMovement] = []
        self._request = request
        self._charge = charge
        self._q: FloatArray = request.start

    def movement(self, stretch: TodayMotion, here: str, there: str, scene: PlanningScene) -> None:
        """A movement of the hop from `here` to `there`."""
        assert stretch.trajectory is not None  # asked before
        along = stretch.process is not None
        names = [there] if along else [station.name for station in scene.cell.stations]
        contacts = tuple(dict.fromkeys(name for name in (here, there) if name in names))
        evaluated = evaluate_trajectory(
            stretch.trajectory,
            scene,
            self._request.options.safety_distance,
            contacts,
            stretch.at_rest,
        )
        step = PlannedMovement(
            kind=MovementKind.CARTESIAN if along else MovementKind.REGIONAL,
            from_station=there if along else here,
            to_station=there,
            trajectory_id=stretch.trajectory.trajectory_id,
            trajectory=stretch.trajectory,
            report=evaluated.report,
            duration=stretch.trajectory.duration,
            load=scene.load_text,
        )
        self.steps.append(self._charge.moved(step, evaluated.energy, scene))
        self._q = stretch.q

    def pause(self, stretch: TodayMotion, here: str, scene: PlanningScene) -> None:
        """A standstill."""
        pause = PlannedPause(here, stretch.seconds, stretch.power_mode, self._q, scene)
        step = spent(pause, self._request.settings.transitions)
        self.steps.append(self._charge.stood(step, pause))


# How the doors stood when today's program began: as a recording says, or else as the cell has
# them, which is said.


def doors_at_the_start(
    today: Today, asked: AskedProgram, cell: Cell
) -> tuple[Doors, tuple[str, ...]]:
    """Machines that are not as the cell has them where the planner's programs begin, and sentences
    on it.

    Where doors moved meanwhile and no step that is asked for has the signals that move them, the
    planner's programs can't follow: they are planned in the cell's states.
    """
    if today.doors is None:
        return (), assumed_doors(cell)
    recorded = {stretch.doors for stretch in today.stretches}
    signals = {machine.switch.signal for machine in cell.equipment if machine.switch is not None}
    moved = {signal.name for step in asked.steps for signal in step.step.set_signals}
    if len(recorded) > 1 and not signals & moved:
        note = (
            "doors moved in the recording, by signals that no stop has: the planner's programs have"
        )
        return (), (
            f"{note} {_states(cell, ())}; today's movements are judged with the doors as recorded",
        )
    return today.doors, ((f"doors at the start as recorded: {_states(cell, today.doors)}"),)


def assumed_doors(cell: Cell) -> tuple[str, ...]:
    """That the cell's states are assumed, where it has machines that a signal switches."""
    known = doors_as_assumed(cell)
    return (f"doors at the start are {known}",) if known else ()


def doors_as_assumed(cell: Cell) -> str:
    """The states that doors are assumed to have; "" where no signal switches a machine."""
    known = _states(cell, ())
    return f"assumed, as the cell has them: {known}" if known else ""


def _states(cell: Cell, doors: Doors) -> str:
    now = dict(doors)
    switched = [
        machine for machine in cell.equipment if machine.switch is not None and machine.enabled
    ]
    return ", ".join(
        f"{machine.name} {' changing to '.join(now.get(machine.name, (machine.state,)))}"
        for machine in switched
    )
