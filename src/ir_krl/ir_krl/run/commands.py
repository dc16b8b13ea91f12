"""Commands of a program to the controller, in their order: motions, waits, outputs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from ir_kernels import portable
from ir_krl.errors import SourcePlace
from ir_krl.run.system import AXES
from ir_values.arrays import FloatArray

Kind = Literal["ptp", "lin", "circ", "spl"]


def _inverse(pose: FloatArray) -> FloatArray:
    """The inverses of poses (..., 4, 4)."""
    turned = np.swapaxes(pose[..., :3, :3], -1, -2)
    found = np.zeros_like(pose)
    found[..., :3, :3] = turned
    found[..., :3, 3] = -(turned * pose[..., None, :3, 3]).sum(axis=-1)
    found[..., 3, 3] = 1.0
    return found


@dataclass(frozen=True, eq=False)
class Target:
    """Where a motion goes: axis angles [rad] or components of a frame [m, rad as written in
    degrees].

    axes: A1..A6 [rad], those that are given; None for a frame. frame: X, Y, Z [mm], A, B, C [deg],
    those that are given: the rest stays as it is. status, turn: S and T, None where not given.
    relative: from where the robot stands; in_tool: in the directions of the tool instead of the
    base's. base, tool: poses (4, 4) [m] of $BASE in the robot's foot and of $TOOL at the flange.
    external: the tool stands in the cell, at $BASE, and $TOOL is the workpiece at the flange
    ($IPO_MODE #TCP): the frame is that of the tool in the workpiece. rail: E1 [m] of a robot on a
    rail, whose foot is then where E1 is 0; None: it stays.
    """

    axes: dict[str, float] | None
    frame: dict[str, float] | None
    status: int | None
    turn: int | None
    relative: bool
    in_tool: bool
    base: FloatArray
    tool: FloatArray
    name: str = ""
    external: bool = False
    rail: float | None = None

    def rail_after(self, now: FloatArray) -> FloatArray:
        """Where (1,) [m] a rail is at the target, from `now` (1,) on; (0,) without a rail."""
        if self.rail is None:
            return now
        return now + self.rail if self.relative else np.full_like(now, self.rail)

    def flange(self, pose: FloatArray) -> FloatArray:
        """The flange (..., 4, 4) [m] in the robot's foot where the tool is at `pose` (..., 4, 4) in
        the base, or in the workpiece.
        """
        led = _inverse(pose) if self.external else pose
        return np.asarray(portable.matmul(self.base, led, _inverse(self.tool)))

    def pose(self, flange: FloatArray) -> FloatArray:
        """The tool (..., 4, 4) [m] in the base, or in the workpiece, where the flange is at
        (..., 4, 4) in the robot's foot.
        """
        if self.external:
            return np.asarray(
                portable.matmul(_inverse(portable.matmul(flange, self.tool)), self.base)
            )
        return np.asarray(portable.matmul(_inverse(self.base), flange, self.tool))


@dataclass(frozen=True)
class Speeds:
    """How fast: shares (6,) of the axes' speeds and accelerations; velocity [m/s] and acceleration
    [m/s^2] of the tool, turning [rad/s] and turning_acceleration [rad/s^2] of its orientation;
    override: share of all speeds. external_velocity, external_acceleration: shares of those of a
    rail. jerk [m/s^3], turning_jerk [rad/s^3] of the tool and axis_jerk,
    shares (6,) of the axes' jerk, bound motions of the spline kind alone.
    """

    axis_velocity: tuple[float, ...]
    axis_acceleration: tuple[float, ...]
    velocity: float
    acceleration: float
    turning: float
    turning_acceleration: float
    override: float
    jerk: float = math.inf
    turning_jerk: float = math.inf
    axis_jerk: tuple[float, ...] = (1.0,) * AXES
    external_velocity: float = 1.0
    external_acceleration: float = 1.0


@dataclass(frozen=True)
class Blend:
    """Approximate positioning: how (C_PTP, C_DIS, C_VEL, C_ORI, C_SPL), within `distance` [m] of
    the tool to the corner, inf where none bounds it, and `share` of half of each motion. onto: what
    holds instead for a motion of the tool that follows an axis motion.
    """

    how: str
    distance: float
    share: float
    onto: Blend | None = None


@dataclass(frozen=True)
class Payload:
    """What $LOAD says is carried: mass [kg], below 0 "as the machine data have it"; centre of mass
    [m] and the angles A, B, C [deg] of the axes of inertia in the flange, inertia about them
    [kg m^2].
    """

    mass: float
    centre: tuple[float, float, float]
    angles: tuple[float, float, float]
    inertia: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Motion:
    """One motion to `target`; circles pass `via` and end after `angle` [rad] where one is given.
    keeps_orientation: the tool doesn't turn, whatever the target says ($ORI_TYPE #CONSTANT).
    payload: None where the program never says what is carried. spline: of the spline kind (SPTP,
    SLIN, SCIRC, SPL), which a controller never rounds a corner to from PTP, LIN and CIRC.
    """

    kind: Kind
    target: Target
    speeds: Speeds
    place: SourcePlace
    blend: Blend | None = None
    via: Target | None = None
    angle: float | None = None
    keeps_orientation: bool = False
    payload: Payload | None = None
    spline: bool = False


@dataclass(frozen=True)
class TimeBlock:
    """Parts of a spline from `first` to before `last` take `seconds`; marks: before which part how
    many per cent of them have passed since the mark before.
    """

    first: int
    last: int
    marks: tuple[tuple[int, float], ...]
    seconds: float
    place: SourcePlace


@dataclass(frozen=True, eq=False)
class SplineBlock:
    """SPLINE (tool path) or PTP_SPLINE (axis path): parts that are driven through without a
    stop.
    """

    axis: bool
    parts: tuple[Motion, ...]
    times: tuple[TimeBlock, ...]
    place: SourcePlace
    blend: Blend | None = None


@dataclass(frozen=True)
class StandStill:
    """The robot stands still for `seconds`."""

    seconds: float
    place: SourcePlace


@dataclass(frozen=True)
class WaitForCondition:
    """The robot stands still until `condition` (as the program writes it) holds."""

    condition: str
    place: SourcePlace


@dataclass(frozen=True)
class AdvanceStop:
    """The advance run stops at `place`, for what `why` names: the motion before ends at rest,
    whatever it says of approximate positioning.
    """

    why: str
    place: SourcePlace


@dataclass(frozen=True)
class Switch:
    """When a TRIGGER acts: at the end of part `part` of its motion (-1: of the last one;
    from_start: at its start), or `path` [m] of the tool's path after that place (None: WHEN
    DISTANCE), `delay` [s] later, and `waited` [s] that the routine which it calls has waited.
    ahead: its motion is the next one among the commands, else the one before.
    """

    ahead: bool
    from_start: bool
    path: float | None
    delay: float
    part: int = 0
    waited: float = 0.0


END_OF_LAST = Switch(ahead=False, from_start=False, path=None, delay=0.0, part=-1)
"""The end of the motion before, in a rounded corner the middle of the rounding."""


@dataclass(frozen=True)
class SetOutput:
    """A digital output is set; `pulse` [s] later it goes back, 0 = it stays. on_path: while the
    robot moves (by a TRIGGER, after CONTINUE, or as $OUT_C), so that it needn't stop. switch: when
    a TRIGGER sets it, or just when the motion before ends.
    """

    number: int
    value: bool
    place: SourcePlace
    pulse: float = 0.0
    on_path: bool = False
    switch: Switch | None = None


Command: TypeAlias = Motion | SplineBlock | StandStill | WaitForCondition | SetOutput | AdvanceStop
