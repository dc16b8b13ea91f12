"""Goals as people type them: a station, a posture, joint values in degrees, or a pose of the tcp.

"lathe" | "park" | "home" | "A1 0 A2 -90 A3 90 A4 0 A5 0 A6 0" | "X 1.8 Y 0 Z 1.2 A 0 B 90 C 0" (m
and degrees, KUKA's A, B, C: Z-Y'-X''). A robot on a rail takes "E1 2.5" [m] too: among its axes,
and behind a pose or a station, where it says at which place of the rail; without it the planner
chooses.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ir_description import Cell, RobotModel
from ir_description.poses import rotation_from_abc
from ir_description.robot import LIMIT_TOLERANCE, OUTSIDE_MAX
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory, MotionSamples
from ir_planner.errors import RequestError, unfit, unknown_name
from ir_values.argument_types import typed, typed_methods
from ir_values.arrays import FloatArray

POSTURES = ("home", "park")
_POSE_KEYS = ("X", "Y", "Z", "A", "B", "C")
_WORDS = re.compile(r"[A-Za-z]+\d*|\S+")
_TEXT_MAX = 300
_LENGTH_MAX = 100.0  # m
_NO_ANGLE = 1e6  # rad


@typed_methods(unfit)
@dataclass(frozen=True, eq=False)
class Goal:
    """Exactly one of configuration (n,) rad and pose (4, 4) of the tcp in the cell; station: its
    name, "" for none. rail: where [m] the rail is at the pose; None: anywhere.
    """

    configuration: FloatArray | None = None
    pose: FloatArray | None = None
    station: str = ""
    text: str = ""
    rail: float | None = None


def one_goal(
    text: str,
    configuration: FloatArray | None,
    pose: FloatArray | None,
    cell: Cell,
    forms: tuple[str, ...] = ("goal", "goal_state", "goal_pose"),
) -> Goal:
    """The goal that a request gives in exactly one form: text, configuration (n,), pose (4, 4).
    Raises RequestError for none or several.
    """
    filled = {
        "goal": bool(text),
        "goal_state": configuration is not None,
        "goal_pose": pose is not None,
    }
    given = [name for name, there in filled.items() if there]
    if len(given) != 1:
        which = " and ".join(given) or "none (a goal_pose without a frame_id is not given)"
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"exactly one of {', '.join(forms[:-1])} and {forms[-1]} must be given, it is {which}",
        )
    if text:
        return parse_goal(text, cell)
    if configuration is not None:
        return Goal(
            configuration=within_limits(configuration, cell, "goal", StatusCode.GOAL_STATE_INVALID)
        )
    return Goal(pose=pose)


class _Asked(NamedTuple):
    """What a text is given for: its name in sentences, the code where it can't be read, and the
    code where its values lie beyond limits.
    """

    what: str
    unreadable: StatusCode
    beyond: StatusCode

    @classmethod
    def of(cls, what: str, code: StatusCode) -> "_Asked":
        """MoveIt has a code of its own for a goal that can't be read, and none for a start."""
        is_goal = code == StatusCode.GOAL_STATE_INVALID
        return cls(what, StatusCode.INVALID_GOAL_CONSTRAINTS if is_goal else code, code)


