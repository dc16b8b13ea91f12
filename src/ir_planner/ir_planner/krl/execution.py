"""Execution of a KRL program as on a KR C4: movements between standstills, waits, outputs."""

from bisect import insort
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ir_krl import Followed, KrlMotionError, Motion, SourcePlace
from ir_krl.run import (
    AdvanceStop,
    Blend,
    Command,
    Effect,
    Note,
    Payload,
    SetOutput,
    Speeds,
    SplineBlock,
    StandStill,
    Target,
    WaitForCondition,
)
from ir_msgs_py.plc import Signal
from ir_msgs_py.trajectory import NS_PER_S, JointTrajectory
from ir_planner.krl.blended_motions import (
    AxisLine,
    AxisPath,
    Move,
    move,
    overlap,
    tool_curve,
    trajectory,
)
from ir_planner.krl.geometry import Arm
from ir_planner.krl.splines import (
    ToolMotion,
    block_curve,
    stretched,
    stretches,
    timed_block,
    tool_motion,
    tool_spline,
)
from ir_planner.krl.surroundings import Surroundings, nothing_around
from ir_planner.krl.triggers import (
    MotionInstants,
    along_path,
    instant,
    instants_of_motions,
    instants_of_parts,
)
from ir_planner.scene import STILL, PlanningScene
from ir_planner.timing import GRID_NS, GRID_S, standing
from ir_values.arrays import FloatArray

# Which motions of a program are its process: what the tool does between switching an output on and
# off.


def process_motions(commands: Sequence[Command]) -> frozenset[int]:
    """Places in `commands` of the motions of a process.

    A process begins where an output is switched on and ends where the same one is switched off, and
    only the tool is led meanwhile (LIN, CIRC, SPLINE and their relatives; waits don't matter). A
    PTP ends it: what is switched around one is a gripper or a message. A pulse switches nothing.
    """
    numbers: set[int] = set()
    since: dict[int, set[int]] = {}  # by output: motions since it was switched on
    for k, command in enumerate(commands):
        match command:
            case SetOutput(value=True, pulse=0.0):
                since.setdefault(command.number, set())
            case SetOutput(value=False):
                numbers |= since.pop(command.number, set())
            case Motion(kind="ptp") | SplineBlock(axis=True):
                since.clear()
            case Motion() | SplineBlock():
                for motions in since.values():
                    motions.add(k)
    return frozenset(numbers)


def _target_of(command: Motion | SplineBlock) -> Target:
    return command.target if isinstance(command, Motion) else command.parts[-1].target


# A KRL program as a KR C4 drives it: a trajectory from one standstill to the next, waits,
# outputs.

_BLENDED_JERK = 0.5  # of the limit: while two moves overlap their jerks add up


class Switched(NamedTuple):
    """An output that a step sets, `seconds` after it began."""

    number: int
    value: bool
    seconds: float


@dataclass(frozen=True, eq=False)
class DrivenStep:
    """One step from standstill to standstill: a movement, or a wait. A movement in whose course
    something else is carried or a door begins to move is two steps or more.

    places: of its motions in the program; outputs: that are set in it; waits_for: a condition that
    ends a wait; tool: for each motion what the tool draws, None for a PTP and where no segment
    describes it; process: places of the motions that belong to a process. scene: in which it is
    driven; handled: the part that is taken ("+gear") or left ("-gear") at its end; awaited,
    signals: of the cell, that it waits for and that are set until its end. at_rest: whether it
    begins and ends at rest; between: where the whole movement begins and ends (2, n).
    """

    trajectory: JointTrajectory
    moves: bool
    places: tuple[SourcePlace, ...]
    outputs: tuple[Switched, ...] = ()
    waits_for: str = ""
    tool: tuple[ToolMotion | None, ...] = ()
    process: tuple[SourcePlace, ...] = ()
    handled: str = ""
    awaited: tuple[Signal, ...] = ()
    signals: tuple[Signal, ...] = ()
    at_rest: tuple[bool, bool] = (True, True)
    _: KW_ONLY
    scene: PlanningScene
    between: FloatArray


