"""Mains power of a robot at rest, by the data of controller, tool and robot: mode, load and
posture.
"""

from __future__ import annotations

import numpy as np

from ir_description import Cell, Load, PowerData
from ir_kernels import DynamicsModel
from ir_msgs_py.arrays import FloatArray

MOTORS = "STAND_ON_MOTORS"
BRAKES = "STAND_ON_BRAKES"
_BUS_UP = (MOTORS, BRAKES)  # modes in which the drive bus feeds the tool


def resting_watts(
    mode: str, q: FloatArray, cell: Cell, loads: tuple[Load, ...], data: PowerData
) -> float:
    """W at the mains in a mode at q (n,): controller, tool, and with motors on drives and holding
    torque.
    """
    watts = data.resting(mode).controller_watts + sum(load.watts_always for load in loads)
    if mode in _BUS_UP:
        watts += sum(load.watts_drive_bus for load in loads)
    if mode != MOTORS:
        return float(watts)
    model = DynamicsModel(cell.robot, loads)
    still = np.zeros((1, cell.robot.n))
    held = model.inverse_dynamics(q[None, :], still, still)
    return float(watts + data.drives_and_brake_release + model.axis_power(still, held).sum())


def left_alone_joules(
    motors: float, brakes: float, seconds: float, timer: float, change: float
) -> float:
    """J of a pause on motors: after `timer` [s] the controller closes the brakes by itself.

    motors, brakes [W]: at rest in the two modes; change [s]: closing and opening, at `motors`.
    """
    if seconds <= timer + change:
        return motors * seconds
    return motors * (timer + change) + brakes * (seconds - timer - change)


def pause_joules(watts: float, motors: float, seconds: float, change: float) -> float:
    """J of a pause of `seconds` in a mode of `watts`; `change` [s] of it, in and out, at `motors`
    [W].
    """
    return motors * change + watts * (seconds - change)
