"""What current and voltage leave of the torque of the drives, eq. (8), as a torque envelope.

(H + J_r) qdd + h + friction - counterbalance = N k_t i with a current of at most i_max and a phase
voltage of at most U: (k_e w + R i)^2 + (l w i)^2 <= U^2, all of one phase, rms. w is the speed of
the motor, k_e = k_t / 3, R follows from the copper losses, U = V / sqrt(6) from the voltage V of
the DC link. i_max is what gives the largest torque of the data. l, the inductance times the pole
pairs, stands in no data sheet: it is the one with which the data's torque at full speed is just
possible at the data's voltage. So both envelopes begin and end alike there, and differ in between,
and at another voltage. A motor that brakes needs less voltage than this: the bound is on the safe
side of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ir_description import RobotModel
from ir_description.robot import torque_constants
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_values.arrays import FloatArray

_KNOTS = 12  # of the envelope, over the speeds at which the voltage bounds
_BETWEEN = 1000  # pieces between two knots in each of which it is held against the bound
_GRID = 200  # speeds among which the one is sought from which on the voltage bounds
_LEAST = 0.02  # of U that is left at full speed


class LinkVoltage(NamedTuple):
    """Of the DC link [V]: nominal, for which drives are made, and as it is."""

    nominal: float
    present: float


def within_current_and_voltage(robot: RobotModel, link: LinkVoltage) -> RobotModel:
    """The robot with the envelope of torque over speed that follows from current and voltage.

    Raises RequestError where the voltage does not reach full speed.
    """
    nominal = link.nominal
    voltage = link.present
    constants = np.asarray(torque_constants(robot, nominal))
    ratio = np.abs(np.asarray(robot.gear_ratio))
    full = np.asarray(robot.envelope_speed)[:, -1]
    emf = constants / 3.0 * ratio  # V per rad/s of the joint
    resistance = np.asarray(robot.copper_loss) * constants * constants / 3.0
    torque_per_ampere = constants * ratio
    peak = np.asarray(robot.envelope_torque)[:, 0] / torque_per_ampere
    last = np.asarray(robot.envelope_torque)[:, -1] / torque_per_ampere
    _check(robot, emf * full, voltage)

    # the reactance is what is left of the nominal voltage at full speed with the last current
    in_phase = emf * full + resistance * last
    left = (nominal / np.sqrt(6.0)) ** 2 - np.square(in_phase)
    reactance = np.sqrt(np.maximum(left, 0.0)) / (last * full)  # ohm per rad/s of the joint
    phase = voltage / np.sqrt(6.0)

    def ampere(speed: FloatArray) -> FloatArray:
        """The current (K, n) that voltage and drive allow at speeds (K, n) [rad/s]."""
        impedance = np.square(resistance) + np.square(reactance * speed)
        back = emf * speed
        root = np.square(back * resistance) - impedance * (np.square(back) - phase * phase)
        bound = np.divide(
            np.sqrt(np.maximum(root, 0.0)) - back * resistance,
            impedance,
            out=np.full_like(speed, np.inf),
            where=impedance > 0.0,
        )
        return np.asarray(np.minimum(bound, peak))

    # knots from the speed on at which the voltage begins to bound the current
    fractions = np.linspace(1.0 / _GRID, 1.0, _GRID)[:, None] * full
    free = ampere(fractions) >= peak
    free_share = np.sum(free, axis=0) / _GRID
    knee = np.where(free.all(axis=0), 0.5 * full, free_share * full)
    knee = np.clip(knee, full / _GRID, (1.0 - 1.0 / _GRID) * full)
    speeds = knee + np.linspace(0.0, 1.0, _KNOTS)[:, None] * (full - knee)
    allowed = ampere(speeds)

    # Between two knots the envelope is straight. Both it and the bound fall with the speed, so in a
    # piece it is at most its begin and the bound at least its end: lowered by that, it is nowhere
    # above the bound.
    share = np.linspace(0.0, 1.0, _BETWEEN + 1)[:, None, None]
    between = speeds[:-1] + share * np.diff(speeds, axis=0)
    straight = allowed[:-1] + share * np.diff(allowed, axis=0)
    bound = ampere(between.reshape(-1, len(full))).reshape(between.shape)
    beyond = np.max(straight[:-1] / bound[1:], axis=(0, 1))
    torque = allowed * torque_per_ampere / np.maximum(beyond, 1.0)
    levels = np.concatenate([torque[:1], torque]).T
    return replace(robot, envelope_speed=speeds.T, envelope_torque=levels)


def _check(robot: RobotModel, needed: FloatArray, voltage: float) -> None:
    """Refuse a voltage that does not reach full speed."""
    least = float(np.max(needed)) * np.sqrt(6.0) * (1.0 + _LEAST)
    if voltage < least:
        joint = robot.joint_names[int(np.argmax(needed))]
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"a DC link of {voltage:g} V does not turn {joint} at its full speed, whose back-EMF "
            f"and 2 % need {least:.0f} V: give dc_voltage at least that",
        )
