"""Execution of a KRL program as on a KR C4: movements between standstills, waits, outputs."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace

import numpy as np

from ir_krl import (
    Blend,
    Command,
    Followed,
    KrlMotionError,
    Motion,
    Note,
    Payload,
    Place,
    SetOutput,
    Speeds,
    SplineBlock,
    Stop,
    Target,
    Wait,
    WaitFor,
)
from ir_msgs_py.plc import Signal
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.krl.geometry import Arm
from ir_planner.krl.motions import AxisLine, Curve, Move, move, overlap, tool_curve, trajectory
from ir_planner.krl.splines import ToolMotion, block_curve, timed_block, tool_motion, tool_spline
from ir_planner.krl.surroundings import Surroundings, nothing_around
from ir_planner.scene import STILL, PlanningScene
from ir_planner.timing import standing
from ir_values.arrays import FloatArray

# Which motions of a program are its process: what the tool does between switching an output on and
# off.


def process_motions(commands: Sequence[Command]) -> frozenset[int]:
    """Places in `commands` of the motions of a process.

    A process begins where an output is switched on and ends where the same one is switched off, and
    only the tool is led meanwhile (LIN, CIRC, SPLINE and their relatives; waits don't matter). A
    PTP ends it: what is switched around one is a gripper or a message. A pulse switches nothing.
    """
    found: set[int] = set()
    since: dict[int, set[int]] = {}  # by output: motions since it was switched on
    for k, command in enumerate(commands):
        match command:
            case SetOutput(value=True, pulse=0.0):
                since.setdefault(command.number, set())
            case SetOutput(value=False):
                found |= since.pop(command.number, set())
            case Motion(kind="ptp") | SplineBlock(axis=True):
                since.clear()
            case Motion() | SplineBlock():
                for motions in since.values():
                    motions.add(k)
    return frozenset(found)


def _target_of(command: Motion | SplineBlock) -> Target:
    return command.target if isinstance(command, Motion) else command.parts[-1].target


# A KRL program as a KR C4 drives it: a trajectory from one standstill to the next, waits,
# outputs.

_BLENDED_JERK = 0.5  # of the limit: while two moves overlap their jerks add up


@dataclass(frozen=True, eq=False)
class DrivenStep:
    """One step from standstill to standstill: a movement, or a wait.

    places: of its motions in the program; outputs: set at its end, number and value; waits_for: a
    condition that ends a wait; tool: for each motion what the tool draws, None for a PTP and where
    no segment describes it; process: places of the motions that belong to a process. scene: in
    which it is driven; handled: the part that is taken ("+gear") or left ("-gear") at its end;
    awaited, signals: of the cell, that it waits for and that are set at its end.
    """

    trajectory: JointTrajectory
    moves: bool
    places: tuple[Place, ...]
    outputs: tuple[tuple[int, bool], ...] = ()
    waits_for: str = ""
    tool: tuple[ToolMotion | None, ...] = ()
    process: tuple[Place, ...] = ()
    handled: str = ""
    awaited: tuple[Signal, ...] = ()
    signals: tuple[Signal, ...] = ()
    _: KW_ONLY
    scene: PlanningScene


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
    for k, command in enumerate(program.commands):
        run.working = k in process
        run.take(command)
    run.finish()
    return tuple(run.steps), (*run.notes, *around.notes)


@dataclass
class _Drive:
    """Where the robot stands (n,), and the motions that are being driven through."""

    around: Surroundings
    here: FloatArray
    notes: list[Note]
    steps: list[DrivenStep] = field(default_factory=list)
    _moves: list[Move] = field(default_factory=list)
    _overlaps: list[int] = field(default_factory=list)
    _places: list[Place] = field(default_factory=list)
    _outputs: list[SetOutput] = field(default_factory=list)  # set while the robot moves
    _tool: list[ToolMotion | None] = field(default_factory=list)
    _process: list[Place] = field(default_factory=list)
    working: bool = False  # the command belongs to a process
    _on_path: bool = False  # the first motion has led to the programmed path
    _blend: Blend | None = None  # of the last motion; None: it ends at rest
    _payload: Payload | None = None  # of the last motion

    def __post_init__(self) -> None:
        self._among(self.around.scene(None, Place()))

    def _carry(self, payload: Payload | None, place: Place) -> None:
        """What a motion from rest carries; one that is blended goes on with the load before."""
        if not self._moves:
            self._payload = payload
            self._among(self.around.scene(payload, place))

    def _among(self, scene: PlanningScene) -> None:
        """Drive in this scene from here on."""
        self.scene = scene
        self.arm = Arm(scene)

    def take(self, command: Command) -> None:
        """Drive one command."""
        match command:
            case Motion():
                self._carry(command.payload, command.place)
                self._motion(command)
            case SplineBlock():
                self._carry(command.parts[0].payload, command.place)
                self._block(command)
            case SetOutput() if command.on_path and self._moves:
                self._outputs.append(command)
            case SetOutput():
                self.finish()
                self._set(command)
            case Wait():
                self.finish()
                self._stand(command.seconds, command.place, "")
                self.around.stood(command.seconds)
            case Stop():
                self.finish()
            case WaitFor():
                self.finish()
                self._stand(0.0, command.place, command.condition)
                signals = self.around.awaited(command.condition)
                self.steps[-1] = replace(self.steps[-1], awaited=signals)

    def finish(self) -> None:
        """Come to rest: what is being driven through becomes a step."""
        if not self._moves:
            return
        names = self.scene.cell.robot.joint_names
        self._step(trajectory(self._moves, self._overlaps, names), tuple(self._places), moves=True)
        self.steps[-1] = replace(
            self.steps[-1],
            tool=tuple(self._tool),
            process=tuple(self._process),
        )
        self._moves = []
        self._overlaps = []
        self._places = []
        self._blend = None
        for output in self._outputs:
            self._set(output)
        self._outputs = []
        self._tool = []
        self._process = []

    def _set(self, command: SetOutput) -> None:
        """An output is set at the end of the last step, where the robot stands."""
        if not self.steps and self._on_path:
            self._stand(0.0, command.place, "")
        signals = self.around.signalled(command.number, command.value)
        handled = self.around.gripped(command.number, command.value, self.here, command.place)
        if handled:  # until a motion says what $LOAD is then
            self._payload = None
        before = self.steps[-1].handled if self.steps else ""
        if handled and before and handled[1:] != before[1:]:  # another part at the same stop
            self._stand(0.0, command.place, "")
        elif handled and before:  # left and taken again
            self.steps[-1] = replace(self.steps[-1], handled="")
            handled = ""
        if self.steps:
            last = self.steps[-1]
            outputs = (*last.outputs, (command.number, command.value))
            self.steps[-1] = replace(
                last,
                outputs=outputs,
                handled=handled or last.handled,
                signals=(*last.signals, *signals),
            )

    def _motion(self, motion: Motion) -> None:
        if not self._on_path:
            if motion.kind != "ptp":
                raise KrlMotionError(
                    "the first motion must be a PTP: where does the robot stand before?",
                    motion.place,
                )
            self.here = self.arm.reached(motion.target, self.here, motion.place)
            self._on_path = True
            return
        if motion.kind == "ptp":
            end = self.arm.reached(motion.target, self.here, motion.place)
            if np.abs(end - self.here).max() < STILL:
                return
            curve = AxisLine(self.here, end)
            self._drive(curve, motion, motion.speeds, None)
        else:
            line = tool_curve(motion, self.here, self.arm)
            if max(line.length, line.turning) < STILL:
                return
            self._drive(line, motion, motion.speeds, tool_motion(motion, self.here, self.arm))

    def _block(self, block: SplineBlock) -> None:
        if not self._on_path:
            raise KrlMotionError(
                "the first motion must be a PTP: where does the robot stand before?", block.place
            )
        driven = timed_block(block, self.here, self.arm)
        if driven is not None:
            self.finish()
            self.here = driven.positions[-1]
            self._step(driven, (block.place,), moves=True)
            return
        curve = block_curve(block, self.here, self.arm)
        if any(part.speeds != block.parts[0].speeds for part in block.parts):
            self.notes.append(
                Note(block.place, "parts have speeds of their own: driven as its first part")
            )
        least = sum(one.seconds for one in block.times) / block.parts[0].speeds.override
        drawn = None if block.axis else tool_spline(block, self.here, self.arm)
        self._drive(curve, block, block.parts[0].speeds, drawn, least)

    def _drive(
        self,
        curve: Curve,
        command: Motion | SplineBlock,
        speeds: Speeds,
        drawn: ToolMotion | None,
        least: float = 0.0,
    ) -> None:
        share = 1.0 if self._blend is None and command.blend is None else _BLENDED_JERK
        made = move(curve, speeds, self.scene, command.place, least=least, jerk_share=share)
        made = replace(made, tool=_target_of(command).tool)
        if self._moves and self._blend is not None:
            steps = overlap(self._moves[-1], made, self._blend, self.arm)
            if steps > 0:
                self._overlaps.append(steps)
            else:
                self.finish()
        self._moves.append(made)
        self._places.append(command.place)
        self._tool.append(drawn)
        self._process += [command.place] if self.working else []
        self._blend = command.blend
        self.here = made.at(np.array([made.law.total]))[0][0]
        if self._blend is None:
            self.finish()

    def _stand(self, seconds: float, place: Place, condition: str) -> None:
        names = self.scene.cell.robot.joint_names
        self._step(standing(self.here, names, seconds), (place,), moves=False, waits_for=condition)

    def _step(
        self,
        driven: JointTrajectory,
        places: tuple[Place, ...],
        *,
        moves: bool,
        waits_for: str = "",
    ) -> None:
        if not self._moves:
            self._among(self.around.scene(self._payload, places[0]))
        self.steps.append(DrivenStep(driven, moves, places, (), waits_for, scene=self.scene))
