"""Today's movements and waits, and processes of a KRL program as tool paths."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Load
from ir_description.cell import CellPath
from ir_krl import SourcePlace
from ir_krl.write import PLC_DONE
from ir_msgs_py.cartesian import LINE, CartesianPath
from ir_msgs_py.plc import Signal
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError
from ir_planner.krl import (
    LOAD_NAME,
    DrivenStep,
    EvaluatedProgram,
    EvaluatedStep,
    ToolMotion,
    is_named,
    whole_load,
)
from ir_planner.program import Doors
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

# What today's program works along: processes of a KRL program as paths of the tool.
#
# A saving may not come from cutting a process short: its motions become paths that every planned
# program drives, or the program is refused.

Lines = Sequence[tuple[int, int]]
# speed tolerance: where an axis can't follow the controller slows the tool as well
_AS_SLOW_AS_NEEDED = 1.0
_SAME_PLACE = 2e-3  # m, and of the rotation's entries: as for stations
_NAMED = 6  # places in a note
_SAME_CORNER = 0.1  # mm


def process_paths(steps: Sequence[DrivenStep], lines: Lines | None) -> tuple[CellPath | None, ...]:
    """For each step the path that it drives, alone or with its neighbours. Raises RequestError.

    lines (first, last): whose motions are a process; None: those between an output's on and off.
    """
    _check_lines(steps, lines or ())
    paths: list[CellPath | None] = []
    run: list[DrivenStep] = []
    names: set[str] = set()
    for step in (*steps, None):
        worked = () if step is None else _worked(step, lines)
        if run and not worked:
            paths += [_cell_path(run, names)] * len(run)
            run = []
        if step is not None and worked:
            _check_alone(step, worked)
            run.append(step)
        elif step is not None:
            paths.append(None)
    return tuple(paths)


def process_notes(steps: Sequence[DrivenStep], paths: Sequence[CellPath | None]) -> list[str]:
    """Which motions of the tool are kept as paths, and which the planner may replace."""
    driven = dict.fromkeys(path.name for path in paths if path is not None)
    pairs = list(zip(steps, paths, strict=True))
    free = [lines_of(step.places) for step, path in pairs if path is None and _may_work(step)]
    notes = [f"driven as paths of the tool by every program: {_listed(driven)}"] if driven else []
    for name in driven:
        run = [step for step, path in pairs if path is not None and path.name == name]
        notes += [sentence] if (sentence := _corners(name, run)) else []
    if free:
        notes.append(
            "motions of the tool taken for positioning, which the planner replaces: "
            f"{_listed(free)}; where they are a process, name their lines (--process)"
        )
    return notes


def _corners(name: str, run: Sequence[DrivenStep]) -> str:
    """What is changed at the corners of a path whose motions have different ones; "" where nothing
    is.
    """
    corners = [1e3 * motion.corner for motion in _tool_motions(run)[:-1]]
    if not corners or max(corners) - min(corners) < _SAME_CORNER:
        return ""
    corner_text = "exactly" if min(corners) == 0.0 else f"with {min(corners):.3g} mm"
    return (
        f"{name}: its corners are approximated by {min(corners):.3g} to {max(corners):.3g} mm "
        f"today; a path has one distance for all: the planner's programs drive them {corner_text}, "
        "which takes them longer"
    )


def _tool_motions(run: Sequence[DrivenStep]) -> list[ToolMotion]:
    return [path for step in run for path in step.tool if path is not None]


def same_poses(first: CartesianPath, second: CartesianPath) -> bool:
    """Whether two paths have the same segments through the same poses."""
    kinds = [[segment.kind for segment in path.segments] for path in (first, second)]
    poses = [
        [path.start, *(pose for segment in path.segments for pose in segment.poses)]
        for path in (first, second)
    ]
    if kinds[0] != kinds[1] or len(poses[0]) != len(poses[1]):
        return False
    return float(np.abs(np.array(poses[0]) - np.array(poses[1])).max()) < _SAME_PLACE


def driven_as(own: CellPath, driven: CellPath) -> CellPath:
    """The cell's own path, with what may be touched and how it may turn, as today's program drives
    it.
    """
    kept = own.path
    path = replace(
        driven.path,
        orientation=kept.orientation,
        free_angle=kept.free_angle,
        approach=kept.approach,
        retract=kept.retract,
    )
    return replace(own, path=path)


def lines_of(places: Sequence[SourcePlace]) -> str:
    """Where motions stand in their source."""
    first = places[0]
    last = places[-1]
    return f"{first}" if first.line == last.line else f"{first} to line {last.line}"


def _check_lines(steps: Sequence[DrivenStep], lines: Lines) -> None:
    """Raise RequestError for lines without a motion: a process would be left out without a word."""
    driven = [place.line for step in steps if step.moves for place in step.places]
    for first, last in lines:
        if not any(first <= line <= last for line in driven):
            raise RequestError(
                StatusCode.INVALID_MOTION_PLAN,
                f"no motion stands in lines {first} to {last}, which are called a process",
            )


def _worked(step: DrivenStep, lines: Lines | None) -> tuple[SourcePlace, ...]:
    """Places of its motions that belong to a process."""
    if lines is None or not step.moves:
        return step.process
    return tuple(
        one for one in step.places if any(first <= one.line <= last for first, last in lines)
    )


def _may_work(step: DrivenStep) -> bool:
    """Whether more than a straight line of the tool is driven through: perhaps a process."""
    drawn = [path for path in step.tool if path is not None]
    return len(drawn) > 1 or any(
        segment.kind != LINE for path in drawn for segment in path.segments
    )


def _check_alone(step: DrivenStep, worked: tuple[SourcePlace, ...]) -> None:
    """Raise RequestError where a step has motions that no path of the tool describes."""
    if all(one is not None for one in step.tool) and step.tool and all(step.at_rest):
        return
    if not all(step.at_rest):
        switched = ", ".join(f"$OUT[{one.number}]" for one in step.outputs) or "$LOAD"
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"{lines_of(worked)} is a process in whose course {switched} moves a door or changes "
            "what is carried: no path of the tool is driven on among other bodies or with another "
            "load; set it where a motion ends exactly (without C_DIS, C_SPL and TRIGGER), or name "
            "the lines of processes, or none (--process)",
        )
    raise RequestError(
        StatusCode.INVALID_MOTION_PLAN,
        f"{lines_of(worked)} is a process, but the movement {lines_of(step.places)} that it is "
        "driven in has parts that no path of the tool describes (a PTP that is blended into it, "
        "a turn on the spot, a tool that isn't the cell's): end these in exact stops, or name "
        "the lines of processes or none (--process)",
    )


def _cell_path(run: Sequence[DrivenStep], names: set[str]) -> CellPath:
    """The path through all motions of steps that follow each other."""
    motions = _tool_motions(run)
    segments = tuple(segment for motion in motions for segment in motion.segments)
    first = run[0].places[0].line
    last = run[-1].places[-1].line
    base = f"lines_{first}_to_{last}" if first != last else f"line_{first}"
    name = base
    number = 1
    while name in names:
        number += 1
        name = f"{base}_{number}"
    names.add(name)
    try:
        path = CartesianPath(
            motions[0].start,
            segments,
            tool_speed=segments[0].tool_speed,
            speed_tolerance=_AS_SLOW_AS_NEEDED,
            blending_radius=min((one.corner for one in motions[:-1]), default=0.0),
        )
    except InvalidValueError as error:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN, f"{lines_of(run[0].places)}: {error}"
        ) from error
    return CellPath(name, path)


def _listed(names: Sequence[str] | dict[str, None]) -> str:
    known = list(names)
    more = f" and {len(known) - _NAMED} more" if len(known) > _NAMED else ""
    return ", ".join(known[:_NAMED]) + more


# What a robot does today, wherever that is known from: movements between standstills, and
# waits.


@dataclass(frozen=True, eq=False)
class TodayMotion:
    """One movement, or a standstill of `seconds` (trajectory None), that ends at q (n,) [rad].

    works: something is done where it ends (an output, a wait for a machine), so that the stop is
    not only passed through. label: where it stands in its source. doors: machines that were not as
    the cell has them meanwhile; None: nobody recorded it, they are as the program's own signals
    move them. process: the path of the tool that it drives, alone or with neighbours that have the
    same one. power_mode: in which a standstill is spent, "" as the controller does by itself.
    awaited, signals: of the cell, waited for in it and set at its end; handled: the part that is
    taken ("+gear") or left ("-gear") there. at_rest: whether it begins and ends at rest: not where
    it is cut because something changes in its course. load: the name of what is carried in it where
    the program says what that is, "" where the cell does.
    """

    trajectory: JointTrajectory | None
    q: FloatArray
    seconds: float
    works: bool = False
    label: str = ""
    doors: Doors | None = None
    process: CellPath | None = None
    power_mode: str = ""
    awaited: tuple[Signal, ...] = ()
    signals: tuple[Signal, ...] = ()
    handled: str = ""
    at_rest: tuple[bool, bool] = (True, True)
    load: str = ""


@dataclass(frozen=True, eq=False)
class Today:
    """A program as it runs, from `start` (n,) [rad]; kind: what it is read from; notes: what was
    assumed; loads: what it carries, tool and part in one, the first at its start; none: what the
    cell says.
    """

    name: str
    kind: str
    start: FloatArray
    stretches: tuple[TodayMotion, ...]
    notes: tuple[str, ...] = ()
    loads: tuple[Load, ...] = ()

    @property
    def doors(self) -> Doors | None:
        """Machines that were not as the cell has them when it began; None: nobody recorded it."""
        return self.stretches[0].doors if self.stretches else None

    @property
    def seconds(self) -> float:
        """Its cycle time."""
        return sum(one.seconds for one in self.stretches)


def nothing_moves(name: str) -> RequestError:
    """The refusal of a program whose movements can't be compared: it has none."""
    return RequestError(
        StatusCode.INVALID_MOTION_PLAN, f"{name} has no movement: there is nothing to compare"
    )


