"""The program of one robot among several: its movements with their curves, and its stops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Cell, Equipment
from ir_description.cell import CellSignal
from ir_description.shapes import Capsule
from ir_kernels.swept import SweptArm
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import clearance_violation
from ir_planner.cycle import ModeWait
from ir_planner.errors import RequestError
from ir_planner.flexible import RUNGS, MovementColumn, slowed_down, wait_modes
from ir_planner.program import (
    MOTORS,
    Charge,
    PlannedPause,
    ProgramRequest,
    StageError,
    TimeValues,
    chosen,
    nobody,
    prepared,
    rests_at,
    spent,
)
from ir_planner.request import Journal
from ir_planner.robots.joint_cycle import ArmSchedule, ArmWork, Lag
from ir_planner.scene import PlanningScene
from ir_planner.timing import Movement
from ir_values.arrays import FloatArray

_SAME = 1e-9  # rad
_SLOWER = tuple(1.1**k for k in range(1, 25))  # times the slowest, up to ten times


@dataclass(frozen=True, eq=False)
class ArmStop:
    """Where a robot stands before a movement: q (n,), what it carries from then on (scene), and the
    pauses of the program there.
    """

    name: str
    q: FloatArray
    scene: PlanningScene
    pauses: tuple[PlannedMovement, ...]

    @property
    def seconds(self) -> float:
        """How long the pauses take."""
        return sum(pause.duration for pause in self.pauses)


@dataclass(frozen=True, eq=False)
class ArmProgram:
    """steps: the movements as they are sent, without reports; columns: certified movements of each,
    fastest first; stops: before each of them, the first one also after the last.
    """

    robot: str
    request: ProgramRequest
    steps: tuple[PlannedMovement, ...]
    columns: tuple[MovementColumn, ...]
    stops: tuple[ArmStop, ...]

    @property
    def cell(self) -> Cell:
        """The cell of the robot."""
        return self.request.cell

    def label(self, k: int) -> str:
        """A movement in words."""
        step = self.steps[k % len(self.steps)]
        if step.from_station == step.to_station:
            return f"{step.kind} {step.to_station}"
        return f"{step.kind} {step.from_station or 'start'} to {step.to_station}"

    @property
    def peak_power(self) -> float:
        """The most that its fastest movements need [W]."""
        return max(column.movements[0].report.peak_power for column in self.columns)

    def within(self, watts: float) -> ArmProgram:
        """The same without movements that need more than so many watts, slowed down where all do.
        Raises StageError where that is not enough.
        """
        columns = tuple(self._below(k, watts) for k in range(len(self.columns)))
        return replace(self, columns=columns)

    def _below(self, k: int, watts: float) -> MovementColumn:
        """Movements of the k-th column whose peak is at most `watts`; where none is, the slowest
        one stretched as little as helps. Raises StageError.
        """
        known = self.columns[k].movements
        kept = [each for each in known if each.report.peak_power <= watts]
        slowest = known[-1]
        for factor in () if kept or slowest.fixed_time else _SLOWER:
            slower = slowest.stretched_by(factor)
            if slower.prove().certified and slower.report.peak_power <= watts:
                kept.append(slower)
                break
        if not kept:
            least = min(each.report.peak_power for each in known)
            raise StageError(
                Status(
                    StatusCode.PLANNING_FAILED,
                    f"{self.robot} needs more than its share of the peak, {watts / 1e3:.1f} kW, "
                    f"for {self.label(k)}, also slowed down: {least / 1e3:.1f} kW as planned",
                )
            )
        return MovementColumn.of(kept)

    def work(self, movements: Sequence[Movement] | None = None) -> ArmWork:
        """What the schedule decides about; movements: these alone instead of the columns."""
        times = self.request.settings.transitions
        curves = [column.curve for column in self.columns]
        if movements is not None:
            curves = [MovementColumn.of([movement]).curve for movement in movements]
        return ArmWork(
            tuple(curves),
            tuple((stop.seconds, _joules(stop.pauses)) for stop in self.stops),
            tuple(wait_modes(rests_at(stop.q, stop.scene, times)) for stop in self.stops),
            _lags(self.cell, self.steps),
        )

    def taking(self, schedule: ArmSchedule) -> list[Movement]:
        """Certified movements of the seconds of a schedule."""
        return [
            column.taking(seconds)
            for column, seconds in zip(self.columns, schedule.seconds, strict=True)
        ]

    def swept(self, movement: Movement) -> SweptArm:
        """A movement as it is proved against other robots, whatever it carries."""
        scene = movement.context.scene
        return SweptArm(scene.chain, capsules_in(scene), *movement.trajectory.coefficients())

    def standing(self, k: int) -> SweptArm:
        """The stop before a movement."""
        stop = self.stops[k]
        return SweptArm.standing(stop.scene.chain, capsules_in(stop.scene), stop.q)

    def lead(self, seconds: float) -> PlannedMovement:
        """Standing on motors before the program begins."""
        stop = self.stops[0]
        asked = PlannedPause(stop.name, seconds, MOTORS, stop.q, stop.scene)
        return spent(asked, self.request.settings.transitions)

    def driven(
        self,
        movements: Sequence[Movement],
        waits: Sequence[Sequence[ModeWait]],
        signals: Sequence[tuple[tuple[str, ...], tuple[str, ...]]],
    ) -> tuple[PlannedMovement, ...]:
        """The steps of a cycle from the stop before the first movement on; signals: which each
        movement waits for, and which it sets. The capacitor is empty at its begin.
        """
        times = self.request.settings.transitions
        charge = Charge(times)
        steps: list[PlannedMovement] = []
        for k, (step, movement) in enumerate(zip(self.steps, movements, strict=True)):
            stop = self.stops[k]
            for pause in stop.pauses:
                asked = PlannedPause(
                    stop.name, pause.duration, pause.power_mode, stop.q, stop.scene
                )
                steps.append(charge.stood(spent(asked, times), asked))
            for wait in waits[k]:
                asked = PlannedPause(stop.name, wait.seconds, wait.mode, stop.q, stop.scene)
                steps.append(charge.stood(spent(asked, times), asked))
            trajectory = movement.trajectory
            moving = replace(
                step,
                trajectory=trajectory,
                trajectory_id=trajectory.trajectory_id,
                duration=trajectory.duration,
                report=movement.report,
                wait_for=(*step.wait_for, *signals[k][0]),
                set_signals=(*step.set_signals, *signals[k][1]),
            )
            steps.append(charge.moved(moving, movement.energy, movement.context.scene))
        return tuple(steps)

    def too_near(self, movement: Movement, equipment: Equipment) -> bool:
        """Whether a movement comes too near to bodies that its scene doesn't have."""
        context = movement.context
        cell = context.scene.cell
        more = replace(cell, equipment=(*cell.equipment, equipment), program=(), route=None)
        scene = replace(context.scene, cell=more)
        found = clearance_violation(
            movement.trajectory, scene, context.safety_distance, context.station
        )
        return found is not None


