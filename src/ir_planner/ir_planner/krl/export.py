"""Export of programs as KRL: written, read back, executed and certified again."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ir_description import Cell
from ir_description.poses import inverse
from ir_kernels import portable
from ir_krl import Followed, KrlError
from ir_krl.run import RAIL_NAME, Payload
from ir_krl.write import (
    BASES_MAX,
    Attached,
    Chosen,
    FrameNumbers,
    Numbers,
    PlcPause,
    Style,
    Texts,
    WrittenHandling,
    WrittenMove,
    WrittenPath,
    WrittenPause,
    WrittenSignals,
    WrittenSpline,
    WrittenStatement,
    base_numbers,
    check_name,
    check_signal,
    check_style,
    plc_table,
    structured_text,
    tool_numbers,
)
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import total_report
from ir_planner.errors import RequestError
from ir_planner.krl.execution import drive
from ir_planner.krl.geometry import check_rail, tool_in_flange
from ir_planner.krl.inline_moves import fitted_moves
from ir_planner.krl.makes import Make, make_of, make_remark
from ir_planner.krl.step_evaluation import ReadBack, StepEvaluator, called, points_of
from ir_planner.krl.strokes import deviation_along, fitted_path, one_after_the_other
from ir_planner.krl.surroundings import Surroundings, payload_of
from ir_planner.krl.timed_splines import DEVIATION_MAX, deviation_in_time, fitted_spline
from ir_planner.program import Charge, PlannedPause, spent, switch_times
from ir_planner.scene import STILL, PlanningScene
from ir_values.arrays import FloatArray

__all__ = ["DEVIATION_MAX", "KrlExport", "attached", "export"]

# Programs written as KRL, read back, driven by the controller's model and proved again. What a
# style can't keep of the plan shows in seconds and joules. Modes of pauses are the PLC's.

_PAUSES_MAX = 255
_WITH_BASES = ("kss8", "krc2")  # styles whose points are touched up, each at its machine
_IDS = 5  # in a line of the header
_MANY_JOULES = 100.0  # that one decimal is enough for
_Motion: TypeAlias = WrittenSpline | WrittenPath | WrittenMove


@dataclass(frozen=True, eq=False)
class KrlExport:
    """Texts of the program; the largest deviation [rad] of a joint from the plan, and the reports
    of what was planned and of what the controller drives, movements alone.

    plc_table, plc_text: the pauses that the PLC spends in power modes, as CSV and as structured
    text; "" where it spends none. seconds, joules: of the whole cycle with its pauses. steps: of
    each step of the plan what the controller drives, as its comment in the source says. remark:
    that the robot is another maker's, "" where it isn't.
    """

    source: str
    data: str
    deviation: float
    planned: TrajectoryReport
    exported: TrajectoryReport
    plc_table: str = ""
    plc_text: str = ""
    seconds: float = 0.0
    joules: float = 0.0
    steps: tuple[PlannedMovement, ...] = ()
    remark: str = ""


def export(
    steps: Sequence[PlannedMovement],
    name: str,
    scene: PlanningScene,
    evaluator: StepEvaluator,
    times: TransitionTimes,
    style: str,
    around: Callable[[Followed], Surroundings],
    numbers: FrameNumbers | None = None,
) -> KrlExport:
    """Write steps (movements with their points, and pauses) as program `name`. around: what a
    program that is read back moves among; numbers: of tools and bases that inline forms name.

    Raises RequestError where a movement can't be written so that it stays certified, KrlError for
    the name and the style.
    """
    moving = [step for step in steps if not step.is_pause]
    if not moving:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, "the program has no movement to export")
    check_name(name)
    check_rail(scene)
    if scene.cell.robot.rail is not None and style == "urscript":
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            "style urscript moves no rail: a robot on one is written in style spline, kss8 or krc2",
        )
    asked = numbers or FrameNumbers()
    return _Job(steps, name, scene, evaluator, times, check_style(style), around, asked).done()


@dataclass(frozen=True, eq=False)
class _Again:
    """A movement as the controller drives it."""

    trajectory: JointTrajectory
    deviation: float


class _Job:
    """One export."""

    def __init__(
        self,
        steps: Sequence[PlannedMovement],
        name: str,
        scene: PlanningScene,
        evaluator: StepEvaluator,
        times: TransitionTimes,
        style: Style,
        around: Callable[[Followed], Surroundings],
        asked: FrameNumbers,
    ) -> None:
        self._around = around
        self._steps = steps
        self._name = name
        self._scene = scene
        self._evaluator = evaluator
        self._times = times
        self._style = style
        self._make = make_of(style, scene)
        self._pauses = _plc_pauses(steps, times)
        self._loads = _loads(steps, evaluator)
        self._bases = self._machines() if style in _WITH_BASES else {}
        self._tools_chosen, self._bases_chosen = self._chosen(asked)
        self._start = points_of(next(step for step in steps if not step.is_pause)).positions[0]
        fitted = {id(one): self._fitted(one) for one in steps if not one.is_pause}
        self._motions = {key: parts for key, (parts, _) in fitted.items()}
        self._counts = {key: count for key, (_, count) in fitted.items()}

    def done(self) -> KrlExport:
        """The texts, read back and certified."""
        texts = self._written([""] * len(self._steps), [])
        driven = self._driven_again(texts)
        after = self._costed(driven)
        comments = [self._figures(k, step) for k, step in enumerate(after)]
        texts = self._written(comments, self._header(after, texts))
        moved = [step for step in after if not step.is_pause]
        moving = [step for step in self._steps if not step.is_pause]
        table, text = self._plc(texts)
        return KrlExport(
            texts.source,
            texts.data,
            max(again.deviation for again in driven.values()),
            _together([step.report for step in moving]),
            _together([step.report for step in moved]),
            table,
            text,
            sum(step.duration for step in after),
            sum(step.report.energy for step in after),
            tuple(after),
            make_remark(self._style, self._scene.cell.robot),
        )

    def _fitted(self, step: PlannedMovement) -> tuple[list[_Motion], int]:
        """The motions of a movement, and how many times they come to rest."""
        scene = self._evaluator.scene(step)
        planned = points_of(step)
        back = _read_back(planned.positions[0], scene, self._make)
        parts: list[_Motion]
        if step.kind == MovementKind.CARTESIAN:
            if self._style in ("krc2", "urscript"):
                raise RequestError(
                    StatusCode.INVALID_MOTION_PLAN,
                    f"along {step.to_station}: a path of the tool is written as SPLINE, which "
                    f"{self._style} hasn't: style kss8 or spline",
                )
            parts = list(fitted_path(step, planned, scene, back))
        elif self._style == "spline":
            parts = [fitted_spline(step, self._evaluator, back)]
        else:
            parts = list(fitted_moves(step, self._evaluator, back, self._style))
        return parts, len(back(parts))

    def _written(self, comments: Sequence[str], header: Sequence[str]) -> Texts:
        """The texts of the program in the chosen style: its steps in order, with the numbers of
        tools and bases.
        """
        carried = _loads_after(self._steps, self._loads)
        parts = [
            part
            for step, comment, load in zip(self._steps, comments, carried, strict=True)
            for part in self._statements_of(step, comment, load)
        ]
        from_home = bool(np.abs(self._start - self._scene.cell.machine_home).max() < STILL)
        return self._make.written(
            self._name,
            self._start,
            parts,
            Attached(
                tool_in_flange(self._scene.cell.tcp),
                tuple(self._loads.values()),
                tuple(self._bases.items()),
                tuple(one.number for one in self._tools_chosen),
                tuple(one.number for one in self._bases_chosen),
            ),
            header,
            from_home=from_home,
            numbers=_numbers(self._scene.cell),
        )

    def _statements_of(
        self, step: PlannedMovement, comment: str, carried: int
    ) -> list[WrittenStatement]:
        """The statements of a step, with the base of its machine where points are touched up."""
        waits = WrittenSignals(wait_for=_signals(step.wait_for))
        parts: list[WrittenStatement] = [waits] if step.wait_for else []
        if step.is_pause:
            pause = self._pauses.get(id(step))
            parts.append(WrittenPause(comment, step.duration, pause.number if pause else 0))
        else:
            base = self._base_of(step)
            moves = [
                replace(motion, base=base) if isinstance(motion, WrittenMove) else motion
                for motion in self._motions[id(step)]
            ]
            first, *others = moves
            parts += [replace(first, comment=comment), *others]
        if step.attach or step.detach:
            words = f"takes {step.attach}" if step.attach else f"leaves {step.detach}"
            parts.append(WrittenHandling(words, bool(step.attach), carried))
        if step.set_signals:
            parts.append(WrittenSignals(set_signals=_signals(step.set_signals)))
        return parts

    def _chosen(self, asked: FrameNumbers) -> tuple[tuple[Chosen, ...], tuple[Chosen, ...]]:
        """Numbers of the tools and of the bases, where the style has any. Raises KrlError."""
        if self._style not in _WITH_BASES:
            if asked != FrameNumbers():
                raise KrlError(
                    f"style {self._style} names no tools and bases by number: leave --tool, --base "
                    f"and --numbers-from out, or take style {' or '.join(_WITH_BASES)}"
                )
            return (), ()
        tool = tool_in_flange(self._scene.cell.tcp)
        return tool_numbers(asked, tool, self._loads), base_numbers(asked, self._bases)

    def _machines(self) -> dict[str, FloatArray]:
        """Machines that the movements lead to, with their poses (4, 4) in the robot's foot: bases
        that points are taught in.
        """
        cell = self._scene.cell
        named = dict.fromkeys(map(self._machine_of, self._steps))
        foot = inverse(cell.base_pose)
        return {
            name: portable.matmul(foot, cell.machine(name).pose)
            for name in list(filter(None, named))[:BASES_MAX]
        }

    def _machine_of(self, step: PlannedMovement) -> str:
        """The machine whose base the points of a movement are written in, "" for the foot."""
        leaving = step.kind == MovementKind.SERVICE_EXIT
        name = step.from_station if leaving else step.to_station
        stations = {station.name: station.equipment for station in self._scene.cell.stations}
        return "" if step.is_pause else stations.get(name, "")

    def _base_of(self, step: PlannedMovement) -> int:
        machine = self._machine_of(step)
        return list(self._bases).index(machine) + 1 if machine in self._bases else 0

    def _driven_again(self, texts: Texts) -> dict[int, _Again]:
        """Every movement of the whole program, driven as an import drives it."""
        program = self._make.followed(texts, self._scene)
        around = self._around(program)
        driven = (
            motion.trajectory
            for motion in drive(program, around, self._scene.cell.machine_home)[0]
            if motion.moves
        )
        found = {}
        for step in self._steps:
            if step.is_pause:
                continue
            again = one_after_the_other(list(itertools.islice(driven, self._counts[id(step)])))
            deviation = _deviation_of(step, self._motions[id(step)], again)
            found[id(step)] = _Again(again, deviation)
        return found

    def _costed(self, driven: Mapping[int, _Again]) -> list[PlannedMovement]:
        """The steps as they are driven: certified, with the capacitor's charge carried along.
        Raises RequestError for one that isn't certified.
        """
        charge = Charge(self._times)
        after = []
        here = self._start
        for step in self._steps:
            scene = self._evaluator.scene(step)
            if step.is_pause:
                mode = self._pauses[id(step)].power_mode if id(step) in self._pauses else ""
                pause = PlannedPause(step.to_station, step.duration, mode, here, scene)
                stood = charge.stood(spent(pause, self._times), pause)
                after.append(replace(step, report=stood.report, power_mode=mode))
                continue
            again = driven[id(step)].trajectory
            costed = self._evaluator(again, step)
            if not costed.verification.certified:
                raise RequestError(
                    StatusCode.INVALID_MOTION_PLAN,
                    f"{called(step)} isn't certified as the controller would drive it: "
                    f"{costed.verification.status.message}",
                )
            moved = replace(step, trajectory=again, report=costed.report, duration=again.duration)
            after.append(charge.moved(moved, costed.energy, scene))
            here = again.positions[-1]
        return after

    def _plc(self, texts: Texts) -> tuple[str, str]:
        pauses = list(self._pauses.values())
        if not pauses:
            return "", ""
        header = [
            f"The PLC's part of {self._name}: it spends the program's pauses in power modes, in "
            "EXT.",
            "Power management by the bits AB and HIB, never together with PROFIenergy; times are "
            "those that the pauses were planned with.",
        ]
        table = plc_table(self._name, pauses)
        return table, structured_text(self._name, pauses, texts.numbers, header)

    def _figures(self, k: int, step: PlannedMovement) -> str:
        """The comment of the k-th step as it is driven: places, seconds, joules, clearance,
        modes.
        """
        report = step.report
        digits = 1 if abs(report.energy) >= _MANY_JOULES else 3
        costs = f"{step.duration:.3f} s, {report.energy:.{digits}f} J"
        if step.is_pause:
            pause = self._pauses.get(id(self._steps[k]))
            rest = f"; {pause.sentence}" if pause else ""
            return f"{k + 1} pause at {step.to_station or 'the start'}: {costs}{rest}"
        near = report.min_clearance
        clear = f", {1e3 * near:.1f} mm clear" if np.isfinite(near) else ""
        return f"{k + 1} {called(step)}: {costs}{clear}"

    def _header(self, after: Sequence[PlannedMovement], texts: Texts) -> list[str]:
        """The comments at the begin of the source: cell, tools and bases, what was planned and what
        the controller drives, and what the plant has to know.
        """
        cell = self._scene.cell
        planned = _total(self._steps)
        driven = _total(after)
        moving = [step for step in after if not step.is_pause]
        ids = list(dict.fromkeys(step.trajectory_id for step in moving if step.trajectory_id))
        carried = ", ".join(
            f"{_load_words(load)} ({held or 'empty'})" for held, load in self._loads.items()
        )
        tool = cell.tool.name if cell.tool is not None else "none"
        margin = 1e3 * self._evaluator.margin
        lost = (driven[0] - planned[0], driven[1] - planned[1])
        lines = [
            f"cell {cell.name}, robot {cell.robot.name}, tool {tool}, carried: {carried}",
            f"{len(moving)} movements and {len(after) - len(moving)} pauses: {driven[0]:.2f} s, "
            f"{driven[1]:.0f} J predicted at the mains, {margin:g} mm clear but for allowed "
            "contacts",
            f"style {self._style}: {lost[0]:+.2f} s and {lost[1]:+.0f} J against the plan's "
            f"{planned[0]:.2f} s and {planned[1]:.0f} J",
            "proved: clearance, limits and torque of each movement below, as a model of the "
            "controller drives it at an override of 100 %",
            "not proved: the way from where the robot stands to the first point; another override, "
            "cell, tool or load",
        ]
        if remark := make_remark(self._style, cell.robot):
            lines.append(f"note: {remark}")
        if cell.robot.rail is not None:
            lines.append(
                f"{RAIL_NAME} carries the robot, as a coupled linear unit of the machine data "
                f"(#ERSYS): frames count from where its foot is at {RAIL_NAME} = 0"
            )
        if cell_hash := next(
            (step.report.cell_hash for step in self._steps if step.report.cell_hash), ""
        ):
            lines.append(f"planned in the cell of hash {cell_hash}")
        lines += [
            f"planned movements: {', '.join(ids[k : k + _IDS])}" for k in range(0, len(ids), _IDS)
        ]
        if texts.assumed:
            lines.append("numbered here, for the cell file says none; adapt them in the data list:")
            lines += [f"  {assumption}" for assumption in texts.assumed]
        if texts.tools:
            held = [name or "empty" for name in self._loads]
            tools = _numbered(self._tools_chosen, held)
            lines.append(f"sets TOOL_DATA and LOAD_DATA of the numbers {tools}, for inline forms")
        if texts.bases:
            bases = _numbered(self._bases_chosen, list(texts.bases))
            lines.append(f"sets BASE_DATA of the numbers {bases}, for inline forms")
        if any(
            number.origin in ("own", "asked") for number in self._tools_chosen + self._bases_chosen
        ):
            lines += [
                "WARNING: the plant's own values of these numbers in $config.dat are replaced when",
                "this program starts, for all programs, until somebody restores them: back them up",
            ]
        if self._style == "urscript":
            lines.append("payloads have no moments of inertia here: give the controller its own")
        if self._style == "kss8":
            lines.append("needs KSS 8.5 or later, for its lines of collision monitoring")
        lines += self._output_lines()
        lines += self._pause_lines()
        return lines

    def _output_lines(self) -> list[str]:
        """Which outputs the program sets, that nobody sets at its start."""
        named = [name for step in self._steps for name, _ in _signals(step.set_signals)]
        if any(step.attach or step.detach for step in self._steps):
            named.insert(
                0, "GRIP off, with the gripper empty (else it halts, or the load is wrong)"
            )
        if not named:
            return []
        listed = [
            "outputs that must stand as at the start of the plan, for nothing sets them before:"
        ]
        return listed + [f"  {one}" for one in dict.fromkeys(named)]

    def _pause_lines(self) -> list[str]:
        if not self._pauses:
            return []
        return [
            f"{len(self._pauses)} pauses are spent in power modes by the PLC in EXT, where it sets "
            "IR_PLC;",
            f"its part: {self._name}.plc.st, as a table {self._name}.plc.csv. Without it the "
            "program waits,",
            "on motors until the controller's own timer closes the brakes: joules of these pauses "
            "hold with it only",
        ]


def _plc_pauses(steps: Sequence[PlannedMovement], times: TransitionTimes) -> dict[int, PlcPause]:
    """Pauses that are spent in modes, by the id() of their steps; equal ones have one number.
    Raises RequestError for too many.
    """
    pauses: dict[int, PlcPause] = {}
    numbered: dict[tuple[object, ...], PlcPause] = {}
    for step in steps:
        if not step.is_pause:
            continue
        switch_at, wake_at = switch_times(step.power_mode, step.duration, times)
        if not switch_at:
            continue
        modes = tuple(name for name, _ in switch_at)
        at = tuple(seconds for _, seconds in switch_at)
        key = (step.to_station, step.duration, modes)
        if key not in numbered:
            number = len(numbered) + 1
            numbered[key] = PlcPause(number, step.to_station, step.duration, modes, at, wake_at)
        pauses[id(step)] = numbered[key]
    if len(numbered) > _PAUSES_MAX:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"{len(numbered)} different pauses are spent in power modes: a program numbers at most "
            f"{_PAUSES_MAX}",
        )
    return pauses


def _loads(steps: Sequence[PlannedMovement], evaluator: StepEvaluator) -> dict[str, Payload]:
    """What is carried in the program, by the part that is held, "" for none; the load at the start
    is first.
    """
    loads: dict[str, Payload] = {}
    for step, held in zip(steps, _held(steps)[:-1], strict=True):
        loads.setdefault(held, payload_of(evaluator.scene(step).loads))
    last = _held(steps)[-1]
    loads.setdefault(last, payload_of(evaluator.scene(steps[-1]).cell.loads(last)))
    return loads


def _held(steps: Sequence[PlannedMovement]) -> list[str]:
    """The part that is held while each step runs, and after the last one."""
    held = [""]
    for step in steps:
        held.append(step.attach or ("" if step.detach else held[-1]))
    return held


def _loads_after(steps: Sequence[PlannedMovement], loads: Mapping[str, Payload]) -> list[int]:
    """Which load is carried after each step."""
    return [list(loads).index(held) for held in _held(steps)[1:]]


def attached(scene: PlanningScene) -> Attached:
    """Tool and load of the scene as TOOL_DATA and LOAD_DATA give them, in KUKA's flange."""
    return Attached(tool_in_flange(scene.cell.tcp), (payload_of(scene.loads),))


