"""Frames of KRL and of the cell: flange, tool, base; targets as poses; status and turn."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ir_description.poses import abc_from_rotation, inverse, rotation_from_abc
from ir_kernels import Chain, portable
from ir_krl import KrlMotionError, SourcePlace
from ir_krl.run import FRAME_NAMES, RAIL_NAME, Effect, Note, Target
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray, IntArray

# Status and turn, S and T: which of the configurations that reach a pose a position means.
#
# S: bit 0 the wrist centre lies behind axis 1, bit 1 the elbow is bent towards positive angles of
# A3, bit 2 A5 is negative. T: bit n is set where the angle of axis n + 1 is negative. Bits of an
# angle that is 0 mean nothing: a position that was taught there may carry either.

_UNDECIDED = 1e-4  # rad or m: nearer to 0 than this, either bit is taken
_TAUGHT = np.radians(0.05)  # rad: a bit of the turn may be wrong by rounding up to this angle


def _signs(chain: Chain, q: FloatArray) -> FloatArray:
    """(N, 9): what the bits are signs of, a set bit is negative: three of the status, six of the
    turn. The status says whether the wrist is before axis 1, how the elbow is bent, and how axis 5.
    """
    base = int(chain.first_slides)
    poses = chain.link_poses(q)[:, base:]
    arm = q[:, base:]
    axes = chain.robot.joint_axis[base:]
    shoulder = poses[:, 2, :3, 3]
    elbow = poses[:, 3, :3, 3]
    wrist = poses[:, 5, :3, 3]
    # in the robot's foot, on a rail where that is now
    from_foot = wrist - poses[:, 0, :3, 3]
    seen = portable.matmul(from_foot[:, None], chain.base_pose[:3, :3])[:, 0]
    turned = arm[:, 0] * axes[0, 2]
    before = portable.cos(turned) * seen[:, 0] + portable.sin(turned) * seen[:, 1]
    axis3 = portable.matmul(poses[:, 3, :3, :3], axes[2])
    across = np.cross(elbow - shoulder, wrist - elbow)
    bent = np.einsum("ni,ni->n", across, axis3)
    return np.column_stack([before, -bent, arm[:, 4], arm])


def status_turn(chain: Chain, q: FloatArray) -> tuple[int, int]:
    """S and T of a configuration q (n,) [rad]."""
    negative = _signs(chain, q[None])[0] < 0.0
    status = negative[:3] * (1 << np.arange(3))
    turn = negative[3:] * (1 << np.arange(len(negative) - 3))
    return int(status.sum()), int(turn.sum())


def meeting(
    chain: Chain,
    q: FloatArray,
    status: int | None,
    turn: int | None,
    *,
    near: float = _UNDECIDED,
) -> BoolArray:
    """Which configurations q (N, n) [rad] have this status and turn; None: any. near: up to which
    angle [rad] of an axis either bit of the turn is taken.
    """
    signs = _signs(chain, q)
    axes = signs.shape[1] - 3
    undecided = np.array([_UNDECIDED] * 3 + [near] * axes)
    wanted = np.concatenate([_bits(status, 3), _bits(turn, axes)])
    agrees = (signs < 0.0) == (wanted == 1)
    return np.asarray((agrees | (np.abs(signs) < undecided) | (wanted < 0)).all(axis=1))


def _bits(value: int | None, count: int) -> IntArray:
    """Bits of a value, lowest first; -1 where there is none."""
    if value is None:
        return np.full(count, -1, dtype=np.int64)
    return (value >> np.arange(count)) & 1


# Between KRL's frames and the cell's: the flange, the tool, where the robot stands, and targets as
# poses.

# KUKA's flange looks along its z axis, this project's along x: a quarter turn about y.
FLANGE = np.array(
    [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
_MM = 1e-3
_WITHIN = 1e-9  # rad beyond a limit that rounding may leave


def tool_in_flange(tcp: FloatArray) -> FloatArray:
    """The tool (4, 4) as TOOL_DATA gives it, of the cell's tcp (4, 4) in the last link."""
    return np.asarray(portable.matmul(inverse(FLANGE), tcp))


def check_rail(scene: PlanningScene) -> None:
    """Raise RequestError for a robot on a rail that KRL would not call E1."""
    rail = scene.cell.robot.rail
    if rail is not None and rail.name != RAIL_NAME:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"the robot is on the rail {rail.name}: programs of controllers move {RAIL_NAME} alone",
        )


