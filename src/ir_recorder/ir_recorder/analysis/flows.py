"""Energy flows from the mains to axes, tool and brake resistor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_description import Cell
from ir_kernels import DynamicsModel
from ir_msgs_py.modes import RESTS
from ir_recorder.analysis.loads import carried
from ir_recorder.analysis.predicted_power import recorded_link, recorded_power_data
from ir_recorder.analysis.results import NAN, Analysis, StepResult
from ir_recorder.reading.recording import JointSeries
from ir_values.arrays import BoolArray, FloatArray

# Where the joules of a run go: from the mains to controller, tool, axes, brake resistor; what
# comes back.
#
# The meter gives mains, base, axes and brake resistor; recorded speed and torque split an axis
# into its motor's electrical losses and mechanical work; gravity's part of that work follows from
# posture and load by the data of the robot. A run begins and ends at rest, so the mechanical work
# that gravity doesn't keep is friction.

_GAP = 0.02  # s: beyond it nothing was published, and the robot stood still


@dataclass(frozen=True)
class EnergyFlows:
    """Joules of the program, of the whole recording where none was executed; NaN where it wasn't
    recorded.

    mains = controller + tool + rectifier + from_mains; from_mains + returned = taken + resistor +
    bled + stored.
    taken, returned: by accelerating and by braking axes, each counted for itself; stored: left in
    the capacitors; bled: by their bleed resistors while the drive bus was off. motors: electrical
    losses of motors and inverters. lifted, lowered: work into and out of gravity and
    counterbalance; friction: mechanical work that neither keeps.
    """

    mains: float
    controller: float
    tool: float
    rectifier: float
    taken: float
    returned: float
    resistor: float
    motors: float
    lifted: float
    lowered: float
    bled: float = 0.0

    @property
    def from_mains(self) -> float:
        """What the rectifier feeds into the DC link."""
        return self.mains - self.controller - self.tool - self.rectifier

    @property
    def stored(self) -> float:
        """What the capacitors hold more at the end than at the start."""
        return self.from_mains + self.returned - self.taken - self.resistor - self.bled

    @property
    def friction(self) -> float:
        """Mechanical work of the axes that gravity doesn't keep."""
        return self.taken - self.returned - self.motors - (self.lifted - self.lowered)

    @property
    def known(self) -> bool:
        """Whether the flows from the mains to the axes were recorded."""
        return bool(np.isfinite([self.mains, self.controller, self.taken, self.resistor]).all())

    @property
    def split(self) -> bool:
        """Whether the axes' work is known too."""
        return self.known and bool(np.isfinite([self.motors, self.lifted, self.lowered]).all())


def energy_flows(analysis: Analysis) -> EnergyFlows | None:
    """The flows of a recording with a power meter; None without one."""
    power = analysis.recording.power
    if power is None or len(power.time) < 2:
        return None
    start, end = _span(analysis)
    inside = (power.time > start + 1e-9) & (power.time <= end + 1e-9)
    step = np.diff(power.time, prepend=power.time[:1])[inside]
    axes = power.joint_power[inside]
    # a meter of the mains alone knows none
    axes = np.nan_to_num(axes) if np.isfinite(axes).any() else axes
    tool = float(np.nan_to_num(power.tool_power[inside]) @ step)
    work, lifted, lowered = _mechanical(analysis, start, end)
    taken = float(step @ np.maximum(axes, 0.0).sum(axis=1))
    returned = float(step @ np.maximum(-axes, 0.0).sum(axis=1))
    return EnergyFlows(
        mains=float(power.power[inside] @ step),
        controller=float(power.base_power[inside] @ step) - tool,
        tool=tool,
        rectifier=float(np.nan_to_num(power.rectifier_loss[inside]) @ step),
        taken=taken,
        returned=returned,
        resistor=float(np.nan_to_num(power.burnt_power[inside]) @ step),
        motors=taken - returned - work,
        lifted=lifted,
        lowered=lowered,
        bled=_bled(analysis, inside),
    )


def _bled(analysis: Analysis, inside: BoolArray) -> float:
    """J that the capacitors lost in readings with the drive bus off, by the bus voltage: in a rest
    without it, and wherever the mains would have kept the voltage up.
    """
    recording = analysis.recording
    power = recording.power
    if power is None or not (power.bus_voltage > 0.0).any():
        return 0.0
    data = recorded_power_data(recording, analysis.cell)[0]
    link = recorded_link(recording, data)
    off = np.isin(power.mode, [int(row.mode) for row in RESTS if not row.drives_on])
    volts = np.nan_to_num(power.bus_voltage)
    held = np.where(off, volts, np.minimum(volts, link.voltage))
    before = np.concatenate((held[:1], np.where(off[1:], volts[:-1], held[:-1])))
    fallen = 0.5 * link.capacitance * (before**2 - held**2)
    return float(np.maximum(fallen[inside], 0.0).sum())


def _span(analysis: Analysis) -> tuple[float, float]:
    if not analysis.steps:
        return -np.inf, np.inf
    return analysis.steps[0].step.start, analysis.steps[-1].step.end


def _mechanical(analysis: Analysis, start: float, end: float) -> tuple[float, float, float]:
    """Work of the motors [J], and what of it lifts and what lowering gives back; NaN where
    unknown.
    """
    joints = analysis.recording.joints
    cell = analysis.cell
    if (
        joints is None
        or cell is None
        or joints.position.shape[1] != cell.robot.n
        or not analysis.steps
    ):
        return NAN, NAN, NAN
    inside = (joints.time >= start) & (joints.time <= end)
    time = joints.time[inside]
    speed = joints.velocity[inside]
    torque = joints.effort[inside]
    if len(time) < 2 or not np.isfinite([speed, torque]).all():
        return NAN, NAN, NAN
    watts = (cell.robot.coupling.motors(speed) * torque).sum(axis=1)
    lifts = [_lifting(joints, cell, result) for result in analysis.movements]
    return _integral(time, watts), sum(up for up, _ in lifts), sum(down for _, down in lifts)


def _lifting(joints: JointSeries, cell: Cell, result: StepResult) -> tuple[float, float]:
    """J into and out of gravity and counterbalance on a movement."""
    inside = (joints.time >= result.step.start) & (joints.time <= result.step.end)
    if np.count_nonzero(inside) < 2:
        return 0.0, 0.0
    q = np.ascontiguousarray(joints.position[inside])
    model = DynamicsModel(cell.robot, carried(cell, result.step.movement.load))
    held = model.gravity(q) - model.counterbalance(q)
    watts = (held * joints.velocity[inside]).sum(axis=1)
    time = joints.time[inside]
    return _integral(time, np.maximum(watts, 0.0)), _integral(time, np.maximum(-watts, 0.0))


def _integral(time: FloatArray, watts: FloatArray) -> float:
    """J by the trapezoidal rule; a gap in the recording adds nothing."""
    step = np.diff(time)
    return float(np.where(step <= _GAP, step, 0.0) @ (watts[1:] + watts[:-1]) / 2.0)