def _joules(steps: Sequence[PlannedMovement]) -> float:
    return sum(step.report.energy for step in steps)


def capsules_in(scene: PlanningScene) -> tuple[Capsule, ...]:
    """Capsules of the robot and of what it carries in a scene."""
    return (*scene.cell.robot.capsules, *(c for load in scene.loads for c in load.capsules))


def planned_arm(robot: str, request: ProgramRequest, journal: Journal) -> ArmProgram:
    """The program of a robot by itself, certified in its cell at many durations. Raises
    RequestError for one that doesn't end where it begins, StageError for what isn't found.
    """
    try:
        return _arm_program(robot, request, journal)
    except StageError as failed:
        status = failed.status
        sentence = f"the program of {robot}: {status.message}"
        raise StageError(Status(status.code, sentence)) from failed


def check_repeatable(robot: str, cell: Cell) -> None:
    """Refuse, by RequestError, what no cycle of several robots is planned with: machines that
    change, waits for what this program doesn't bring about, a wait of the first cycle that nothing
    ends, a program without movements or one that ends with a part in the gripper.
    """
    switches = {m.switch.signal: m.name for m in cell.equipment if m.switch is not None}
    if not any(step.kind != "PAUSE" for step in cell.program):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the program of {robot} has no movement: give it one that ends with "
            "{posture: park}, or leave the robot out",
        )
    own = [signal for step in cell.program for signal in step.set_signals]
    answers = {signal.name: signal for signal in cell.signals if signal.follows}
    places = cell.parts_at_start()
    before: set[Signal] = set()
    for k, step in enumerate(cell.program, start=1):
        for signal in step.set_signals:
            if signal.name in switches:
                raise RequestError(
                    StatusCode.INVALID_GOAL_CONSTRAINTS,
                    f"step {k} of the program of {robot} switches {switches[signal.name]} by "
                    f"{signal.name}: machines that change aren't planned with several robots yet, "
                    "since the others would have to know; leave it in one state",
                )
        for signal in step.wait_for:
            answer = answers.get(signal.name)
            if answer is None or _asked(answer, signal) not in own:
                raise RequestError(
                    StatusCode.INVALID_GOAL_CONSTRAINTS,
                    f"step {k} of the program of {robot} waits for {signal.name}, which follows "
                    "nothing that this program sets: of the signals of machines only those are "
                    "planned with several robots, and those between robots follow from the "
                    "movements; leave it out",
                )
            if _asked(answer, signal) not in before and answer.initial != signal.value:
                raise RequestError(
                    StatusCode.INVALID_GOAL_CONSTRAINTS,
                    f"step {k} of the program of {robot} waits for {signal.name} before the "
                    f"program sets {answer.follows}, so the first cycle waits for ever: give "
                    f"{signal.name} the level that it waits for as `initial`",
                )
        before.update(step.set_signals)
        places = places.after(step)
    if places.held:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the program of {robot} ends with {places.held} in the gripper, so it can't be "
            "repeated: let it detach that at a station",
        )