@dataclass(frozen=True, eq=False)
class Arm:
    """The robot in its cell, as motions need it; noted: hears what is assumed of a target. Its foot
    is on a rail where E1 is 0. Raises RequestError for a rail that isn't E1.
    """

    scene: PlanningScene
    noted: Callable[[Note], None] = lambda note: None

    def __post_init__(self) -> None:
        check_rail(self.scene)

    def flange(self, q: FloatArray) -> FloatArray:
        """KUKA's flange (N, 4, 4) in the robot's foot, of q (N, n)."""
        chain = self.scene.chain
        return np.asarray(
            portable.matmul(inverse(chain.base_pose), chain.link_poses(q)[:, -1], FLANGE)
        )

    def tcp(self, flange: FloatArray) -> FloatArray:
        """The cell's tcp (N, 4, 4) in the world, of KUKA's flange (N, 4, 4) in the robot's foot."""
        chain = self.scene.chain
        return np.asarray(portable.matmul(chain.base_pose, flange, inverse(FLANGE), chain.tcp))

    def tool_pose(self, target: Target, q: FloatArray) -> FloatArray:
        """Where the target's tool is at q (n,), in the target's base (4, 4)."""
        return np.asarray(self.tool_poses(target, q[None])[0])

    def tool_poses(self, target: Target, q: FloatArray) -> FloatArray:
        """Poses (N, 4, 4) [m] of the tool, as `tool_pose`, at q (N, n)."""
        return target.pose(self.flange(q))

    def pose(self, target: Target, now: FloatArray) -> FloatArray:
        """The target's frame as a pose (4, 4) [m] in its base; what it leaves open is as in `now`
        (4, 4).
        """
        given = target.frame or {}
        xyz = np.array([given.get(name, 0.0) * _MM for name in FRAME_NAMES[:3]])
        abc = np.array([given.get(name, 0.0) for name in FRAME_NAMES[3:]])
        found = np.eye(4)
        if target.relative:
            step = found.copy()
            step[:3, 3] = xyz
            step[:3, :3] = rotation_from_abc(abc)
            if target.in_tool:
                return np.asarray(portable.matmul(now, step))
            found[:3, 3] = now[:3, 3] + xyz
            found[:3, :3] = portable.matmul(step[:3, :3], now[:3, :3])
            return found
        here = abc_from_rotation(now[:3, :3])
        full = [given.get(name, here[k]) for k, name in enumerate(FRAME_NAMES[3:])]
        found[:3, :3] = rotation_from_abc(full)
        found[:3, 3] = [
            given[n] * _MM if n in given else now[k, 3] for k, n in enumerate(FRAME_NAMES[:3])
        ]
        return found

    def status_turn(self, q: FloatArray) -> tuple[int, int]:
        """S and T of a configuration q (n,) [rad]."""
        return status_turn(self.scene.chain, q)

    def configurations(
        self, poses: FloatArray, rails: FloatArray, target: Target
    ) -> list[FloatArray]:
        """All configurations (m, n) within the limits for each tool pose (N, 4, 4) in the target's
        base, with the rail at places (N, 1) [m] of their own; (N, 0) without one.
        """
        tcp = self.tcp(target.flange(poses))
        found = self.scene.inverse_kinematics_along(tcp, rails)
        return [found.of_pose(k) for k in range(len(poses))]

    def reached(self, target: Target, q: FloatArray, place: SourcePlace) -> FloatArray:
        """The configuration (n,) that a PTP from q (n,) to the target ends in. Raises
        KrlMotionError.
        """
        if target.axes is not None:
            end = np.array(q)
            base = self.scene.cell.robot.base
            for name, angle in target.axes.items():
                j = int(name[1:]) - 1 + base
                end[j] = q[j] + angle if target.relative else angle
            end[:base] = target.rail_after(q[:base])
            self.check_limits(end, target, place)
            return end
        pose = self.pose(target, self.tool_pose(target, q))
        rail = self.rail_at(target, q, place)
        found = self.configurations(pose[None], rail[None], target)[0]
        if len(found) == 0:
            raise KrlMotionError(
                f"{_called(target)}{_spelled(pose)} is out of reach: do $BASE and $TOOL fit the "
                "cell?",
                place,
            )
        fits = found[meeting(self.scene.chain, found, target.status, target.turn)]
        if len(fits) == 0:
            rounded = meeting(
                self.scene.chain, found, target.status, target.turn, near=float(_TAUGHT)
            )
            fits = found[rounded]
            if len(fits):
                text = (
                    f"{_called(target)}T {target.turn} asks for the other sign of an axis within "
                    f"{np.degrees(_TAUGHT):g} deg of 0: taken as this side"
                )
                self.noted(Note(place, text, Effect.PLACES))
        if len(fits) == 0:
            alike = found[meeting(self.scene.chain, found, target.status, None)]
            alike = alike if len(alike) else found
            status, turn = self.status_turn(self.nearest(alike, q))
            raise KrlMotionError(
                f"{_called(target)}no configuration within the limits has S {target.status}, T "
                f"{target.turn}: the nearest one has S {status}, T {turn}, write that or teach it",
                place,
            )
        return self.nearest(fits, q)

    def nearest(self, found: FloatArray, q: FloatArray) -> FloatArray:
        """Of configurations (m, n) with the rail at one place that whose largest turn of an axis
        from q (n,) is the least.
        """
        base = self.scene.cell.robot.base
        turns = np.abs(found - q)[:, base:].max(axis=1)
        return np.asarray(found[np.argmin(turns)])

    def rail_at(self, target: Target, q: FloatArray, place: SourcePlace) -> FloatArray:
        """Where (1,) [m] the rail is at a target, from q (n,) on; (0,) without a rail. Raises
        KrlMotionError beyond its travel.
        """
        rail = target.rail_after(q[: self.scene.cell.robot.base])
        self.check_limits(np.append(rail, q[len(rail) :]), target, place)
        return rail

    def check_limits(self, q: FloatArray, target: Target, place: SourcePlace) -> None:
        """Raise KrlMotionError where q (n,), on the way to the target, is beyond a limit."""
        robot = self.scene.cell.robot
        beyond = np.flatnonzero(
            (q < robot.position_min - _WITHIN) | (q > robot.position_max + _WITHIN)
        )
        if len(beyond):
            j = int(beyond[0])
            low = robot.position_min[j]
            high = robot.position_max[j]
            raise KrlMotionError(
                f"{_called(target)}{robot.axis_label(j)} {robot.shown(j, q[j])} is not within "
                f"{robot.shown(j, low).split()[0]} to {robot.shown(j, high)}",
                place,
            )


def _called(target: Target) -> str:
    return f"{target.name}: " if target.name else ""


def _spelled(pose: FloatArray) -> str:
    x, y, z = pose[:3, 3] / _MM
    a, b, c = abc_from_rotation(pose[:3, :3])
    return f"X {x:.1f} Y {y:.1f} Z {z:.1f} mm A {a:.1f} B {b:.1f} C {c:.1f} deg"