@typed(unfit)
def parse_goal(
    text: str, cell: Cell, what: str = "goal", code: StatusCode = StatusCode.GOAL_STATE_INVALID
) -> Goal:
    """The goal of a text, or a start, a state: `what`, its name in the sentence, and `code`, that
    of values beyond limits. Raises RequestError: what is wrong, and what may stand there.
    """
    asked = _Asked.of(what, code)
    stripped = text.strip()
    if len(stripped) > _TEXT_MAX or not stripped.isprintable():
        raise RequestError(
            asked.unreadable,
            f"{what} has {len(text)} characters: it must be one line of 1 to {_TEXT_MAX}",
        )
    stripped, rail = _with_rail(stripped, cell, asked)
    for station in cell.stations:
        if station.name == stripped:
            return Goal(pose=station.pose, station=station.name, text=stripped, rail=rail)
    if stripped.lower() in POSTURES:
        return Goal(configuration=cell.posture(stripped.lower()), text=stripped.lower())
    joints = joints_of(stripped, cell, what, code)
    if joints is not None:
        return Goal(configuration=within_limits(joints, cell, what, code), text=stripped)
    keys, values = _pairs(stripped)
    if values and keys[0] in _POSE_KEYS:
        pose = _pose(_numbers(keys, values, dict.fromkeys(_POSE_KEYS, ""), asked), asked)
        return Goal(pose=pose, text=stripped, rail=rail)
    texts = ('"A1 0 A2 -90 ..." in degrees', '"X 1.8 Y 0 Z 1.2 A 0 B 90 C 0"')
    raise unknown_name(what, stripped, [*(s.name for s in cell.stations), *POSTURES, *texts])


def joints_of(text: str, cell: Cell, what: str, code: StatusCode) -> FloatArray | None:
    """Joint values (n,) rad of a text in degrees, wherever they lie; None: it is something else.
    Raises RequestError, as parse_goal with this `what` and `code`.
    """
    robot = cell.robot
    units = {robot.axis_label(i).upper(): robot.unit(i) for i in range(robot.n)}
    keys, values = _pairs(text)
    if not values or keys[0] not in units:
        return None
    return robot.from_people_units(np.array(_numbers(keys, values, units, _Asked.of(what, code))))


def _with_rail(text: str, cell: Cell, asked: _Asked) -> tuple[str, float | None]:
    """A text without "E1 2.5" at its end, and that place [m] of the rail; None: it gives none."""
    robot = cell.robot
    words = text.split()
    if robot.rail is None or len(words) < 3 or words[-2].upper() != robot.rail.name.upper():
        return text, None
    label = robot.rail.name
    place = _numbers([label], words[-1:], {label: "m"}, asked)[0]
    if not robot.rail.low <= place <= robot.rail.high:
        raise RequestError(
            asked.beyond,
            f"{asked.what}: {label} is {place:g} m: it must be in [{robot.rail.low:g}, "
            f"{robot.rail.high:g}] m",
        )
    return " ".join(words[:-2]), place


def _pairs(text: str) -> tuple[list[str], list[str]]:
    """The keys of a text "A1 10 A2 20" in capitals, and what stands behind each."""
    words = _WORDS.findall(text.replace(",", " ").replace("=", " "))
    return [word.upper() for word in words[::2]], words[1::2]


def _pose(values: list[float], asked: _Asked) -> FloatArray:
    """Pose (4, 4) of X, Y, Z [m] and A, B, C [deg] within the workspace; else RequestError."""
    x, y, z, *abc = values
    if max(abs(x), abs(y), abs(z)) > _LENGTH_MAX:
        raise RequestError(
            asked.unreadable,
            f"{asked.what} lies at ({x:g}, {y:g}, {z:g}) m: X, Y and Z must be in "
            f"[-{_LENGTH_MAX:g}, {_LENGTH_MAX:g}] m",
        )
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_abc(abc)
    pose[:3, 3] = x, y, z
    return pose