def today_of_krl(found: EvaluatedProgram, process: Lines | None = None) -> Today:
    """A KRL program as a KR C4 drives it.

    process: lines (first, last) whose motions are a process; None: those between an output's on and
    off, (): none. Raises RequestError for a program that doesn't move and for a process that
    can't be asked for as paths of the tool.
    """
    if not any(motion.step.moves for motion in found.steps):
        raise nothing_moves(found.name)
    paths = process_paths([motion.step for motion in found.steps], process)
    loads, carried = _loads([motion.step for motion in found.steps])
    stretches = tuple(
        replace(_stretch(motion, path), load=load)
        for motion, path, load in zip(found.steps, paths, carried, strict=True)
    )
    start = np.asarray(found.steps[0].step.trajectory.positions[0])
    notes = [str(note) for note in found.notes]
    waits = [
        motion
        for motion in found.steps
        if motion.step.waits_for and PLC_DONE not in motion.step.waits_for
    ]
    if waits:
        notes.append(
            f"{len(waits)} waits for machines count no time: how long they take is not in a program"
        )
    notes += process_notes([motion.step for motion in found.steps], paths)
    if loads:
        notes.append(
            "every program of this comparison carries what $LOAD says, movement by movement: "
            + ", ".join(f"{load.mass:.6g} kg" for load in loads)
        )
    return Today(found.name, "KRL program", start, stretches, tuple(notes), loads)


