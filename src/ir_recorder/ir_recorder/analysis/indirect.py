"""Indirect measurement (section VI of the paper): mains energy rebuilt from recorded motion and torque.

Axis power from joint speed and motor torque, one DC bus for all axes, and the base load that mode and tool
have by the data: what can be measured without a power meter.
"""

from __future__ import annotations

import numpy as np

from ir_description import Load, PowerData, RobotModel
from ir_kernels import DcBusParameters, DynamicsModel, dc_bus
from ir_recorder.read.recording import JointSeries

MOTORS_ON = "STAND_ON_MOTORS"


class IndirectMeter:
    """Mains energy of stretches in which the motors are on."""

    def __init__(self, joints: JointSeries, robot: RobotModel, power: PowerData) -> None:
        self._joints = joints
        self._model = DynamicsModel(robot)
        self._bus = DcBusParameters(power.dc_link_capacity_energy)
        self._controller = power.mode(MOTORS_ON).controller_watts + power.drives_and_brake_release

    def energy(self, start: float, end: float, loads: tuple[Load, ...]) -> float:
        """J between two times [s] with these loads; NaN where speed or torque wasn't recorded."""
        joints = self._joints
        inside = (joints.time >= start - 1e-9) & (joints.time < end - 1e-9)
        speed, torque, time = joints.velocity[inside], joints.effort[inside], joints.time[inside]
        if len(time) < 2 or speed.shape[1] != self._model.n or not np.isfinite([speed, torque]).all():
            return float("nan")
        steps = np.diff(time, append=end)
        if (steps <= 0.0).any():
            return float("nan")
        bus = dc_bus(self._model.axis_power(speed, torque), steps, self._bus)
        base = self._controller + sum(load.watts_always + load.watts_drive_bus for load in loads)
        return float(steps @ bus.mains + base * (end - start))