def joint_values(q: ArrayLike, shape: tuple[int, ...], what: str, code: StatusCode) -> FloatArray:
    """Numbers of this shape. Raises RequestError with this code, which names `what`."""
    try:
        values = np.asarray(q, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RequestError(code, f"{what} has values that are no numbers: {error}") from error
    if values.shape != shape:
        raise RequestError(code, f"{what} has shape {values.shape}: it must be {shape}")
    return values


def within_limits(q: ArrayLike, cell: Cell, what: str, code: StatusCode) -> FloatArray:
    """Joint values (n,) rad within the robot's limits; those at most LIMIT_TOLERANCE beyond one are
    at it. RequestError with joint, value, bounds and excess in degrees for others, and for what are
    no n numbers.
    """
    robot = cell.robot
    q = joint_values(q, (robot.n,), what, code)
    for i, value in enumerate(q):
        low = float(robot.position_min[i])
        high = float(robot.position_max[i])
        if not math.isfinite(value):
            raise RequestError(
                code, f"{what}: {robot.joint_names[i]} is {value}: it must be finite"
            )
        excess = max(float(value) - high, low - float(value))
        if excess > LIMIT_TOLERANCE:
            raise RequestError(
                code,
                f"{what}: {robot.joint_names[i]} is {_shown(value, i, robot)}: it must be in "
                f"{robot.shown_range(i)}, exceeded by {_shown(excess, i, robot)}"
                f"{_hint(code, excess)}",
            )
    return np.clip(q, robot.position_min, robot.position_max)


def _hint(code: StatusCode, excess: float) -> str:
    """What helps a start that is `excess` rad beyond a limit."""
    if code != StatusCode.START_STATE_INVALID or excess > OUTSIDE_MAX:
        return ""
    return "; plan_escape (ir ask escape) leads back"


def _shown(value: float, i: int, robot: RobotModel) -> str:
    """A value of joint i with its unit: metres of a rail; an angle [rad] in degrees, or as it came
    where that is no angle any more.
    """
    if i < robot.base:
        return robot.shown(i, float(value))
    return f"{math.degrees(value):g} deg" if abs(value) < _NO_ANGLE else f"{value:g} rad"


def _numbers(
    keys: list[str], values: list[str], expected: Mapping[str, str], asked: _Asked
) -> list[float]:
    """Numbers in the order of `expected`, which has the unit of each; every key once."""
    if sorted(keys) != sorted(expected) or len(values) != len(keys):
        raise RequestError(
            asked.unreadable,
            f"{asked.what} names {' '.join(keys)[:80]}: it must give each of "
            f"{' '.join(expected)} once, with a number",
        )
    numbers: dict[str, float] = {}
    for key, value in zip(keys, values, strict=True):
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            needed = f"a finite number {expected[key]}".rstrip()
            raise RequestError(
                asked.unreadable,
                f"{asked.what}: {key} is {value[:20]!a}: it must be {needed}",
            )
        numbers[key] = number
    return [numbers[key] for key in expected]


def motion_of(
    start: tuple[ArrayLike | None, ArrayLike | None],
    goal: tuple[ArrayLike | None, ArrayLike | None],
    end: Goal,
    cell: Cell,
) -> FloatArray | None:
    """qd, qdd (2, 2, n) at start and goal of a movement, given as two (n,) each, None: 0; None
    where both rest. Raises RequestError.
    """
    motion = np.zeros((2, 2, cell.robot.n))
    given = {
        "start_velocity": (start[0], motion[0, 0], StatusCode.START_STATE_INVALID),
        "start_acceleration": (start[1], motion[0, 1], StatusCode.START_STATE_INVALID),
        "goal_velocity": (goal[0], motion[1, 0], StatusCode.GOAL_STATE_INVALID),
        "goal_acceleration": (goal[1], motion[1, 1], StatusCode.GOAL_STATE_INVALID),
    }
    for what, (values, place, code) in given.items():
        if values is None:
            continue
        place[:] = joint_values(values, (cell.robot.n,), what, code)
        if not np.isfinite(place).all():
            raise RequestError(code, f"{what} is {values}: it must be finite")
    if motion[1].any() and end.configuration is None:
        raise RequestError(
            StatusCode.GOAL_STATE_INVALID,
            "a pose is reached at rest: give joint values for a goal in motion",
        )
    return motion if motion.any() else None


def motion_on(trajectory: JointTrajectory, at: float, cell: Cell) -> MotionSamples:
    """Motion (1, n) at the time `at` [s], to a nanosecond, of a trajectory in the robot's joint
    order. Raises RequestError where it lasts not as long.
    """
    own = trajectory.reordered(cell.robot.joint_names)
    begin = float(own.times[0])
    if not begin <= at <= own.duration:
        raise RequestError(
            StatusCode.START_STATE_INVALID,
            f"at is {at:g} s: the trajectory lasts from {begin:g} to {own.duration:g} s",
        )
    return own.until(at).last