def _asked(answer: CellSignal, awaited: Signal) -> Signal:
    """What has to be set so that a signal takes the level that is awaited."""
    return Signal(answer.follows, awaited.value or answer.process != "")


def check_processes(cells: Mapping[str, Cell]) -> None:
    """Refuse, by RequestError, a machine with a process that no program, or that of more than one
    robot, begins. cells: by robot.
    """
    for machine in next(iter(cells.values())).equipment:
        if machine.process == 0.0:
            continue
        robots = [robot for robot, cell in cells.items() if _begins(cell, machine.name)]
        if len(robots) != 1:
            who = " and ".join(robots) or "nobody"
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"{machine.name} has a process of {machine.process:g} s, and {who} begins it and "
                "waits for its end: with several robots one program does both, by a signal and one "
                "that follows it with `process`; or leave it out, and let a program dwell instead",
            )


def _begins(cell: Cell, machine: str) -> bool:
    """Whether the program of a cell sets the signal that begins a process and waits for its end."""
    ends = {signal.name: signal.follows for signal in cell.signals if signal.process == machine}
    awaited = {ends.get(signal.name) for step in cell.program for signal in step.wait_for}
    given = {signal.name for step in cell.program for signal in step.set_signals if signal.value}
    return bool(awaited & given)


def _lags(cell: Cell, steps: Sequence[PlannedMovement]) -> tuple[Lag, ...]:
    """Between movements that set signals and those that wait for what follows them."""
    answers = {signal.name: signal for signal in cell.signals if signal.follows}
    lags = []
    for later, step in enumerate(steps):
        for signal in map(Signal.parse, step.wait_for):
            answer = answers[signal.name]
            asked = _asked(answer, signal)
            setters = [
                k for k, each in enumerate(steps) if asked in map(Signal.parse, each.set_signals)
            ]
            before = [k for k in setters if k < later]
            seconds = answer.delay
            if answer.process:
                seconds = cell.machine(answer.process).process if signal.value else 0.0
            lags.append(Lag(before[-1] if before else setters[-1], later, seconds))
    return tuple(lags)


def _arm_program(robot: str, request: ProgramRequest, journal: Journal) -> ArmProgram:
    """A robot's own program, each of its movements at several values of a second."""
    route, context = prepared(request, journal)
    choice = chosen(request, route, context, nobody)
    values = TimeValues(choice.ladder, choice.parts)
    with journal.stage(f"curves of {robot}") as notes:
        for rung in RUNGS:
            values.seconds(rung)
        fronts = values.fronts()
        notes.append(f"{len(choice.parts)} movements at {len(RUNGS)} values of a second")
    columns = [_column([point.movement for point in fronts[part]]) for part in choice.parts]
    if not columns:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the program of {robot} has no movement: it begins where it stays",
        )
    steps = choice.energies({p: c.movements[0] for p, c in zip(choice.parts, columns, strict=True)})
    return _arm(robot, request, steps, columns)


def _column(front: list[Movement]) -> MovementColumn:
    """Movements of a front, slowed down as far as that saves; one that keeps a tool's speed is as
    it is.
    """
    if front[0].fixed_time:
        return MovementColumn.of(front[:1])
    return MovementColumn.of(slowed_down(front))


def _arm(
    robot: str,
    request: ProgramRequest,
    steps: Sequence[PlannedMovement],
    columns: Sequence[MovementColumn],
) -> ArmProgram:
    """A planned program of one robot as movements and stops that repeat. Raises RequestError where
    it ends elsewhere than it begins, or handles something while it stands.
    """
    first = columns[0].movements[0]
    end = columns[-1].movements[0].trajectory.positions[-1]
    begin = first.trajectory.positions[0]
    if np.abs(end - begin).max() > _SAME:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the program of {robot} ends elsewhere than it begins, so it can't be repeated: let "
            "its last step be {posture: park}",
        )
    before: list[list[PlannedMovement]] = [[]]
    moving: list[PlannedMovement] = []
    for step in steps:
        if step.is_pause:
            if step.attach or step.detach or step.set_signals or step.wait_for:
                raise RequestError(
                    StatusCode.INVALID_GOAL_CONSTRAINTS,
                    f"the program of {robot} handles something, or waits, where it already stands "
                    f"({step.to_station}): with several robots a step that does has to move",
                )
            before[-1].append(step)
        else:
            moving.append(step)
            before.append([])
    pauses = [[*before[-1], *before[0]], *before[1:-1]]
    names = [moving[-1].to_station, *(step.to_station for step in moving[:-1])]
    stops = tuple(
        ArmStop(name, column.movements[0].trajectory.positions[0], _scene(column), tuple(own))
        for name, column, own in zip(names, columns, pauses, strict=True)
    )
    return ArmProgram(robot, request, tuple(moving), tuple(columns), stops)


def _scene(column: MovementColumn) -> PlanningScene:
    return column.movements[0].context.scene