def _numbers(cell: Cell) -> Numbers:
    return Numbers(
        {signal.name: signal.output for signal in cell.signals},
        {signal.name: signal.input for signal in cell.signals},
    )


def _read_back(start: FloatArray, scene: PlanningScene, make: Make) -> ReadBack:
    """Drives the parts of one movement alone, from `start` (n,)."""

    def back(parts: Sequence[WrittenStatement]) -> list[JointTrajectory]:
        carried = attached(scene)
        texts = make.written("M", start, parts, carried, [], from_home=False, numbers=Numbers())
        driven = drive(make.followed(texts, scene), scene, scene.cell.machine_home)[0]
        return [step.trajectory for step in driven]

    return back


def _deviation_of(step: PlannedMovement, parts: Sequence[_Motion], again: JointTrajectory) -> float:
    planned = points_of(step)
    if isinstance(parts[0], WrittenSpline):
        return deviation_in_time(parts[0], again, planned)
    return deviation_along(again, planned)


_ORIGINS = {"plant": ", the plant's own", "free": ", free in the plant"}


def _numbered(chosen: Sequence[Chosen], names: Sequence[str]) -> str:
    """Numbers with what they stand for, and whose they were."""
    return "; ".join(
        f"{one.number} ({name}{_ORIGINS.get(one.origin, '')})"
        for one, name in zip(chosen, names, strict=True)
    )


def _load_words(load: Payload) -> str:
    return f"{load.mass:.6g} kg"


def _total(steps: Sequence[PlannedMovement]) -> tuple[float, float]:
    return sum(step.duration for step in steps), sum(step.report.energy for step in steps)


def _signals(texts: Sequence[str]) -> tuple[tuple[str, bool], ...]:
    split = [text.partition("=") for text in texts]
    for name, _, _ in split:
        check_signal(name)
    return tuple((name, value != "0") for name, _, value in split)


def _together(reports: Sequence[TrajectoryReport]) -> TrajectoryReport:
    elapsed = np.cumsum([0.0, *(report.duration for report in reports)])[:-1]
    return total_report(tuple(reports), tuple(elapsed.tolist()))