def _loads(steps: Sequence[DrivenStep]) -> tuple[tuple[Load, ...], list[str]]:
    """What a program carries, and which of it in each step, where $LOAD says it anywhere."""
    if not any(map(is_named, (load for step in steps for load in step.scene.loads))):
        return (), [""] * len(steps)
    loads: list[Load] = []
    carried = []
    for step in steps:
        load = whole_load(step.scene.loads, step.places[0])
        same = next(
            (load_before for load_before in loads if _is_same_load(load_before, load)), None
        )
        if same is None:
            name = LOAD_NAME if not loads else f"{LOAD_NAME}_{len(loads) + 1}"
            same = replace(load, name=name)
            loads.append(same)
        carried.append(same.name)
    return tuple(loads), carried


def _is_same_load(a: Load, b: Load) -> bool:
    names = [[capsule.name for capsule in load.capsules] for load in (a, b)]
    figures = [np.concatenate([[load.mass], load.com, load.inertia.ravel()]) for load in (a, b)]
    return names[0] == names[1] and np.array_equal(figures[0], figures[1])


def _stretch(one: EvaluatedStep, process: CellPath | None) -> TodayMotion:
    """An evaluated step of the KRL program as a motion of today's program; process: the path that
    it drives under an output.
    """
    step = one.step
    end = np.asarray(step.trajectory.positions[-1])
    works = bool(step.outputs or step.waits_for)
    trajectory = step.trajectory if step.moves else None
    label = lines_of(step.places)
    return TodayMotion(
        trajectory,
        end,
        step.trajectory.duration,
        works,
        label,
        process=process,
        power_mode=one.power_mode,
        awaited=step.awaited,
        signals=step.signals,
        handled=step.handled,
        at_rest=step.at_rest,
    )
