"""Stamps, float arrays and configurations of joints, to and from messages."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from sensor_msgs.msg import JointState

from ir_msgs.msg import Status as StatusMsg
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.checks import one_line, read_only
from ir_msgs_py.errors import InvalidValueError, JointNamesError
from ir_msgs_py.status import Status

NS_PER_S = 1_000_000_000


def float_array(values: FloatArray) -> array[float]:
    """Values (n,) as a float64[] field takes them without looking at each element."""
    return array("d", values.tobytes())


def time_to_msg(stamp_ns: int) -> Time:
    """Node clock [ns] as a stamp."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return Time(sec=seconds, nanosec=nanoseconds)


def time_from_msg(msg: Time) -> int:
    """Stamp as node clock [ns]."""
    return int(msg.sec) * NS_PER_S + int(msg.nanosec)


def point_to_msg(point: FloatArray) -> Point:
    """Point (3,) [m]."""
    x, y, z = (float(value) for value in point)
    return Point(x=x, y=y, z=z)


def point_from_msg(msg: Point) -> FloatArray:
    """Point (3,) [m], finite."""
    return read_only([msg.x, msg.y, msg.z], "point", (3,))


def status_to_msg(status: Status) -> StatusMsg:
    """Outcome of a request; its sentence bounded and without control characters."""
    return StatusMsg(code=int(status.code), message=one_line(status.message), source=status.source)


def status_from_msg(msg: StatusMsg) -> Status:
    """Outcome of a request."""
    return Status(int(msg.code), msg.message, msg.source)


def configuration_to_msg(
    joint_names: Sequence[str], q: FloatArray, stamp_ns: int = 0
) -> JointState:
    """Joint values q (n,) [rad] with their names."""
    msg = JointState(name=list(joint_names), position=float_array(q))
    msg.header.stamp = time_to_msg(stamp_ns)
    return msg


def configuration_given(msg: JointState) -> bool:
    """Whether a request names a configuration at all: an empty one means the node's default."""
    return bool(msg.name or msg.position)


def configuration_from_msg(msg: JointState, joint_names: Sequence[str]) -> FloatArray:
    """Joint values (n,) [rad] in the order of joint_names; names may be missing (then that order is
    meant).

    Raises JointNamesError for foreign, missing or double names, InvalidValueError for the values.
    """
    names = _checked_names(msg, joint_names)
    if len(msg.position) != len(names):
        raise InvalidValueError(
            f"position has {len(msg.position)} values: {len(names)} joints need as many"
        )
    return _in_order(msg.position, "position", names, joint_names)


def velocity_from_msg(msg: JointState, joint_names: Sequence[str]) -> FloatArray | None:
    """Joint velocities (n,) [rad/s] in the order of joint_names, None where the message has none.

    Raises as configuration_from_msg.
    """
    names = _checked_names(msg, joint_names)
    if not msg.velocity:
        return None
    if len(msg.velocity) != len(names):
        raise InvalidValueError(
            f"velocity has {len(msg.velocity)} values: it must have none or as many as "
            f"{len(names)} joints"
        )
    return _in_order(msg.velocity, "velocity", names, joint_names)


def _checked_names(msg: JointState, joint_names: Sequence[str]) -> list[str]:
    """The joints of a message, each expected one once; those of joint_names where it names none."""
    expected = list(joint_names)
    names = list(msg.name) or expected
    known = ", ".join(expected)
    if len(names) != len(set(names)):
        raise JointNamesError(f"a joint is named more than once: expected are {known}")
    for name in names:
        if name not in expected:
            raise JointNamesError(f"unknown joint {name[:80]!r}: expected are {known}")
    for name in expected:
        if name not in names:
            raise JointNamesError(f"joint {name!r} is missing: expected are {known}")
    return names


def _in_order(
    values: Sequence[float], what: str, names: list[str], joint_names: Sequence[str]
) -> FloatArray:
    """Finite values of `names` in the order of joint_names."""
    finite = read_only(values, what, (len(names),))
    return read_only(finite[[names.index(name) for name in joint_names]], what, (len(names),))
