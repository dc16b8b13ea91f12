"""Curves of every axis for the engineer: position, speed, torque, power, tracking error,
temperature.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_recorder.analysis import Analysis
from ir_recorder.report.series import Json, envelope, floats, quantised

MOST = 4_000  # stretches of a curve: more than a screen has pixels; peaks are kept
_STEPS = 32_000  # of int16


@dataclass(frozen=True, eq=False)
class Curves:
    """One quantity: time (N,) s, value (N, n) in `unit`, limit (n, 2); series: what the columns
    are.
    """

    name: str
    unit: str
    time: FloatArray
    value: FloatArray
    limit: FloatArray | None = None
    shown: bool = True
    series: str = "axes"


def axis_curves(analysis: Analysis) -> list[dict[str, Json]]:
    """What axes.js draws."""
    return [
        packed(curves)
        for curves in _curves(analysis)
        if len(curves.time) > 1 and _seen(curves.value)
    ]


def _seen(value: FloatArray) -> bool:
    return bool(np.isfinite(value).any())


def _curves(analysis: Analysis) -> Iterator[Curves]:
    recording = analysis.recording
    joints = recording.joints
    power = recording.power
    controller = recording.controller
    if joints is not None:
        position, speed, torque = _limits(analysis, joints.position.shape[1])
        yield Curves("position", "°", joints.time, np.degrees(joints.position), position)
        yield Curves("speed", "°/s", joints.time, np.degrees(joints.velocity), speed)
        yield Curves("torque", "Nm", joints.time, joints.effort, torque)
    if power is not None:
        yield Curves("power at the DC bus", "W", power.time, power.joint_power)
    if controller is not None:
        error, unit = _readable(controller.joint_error)
        yield Curves("tracking error", unit, controller.time, error, shown=False)
        tool = controller.tool_deviation[:, None] * 1e3
        yield Curves("tool off its path", "mm", controller.time, tool, shown=False, series="tool")
    if power is not None:
        yield Curves(
            "temperature of the gear", "°C", power.time, power.joint_temperature, shown=False
        )


def _limits(
    analysis: Analysis, n: int
) -> tuple[FloatArray | None, FloatArray | None, FloatArray | None]:
    """Limits (n, 2) of position [deg], speed [deg/s] and torque [Nm] by the data of the robot."""
    if analysis.cell is None or analysis.cell.robot.n != n:
        return None, None, None
    robot = analysis.cell.robot
    torque = robot.envelope_torque[:, 0]
    return (
        np.degrees(np.stack([robot.position_min, robot.position_max], axis=1)),
        np.degrees(np.stack([-robot.velocity_max, robot.velocity_max], axis=1)),
        np.stack([-torque, torque], axis=1),
    )


def _readable(error: FloatArray) -> tuple[FloatArray, str]:
    """Radians as mrad, or as µrad where all are below one mrad."""
    most = float(np.nanmax(np.abs(error))) if _seen(error) else 0.0
    return (error * 1e3, "mrad") if most >= 1e-3 else (error * 1e6, "µrad")


def packed(curves: Curves) -> dict[str, Json]:
    """Curves as the page's scripts read them: peaks kept, int16."""
    value = np.nan_to_num(curves.value)
    shape = envelope(curves.time, value, MOST)
    step = max(float(np.abs(value).max()), 1e-9) / _STEPS
    packed: dict[str, Json] = {
        "name": curves.name,
        "unit": curves.unit,
        "series": curves.series,
        "count": value.shape[1],
        "shown": curves.shown,
        "step": step,
        "time": floats(shape.time),
        "high": quantised(shape.high, step),
    }
    if shape.low is not shape.high:
        packed["low"] = quantised(shape.low, step)
    if curves.limit is not None:
        packed["limits"] = [
            [round(float(x), 3) if math.isfinite(x) else None for x in row] for row in curves.limit
        ]
    return packed
