"""Which trajectories of a request are examined at all: others cost hours of proofs, or overflow.

Far beyond what a robot does: a violation of its limits inside these bounds is an answer, not a
refusal.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes
from ir_planner.errors import RequestError
from ir_planner.request.bounds import DURATION_MAX

POINTS_MAX = 10_000
POSITION_MAX = 100.0  # rad
VELOCITY_MAX = 1e4  # rad/s
ACCELERATION_MAX = 1e7  # rad/s^2
TRAVEL_MAX = 10_000.0  # rad, of all joints: of a robot at its limits in half an hour


def examinable(trajectory: JointTrajectory) -> JointTrajectory:
    """The trajectory, where its points and the motion between them are in bounds; else
    RequestError.
    """
    count = len(trajectory.times_ns)
    if count > POINTS_MAX:
        raise _refused(f"the trajectory has {count} points: at most {POINTS_MAX} are taken")
    if trajectory.duration > DURATION_MAX:
        raise _refused(
            f"the trajectory takes {trajectory.duration:g} s: at most {DURATION_MAX:g} s are taken"
        )
    _check(trajectory, "position", trajectory.positions, POSITION_MAX, "rad")
    for what, values, most, unit in (
        ("velocity", trajectory.velocities, VELOCITY_MAX, "rad/s"),
        ("acceleration", trajectory.accelerations, ACCELERATION_MAX, "rad/s^2"),
    ):
        if values is not None:
            _check(trajectory, what, values, most, unit)
    if count > 1:
        _check_between(trajectory)
    return trajectory


def _check_between(trajectory: JointTrajectory) -> None:
    largest = extremes(*trajectory.coefficients())
    beyond = np.maximum(np.abs(largest.lowest), np.abs(largest.highest))
    _check(trajectory, "position between points", beyond, POSITION_MAX, "rad")
    travel = float(largest.travel.sum())
    if not travel <= TRAVEL_MAX:
        raise _refused(
            f"its joints travel {travel:g} rad together: at most {TRAVEL_MAX:g} rad are taken"
        )


def _check(
    trajectory: JointTrajectory, what: str, values: FloatArray, most: float, unit: str
) -> None:
    k, j = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    if not abs(values[k, j]) <= most:
        raise _refused(
            f"{what} of {trajectory.joint_names[j]} at point {k} is {values[k, j]:g} {unit}: "
            f"it must be within {most:g} {unit}"
        )


def _refused(sentence: str) -> RequestError:
    return RequestError(StatusCode.INVALID_MOTION_PLAN, sentence)
