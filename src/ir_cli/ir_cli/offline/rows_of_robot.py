"""Measured positions held against the robot: turns that a log doesn't count, rows that it can't
have driven.

A wrong unit, a row that is missing in the middle of a movement or a log of another robot would
otherwise be a movement of absurd energy, and the planner's would save 99 % of it.
"""

from __future__ import annotations

import numpy as np

from ir_description import RobotModel
from ir_msgs_py.arrays import FloatArray

from ..errors import InputError

_TURN = 2.0 * np.pi
# times its speed limit: no encoder's noise or clock's jitter at the rate of a log does this
_FASTER = 3.0
_NOISE = 0.002  # rad: coarser than any log is rounded
_BEYOND = (
    np.pi
)  # rad outside of its range that a joint may be: what is more was never measured there


def counted_turns(
    source: str, time: FloatArray, positions: FloatArray, robot: RobotModel
) -> tuple[FloatArray, tuple[str, ...]]:
    """Positions (N, n) [rad] without jumps by whole turns, which logs make that are written within
    half a turn, and a sentence for each joint that had some.

    InputError where a joint moves faster between two rows than it can, or is far outside of its
    range.
    """
    turns = np.round(np.diff(positions, axis=0) / _TURN)
    unwrapped = positions.copy()
    unwrapped[1:] -= _TURN * np.cumsum(turns, axis=0)
    _check_speeds(source, time, unwrapped, robot)
    notes = []
    for j in np.flatnonzero(turns.any(axis=0)):
        unwrapped[:, j] += _shift(unwrapped[:, j], robot.position_min[j], robot.position_max[j])
        notes.append(f"{robot.joint_names[j]} jumps by whole turns in the file: taken as going on")
    check_ranges(source, unwrapped, robot)
    return unwrapped, tuple(notes)


def check_ranges(source: str, positions: FloatArray, robot: RobotModel) -> None:
    """InputError where a position (N, n) [rad] is farther outside of a joint's range than half a
    turn.
    """
    beyond = np.maximum(robot.position_min - positions, positions - robot.position_max)
    row, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[row, j] > _BEYOND:
        low, high = np.degrees((robot.position_min[j], robot.position_max[j]))
        raise InputError(
            f"{source}: {robot.joint_names[j]} is at {np.degrees(positions[row, j]):.0f} deg, "
            f"its range is {low:.0f} to {high:.0f} deg: are its unit and the robot right? Values "
            "without a unit are rad"
        )


def _check_speeds(source: str, time: FloatArray, positions: FloatArray, robot: RobotModel) -> None:
    steps = np.diff(time)
    steps = np.maximum(steps, np.median(steps))
    moved = np.abs(np.diff(positions, axis=0))
    share = (moved - _NOISE) / (steps[:, None] * robot.velocity_max)
    row, j = np.unravel_index(int(np.argmax(share)), share.shape)
    if share[row, j] > _FASTER:
        raise InputError(
            f"{source}: {robot.joint_names[j]} moves by {np.degrees(moved[row, j]):.3g} deg "
            f"between {time[row]:.3f} s and {time[row + 1]:.3f} s, {share[row, j]:.0f} times as "
            "fast as it can: are the units, the rows and the robot right? Values without a unit "
            "are rad and s"
        )


def _shift(values: FloatArray, low: float, high: float) -> float:
    """Whole turns [rad] that bring values (N,) into low .. high; 0 where they are there, or none
    do.
    """
    for turns in (0, -1, 1):
        if low <= values.min() + _TURN * turns and values.max() + _TURN * turns <= high:
            return _TURN * turns
    return 0.0