def drive(
    program: Followed, among: Surroundings | PlanningScene, start: FloatArray
) -> tuple[tuple[DrivenStep, ...], tuple[Note, ...]]:
    """All steps of the program, and what was assumed; `start` (n,) is where the robot stands
    before; among: what it changes as it runs, or a scene that it doesn't change.

    As on the controller, the first motion brings the robot onto the programmed path (block
    coincidence): it is no part of the cycle. Raises KrlMotionError.
    """
    around = among if isinstance(among, Surroundings) else nothing_around(among)
    run = _Drive(around, np.array(start), list(program.notes))
    process = process_motions(program.commands)
    triggered = _triggered(program.commands)
    for k, command in enumerate(program.commands):
        run.working = k in process
        run.take(command, triggered.get(k, ()))
    run.finish()
    return tuple(run.steps), (*run.notes, *around.notes)


def _triggered(commands: Sequence[Command]) -> dict[int, list[SetOutput]]:
    """What triggers set, by the place of their motion in `commands`."""
    outputs: dict[int, list[SetOutput]] = {}
    waiting: list[SetOutput] = []
    last = -1
    for k, command in enumerate(commands):
        if isinstance(command, Motion | SplineBlock):
            outputs[k] = waiting
            waiting = []
            last = k
        elif isinstance(command, SetOutput) and command.switch is not None:
            (waiting if command.switch.ahead or last < 0 else outputs[last]).append(command)
    return outputs


class _Event(NamedTuple):
    """What happens in a step, `at` s after it began: an output is set, by the end of a pulse
    (`ends_pulse`) or else, or the next motion says what it carries.
    """

    at: float
    change: SetOutput | Motion
    ends_pulse: bool = False

    def pulses(self, number: int) -> bool:
        """Whether a pulse of this output ends."""
        change = self.change
        return self.ends_pulse and isinstance(change, SetOutput) and change.number == number


@dataclass
class _Piece:
    """What has happened since the movement was cut last, at `begin` s."""

    begin: float = 0.0
    outputs: list[Switched] = field(default_factory=list)
    signals: list[Signal] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Driven:
    """A motion that is driven through: the law of its curve, what the program says of it, and what
    triggers set in it.
    """

    move: Move
    command: Motion | SplineBlock
    drawn: ToolMotion | None
    working: bool
    triggered: Sequence[SetOutput]


