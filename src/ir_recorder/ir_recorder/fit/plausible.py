"""Data that no parameters explain are refused: units that are not what they are taken for, another
robot.
"""

from __future__ import annotations

import numpy as np

from ir_description import RobotModel
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_recorder.errors import FitError
from ir_recorder.traces import Trace

MOST_UNEXPLAINED = 0.5  # of the mean power: plants that are fitted leave a tenth at most
_BEYOND = 0.2  # rad outside a joint's range: referencing and a worn stop are less
_FEWEST = 20  # windows
_SELDOM = 0.25  # s: within it an axis is accelerated and braked again


def check_explained(measured: FloatArray, fitted: FloatArray, moving: BoolArray) -> None:
    """FitError where the fitted power (W,) [W] stays so far from the measured that the data can't
    be those of the model.
    """
    for rows, what in ((~moving, "at rest"), (moving, "in motion")):
        if np.count_nonzero(rows) < _FEWEST:
            continue
        mean = float(measured[rows].mean())
        off = float(np.sqrt(np.mean((measured - fitted)[rows] ** 2)))
        if off > MOST_UNEXPLAINED * max(mean, 0.0):
            raise FitError(
                f"no parameters explain the meter: {what} it shows {mean:.0f} W in the mean, the "
                f"fit is off by {off:.0f} W (rms). Are the units of power and energy those of "
                "the headings, modes and loads those that were driven, and is it this robot?"
            )


def check_determined(determined: BoolArray, moving: BoolArray, window: float) -> None:
    """FitError where the data determine no parameter (P,); moving (W,): in which windows of
    `window` s.
    """
    if determined.any():
        return
    seconds = window * len(moving)
    moved = window * np.count_nonzero(moving)
    raise FitError(
        f"the data determine none of the {len(determined)} power parameters, so there is nothing "
        f"to write: the robot moves in {moved:.1f} of {seconds:.1f} s with watts. Drive several "
        "axes at several speeds and stay in the power modes; ir energy excite plans such "
        "movements"
    )


def check_readings(meter: Trace) -> None:
    """FitError where a meter reads so seldom that movements vanish between its readings."""
    if meter.period > _SELDOM:
        raise FitError(
            f"{meter.source}: a reading of power every {meter.period:.3g} s, a fit needs one every "
            f"{_SELDOM:g} s at least, better every 0.1 s or less"
        )


def check_range(source: str, robot: RobotModel, q: FloatArray) -> None:
    """FitError where positions (N, n) [rad] lie beyond what the robot can reach."""
    beyond = np.fmax(robot.position_min - q, q - robot.position_max)
    worst = np.nanmax(beyond, axis=0, initial=-np.inf)
    j = int(worst.argmax())
    if worst[j] > _BEYOND:
        value = float(q[np.nanargmax(beyond[:, j]), j])
        raise FitError(
            f"{source}: {robot.joint_names[j]} is {value:.3g} rad, {robot.name} reaches "
            f"{robot.position_min[j]:.3g} to {robot.position_max[j]:.3g} rad. Degrees need a "
            f"heading that says so: {robot.joint_names[j]}_deg; or is it another robot?"
        )