@dataclass
class _Drive:
    """Where the robot stands (n,), and the motions that are being driven through."""

    around: Surroundings
    here: FloatArray
    notes: list[Note]
    steps: list[DrivenStep] = field(default_factory=list)
    _through: list[_Driven] = field(default_factory=list)
    _overlaps: list[int] = field(default_factory=list)
    _outputs: list[SetOutput] = field(default_factory=list)  # set while the robot moves
    _later: list[_Event] = field(default_factory=list)  # seconds after the last step
    working: bool = False  # the command belongs to a process
    _on_path: bool = False  # the first motion has led to the programmed path
    _blend: Blend | None = None  # of the last motion; None: it ends at rest
    _payload: Payload | None = None  # of the last motion

    def __post_init__(self) -> None:
        self._among(self.around.scene(None, SourcePlace()))

    def _carry(self, payload: Payload | None, place: SourcePlace) -> None:
        """What the motions from here on carry."""
        self._payload = payload
        self._among(self.around.scene(payload, place))

    def _among(self, scene: PlanningScene) -> None:
        """Drive in this scene from here on."""
        self.scene = scene
        self.arm = Arm(scene, self.notes.append)

    def take(self, command: Command, triggered: Sequence[SetOutput] = ()) -> None:
        """Drive one command; what triggers set in it, where it is a motion."""
        if isinstance(command, Motion | SplineBlock):
            self._part_kinds(command)
        match command:
            case Motion():
                self._motion(command, triggered)
            case SplineBlock():
                self._block(command, triggered)
            case SetOutput() if command.switch is not None:
                pass  # belongs to its motion
            case SetOutput():
                self.finish()
                self._set(command)
            case StandStill():
                self.finish()
                self._stand(command.seconds, command.place, "")
                self.around.stood(command.seconds)
            case AdvanceStop():
                self.finish()
            case WaitForCondition():
                self.finish()
                self._stand(0.0, command.place, command.condition)
                signals = self.around.awaited(command.condition)
                self.steps[-1] = replace(self.steps[-1], awaited=signals)

    def _part_kinds(self, command: Motion | SplineBlock) -> None:
        """Stop between a motion of the spline kind and one of the other, as controllers do."""
        if self._through and _is_spline(self._through[-1].command) != _is_spline(command):
            text = (
                "between PTP, LIN, CIRC and motions of a spline no corner is rounded: the motion "
                "before stops exactly"
            )
            self.notes.append(Note(self._through[-1].command.place, text, Effect.TIMES))
            self.finish()

    def finish(self) -> None:
        """Come to rest: what is being driven through becomes a step."""
        if not self._through:
            return
        through = self._through
        moves = [part.move for part in through]
        driven = trajectory(moves, self._overlaps, self.scene.cell.robot.joint_names)
        events = self._events(driven, instants_of_motions(moves, self._overlaps))
        self._through = []
        self._overlaps = []
        self._blend = None
        outputs = self._outputs
        self._outputs = []
        self._carry(_payload_of(through[0].command), through[0].command.place)
        self._step(
            driven,
            tuple(part.command.place for part in through),
            events,
            moves=True,
            tool=tuple(part.drawn for part in through),
            process=tuple(part.command.place for part in through if part.working),
        )
        for output in outputs:
            self._set(output)

    def _events(
        self, driven: JointTrajectory, instants: Sequence[Sequence[MotionInstants]]
    ) -> list[_Event]:
        """What happens while a movement is driven."""
        events = []
        for part, parts in zip(self._through, instants, strict=True):
            if part is not self._through[0]:
                rounded = 0.5 * (parts[0].earliest + parts[0].free)
                events.append(_Event(rounded, _first_part(part.command)))
            events += self._triggers(driven, part.command, parts, part.triggered)
        return events

    def _triggers(
        self,
        driven: JointTrajectory,
        command: Motion | SplineBlock,
        instants: Sequence[MotionInstants],
        triggered: Sequence[SetOutput],
    ) -> list[_Event]:
        """When the triggers of a motion act."""
        if not triggered:
            return []
        shifted = along_path(driven, _target_of(command), self.arm)
        events = []
        for trigger in triggered:
            assert trigger.switch is not None  # as triggers have
            at, limited = instant(trigger.switch, instants[trigger.switch.part], shifted)
            events.append(_Event(at, trigger))
            if limited:
                text = "a TRIGGER would act beyond its motion: it acts at the last place there"
                self.notes.append(Note(trigger.place, text, Effect.TIMES))
            if trigger.switch.path and _is_axis(command):
                text = "PATH before an axis motion, which controllers refuse: the tool's path there"
                self.notes.append(Note(trigger.place, text, Effect.TIMES))
        return events

    def _set(self, command: SetOutput, q: FloatArray | None = None, *, listed: bool = True) -> None:
        """An output is set at the end of the last step, where the robot stands; at q (n,) where
        that isn't where the motions so far lead.
        """
        here = self.here if q is None else q
        if not self.steps and self._on_path:
            self._stand(0.0, command.place, "", here)
        signals = self.around.signalled(command.number, command.value)
        handled = self.around.gripped(command.number, command.value, here, command.place)
        if handled:  # until a motion says what $LOAD is then
            self._payload = None
        before = self.steps[-1].handled if self.steps else ""
        if handled and before and handled[1:] != before[1:]:  # another part at the same stop
            self._stand(0.0, command.place, "", here)
        elif handled and before:  # left and taken again
            self.steps[-1] = replace(self.steps[-1], handled="")
            handled = ""
        if self.steps:
            last = self.steps[-1]
            set_now = Switched(command.number, command.value, last.trajectory.duration)
            self.steps[-1] = replace(
                last,
                outputs=(*last.outputs, set_now) if listed else last.outputs,
                handled=handled or last.handled,
                signals=(*last.signals, *signals),
            )
        self._goes_back(command, 0.0)

    def _goes_back(self, command: SetOutput, at: float) -> None:
        """A pulse that is set at `at` s ends by itself, unless its output is set again before. A
        gripper's stays: its valve keeps its side.
        """
        self._later = [event for event in self._later if not event.pulses(command.number)]
        if command.pulse > 0.0 and not self.around.grips(command.number):
            back = replace(command, value=not command.value, pulse=0.0)
            insort(self._later, _Event(at + command.pulse, back, ends_pulse=True), key=_at)

    def _motion(self, motion: Motion, triggered: Sequence[SetOutput]) -> None:
        """Drive one motion as the controller would; the first one, a PTP, says where the robot
        stands. A motion to where it already stands only sets its outputs.
        """
        if not self._through:
            self._carry(motion.payload, motion.place)
        if not self._on_path:
            if motion.kind != "ptp":
                raise KrlMotionError(
                    "the first motion must be a PTP: where does the robot stand before?",
                    motion.place,
                )
            self.here = self.arm.reached(motion.target, self.here, motion.place)
            self._on_path = True
            self._at_once(triggered)
            return
        if motion.kind == "ptp":
            end = self.arm.reached(motion.target, self.here, motion.place)
            if np.abs(end - self.here).max() < STILL:
                self._at_once(triggered)
                return
            curve: AxisPath = AxisLine(self.here, end)
            drawn = None
        else:
            rail = self.here[: self.scene.cell.robot.base]
            curve = tool_curve(motion, self.here, self.arm)
            slid = np.abs(motion.target.rail_after(rail) - rail).max(initial=0.0)
            if max(curve.length, curve.turning, slid) < STILL:
                self._at_once(triggered)
                return
            drawn = tool_motion(motion, self.here, self.arm)
        self._drive(curve, motion, motion.speeds, drawn, triggered)

    def _at_once(self, triggered: Sequence[SetOutput]) -> None:
        """What triggers of a motion set that leads nowhere."""
        for trigger in triggered:
            if self._through:
                self._outputs.append(trigger)
            else:
                self._set(trigger)

    def _block(self, block: SplineBlock, triggered: Sequence[SetOutput]) -> None:
        """Drive a spline block: as timed points where it gives them, by the times of its parts, or
        as one curve at the speeds of its first part.
        """
        if not self._through:
            self._carry(block.parts[0].payload, block.place)
        if not self._on_path:
            raise KrlMotionError(
                "the first motion must be a PTP: where does the robot stand before?", block.place
            )
        timed = timed_block(block, self.here, self.arm)
        if timed is not None:
            self.finish()
            driven, times = timed
            self._carry(block.parts[0].payload, block.place)
            events = self._triggers(driven, block, instants_of_parts(times), triggered)
            self.here = driven.positions[-1]
            self._step(driven, (block.place,), events, moves=True)
            return
        curve = block_curve(block, self.here, self.arm)
        if any(part.speeds != block.parts[0].speeds for part in block.parts):
            text = "parts have speeds of their own: driven as its first part"
            self.notes.append(Note(block.place, text, Effect.SPEEDS))
        if block.times and block.blend is None and self._blend is None:
            self._timed_parts(block, curve, triggered)
            return
        least = self._least(block, curve)
        drawn = None if block.axis or block.times else tool_spline(block, self.here, self.arm)
        self._drive(curve, block, block.parts[0].speeds, drawn, triggered, least)

    def _timed_parts(
        self, block: SplineBlock, curve: AxisPath, triggered: Sequence[SetOutput]
    ) -> None:
        """A block that begins and ends at rest and whose TIME_BLOCKs time some of its parts."""
        self.finish()
        self._carry(block.parts[0].payload, block.place)
        speeds = block.parts[0].speeds
        by_itself = move(curve, speeds, self.scene, _target_of(block), block.place)
        passed = np.concatenate([[0], by_itself.passing()]) * GRID_S
        parts = stretches(block, passed, speeds.override)
        hurried = [part for part in parts if part.longer < -GRID_S]
        if hurried:
            text = (
                f"TIME_BLOCK asks for {sum(-part.longer for part in hurried):.3f} s less than the "
                "robot needs: driven as fast as it can"
            )
            self.notes.append(Note(block.times[0].place, text, Effect.TIMES))
        slower = [part for part in parts if part.longer > 0.0]
        names = self.scene.cell.robot.joint_names
        driven, times = stretched(trajectory([by_itself], [], names), slower, passed)
        events = self._triggers(driven, block, instants_of_parts(times), triggered)
        self.here = driven.positions[-1]
        process = (block.place,) if self.working else ()
        self._step(driven, (block.place,), events, moves=True, tool=(None,), process=process)

    def _least(self, block: SplineBlock, curve: AxisPath) -> float:
        """Seconds that a block lasts at least: its TIME_BLOCK, and the parts outside as long as
        they take by themselves.
        """
        speeds = block.parts[0].speeds
        if not block.times:
            return 0.0
        text = (
            "TIME_BLOCK in a spline whose corner is rounded: the whole lasts as long as its times "
            "and the parts outside by themselves, but one law drives all of it, so that the parts "
            "aren't passed when they should be"
        )
        self.notes.append(Note(block.times[0].place, text, Effect.MOTIONS))
        by_itself = move(curve, speeds, self.scene, _target_of(block), block.place)
        passed = np.concatenate([[0], by_itself.passing()]) * GRID_S
        seconds_asked = [float(passed[part.last] - passed[part.first]) for part in block.times]
        longer = (
            max(part.seconds / speeds.override - seconds, 0.0)
            for part, seconds in zip(block.times, seconds_asked, strict=True)
        )
        return float(passed[-1]) + sum(longer)

    def _drive(
        self,
        curve: AxisPath,
        command: Motion | SplineBlock,
        speeds: Speeds,
        drawn: ToolMotion | None,
        triggered: Sequence[SetOutput],
        least: float = 0.0,
    ) -> None:
        """Drive a curve: at once where it ends at rest, joined with the motions before it where
        corners are blended. least [s]: it takes at least so long.
        """
        self._carry(_payload_of(command), command.place)
        share = 1.0 if self._blend is None and command.blend is None else _BLENDED_JERK
        target = _target_of(command)
        movement = move(
            curve, speeds, self.scene, target, command.place, least=least, jerk_share=share
        )
        if self._through and self._blend is not None:
            steps = overlap(self._through[-1].move, movement, self._blend, self.arm)
            if steps > 0:
                self._overlaps.append(steps)
            else:
                self.finish()
        self._through.append(_Driven(movement, command, drawn, self.working, triggered))
        self._blend = command.blend
        self.here = movement.at(np.array([movement.law.total]))[0][0]
        if self._blend is None:
            self.finish()

    def _stand(
        self, seconds: float, place: SourcePlace, condition: str, q: FloatArray | None = None
    ) -> None:
        """Stand where the motions so far lead, or at q (n,)."""
        self._carry(self._payload, place)
        here = self.here if q is None else q
        still = standing(here, self.scene.cell.robot.joint_names, seconds)
        self._step(still, (place,), [], moves=False, waits_for=condition)

    def _step(
        self,
        driven: JointTrajectory,
        places: tuple[SourcePlace, ...],
        events: Sequence[_Event],
        *,
        moves: bool,
        waits_for: str = "",
        tool: tuple[ToolMotion | None, ...] = (),
        process: tuple[SourcePlace, ...] = (),
    ) -> None:
        """A step, cut where what it moves among changes in its course."""
        self._before(driven, places[0], events)
        whole = DrivenStep(
            driven,
            moves,
            places,
            waits_for=waits_for,
            tool=tool,
            process=process,
            scene=self.scene,
            between=driven.positions[[0, -1]],
        )
        end = driven.duration
        self._later = sorted([*self._later, *(one for one in events if one.at > _SAME)], key=_at)
        piece = _Piece()
        at_end: list[tuple[SetOutput, bool]] = []
        while self._later and self._later[0].at <= end + _SAME:
            event = self._later.pop(0)
            event = event._replace(at=round(event.at / GRID_S) * GRID_S)  # where it may be cut
            if isinstance(event.change, SetOutput) and event.at > end - _SAME:
                at_end.append((event.change, True))
                continue
            if isinstance(event.change, Motion):
                handled = ""
                self._payload = event.change.payload
            else:
                handled = self._under_way(event.at, event.change, whole, piece, at_end)
            place = event.change.place
            if self.around.scene(self._payload, place) is not self.scene:
                self._cut(whole, piece, event.at, handled)
                self._carry(self._payload, place)
        self._cut(whole, piece, end, "")
        self._later = [one._replace(at=one.at - end) for one in self._later]
        for output, listed in at_end:
            self._set(output, listed=listed)

    def _before(
        self, driven: JointTrajectory, place: SourcePlace, events: Sequence[_Event]
    ) -> None:
        """What is set where a step begins, before it."""
        carried = self._payload
        for event in events:
            if isinstance(event.change, SetOutput) and event.at <= _SAME:
                self._set(event.change, driven.positions[0])
        self._carry(carried, place)

    def _under_way(
        self,
        at: float,
        output: SetOutput,
        whole: DrivenStep,
        piece: _Piece,
        at_end: list[tuple[SetOutput, bool]],
    ) -> str:
        """An output is set in the course of a step; the part that is taken or left there.

        A gripper that closes or opens on its last way to a station needs its time as well: the part
        is taken or left at the end.
        """
        piece.outputs.append(Switched(output.number, output.value, at - piece.begin))
        q = whole.trajectory.sample([at]).q[0]
        if whole.moves and self.around.acts_later(output.number, output.value, q, whole.between[1]):
            at_end.append((replace(output, pulse=0.0), False))
            done = "closes" if output.value else "opens"
            text = (
                f"the gripper {done} {1e3 * (whole.trajectory.duration - at):.0f} ms before the "
                "motion ends: the part is taken or left at its end"
            )
            self.notes.append(Note(output.place, text, Effect.TIMES))
            return ""
        piece.signals += self.around.signalled(output.number, output.value)
        self._goes_back(output, at)
        handled = self.around.gripped(output.number, output.value, q, output.place)
        if handled:
            self._payload = None
        return handled

    def _cut(self, whole: DrivenStep, piece: _Piece, at: float, handled: str) -> None:
        """The step ends here, or goes on as another one."""
        end = whole.trajectory.duration
        part = whole
        if piece.begin > 0.0 or at < end:
            resting = (piece.begin <= 0.0 or not whole.moves, at >= end or not whole.moves)
            driven = _trajectory_between(whole.trajectory, piece.begin, at)
            drawn = whole.tool if piece.begin <= 0.0 else ()
            part = replace(whole, trajectory=driven, at_rest=resting, tool=drawn)
        self.steps.append(
            replace(
                part,
                scene=self.scene,
                outputs=tuple(piece.outputs),
                signals=tuple(piece.signals),
                handled=handled,
            )
        )
        piece.begin = at
        piece.outputs = []
        piece.signals = []


_SAME = 0.5 * GRID_S  # s: instants that are one


def _at(event: _Event) -> float:
    return event.at


def _trajectory_between(driven: JointTrajectory, begin: float, end: float) -> JointTrajectory:
    """The part of a trajectory from one instant to another [s], which are grid steps."""
    first, last = (round(instant / GRID_S) * GRID_NS for instant in (begin, end))
    inner = driven.times_ns[(driven.times_ns > first) & (driven.times_ns < last)]
    times = np.array([first, *inner, last])
    samples = driven.sample(times / NS_PER_S)
    return JointTrajectory(driven.joint_names, times - first, samples.q, samples.qd, samples.qdd)


def _payload_of(command: Motion | SplineBlock) -> Payload | None:
    return _first_part(command).payload


def _first_part(command: Motion | SplineBlock) -> Motion:
    return command if isinstance(command, Motion) else command.parts[0]


def _is_spline(command: Motion | SplineBlock) -> bool:
    return isinstance(command, SplineBlock) or command.spline


def _is_axis(command: Motion | SplineBlock) -> bool:
    return command.kind == "ptp" if isinstance(command, Motion) else command.axis
