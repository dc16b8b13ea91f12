"""Indirect measurement (section VI of the paper): energy from motion, beside the meter's."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_description import Load, PowerParameters, RobotModel
from ir_description.robot import IDLE, LINK, DcLink
from ir_recorder.analysis.intervals import Mean, mean_of, spread_of
from ir_recorder.analysis.results import Analysis
from ir_recorder.errors import RecorderError
from ir_recorder.measure.arm import available, pinocchio_torques
from ir_recorder.measure.power_model import PowerModel, bus_flow
from ir_recorder.measure.samples import samples_of
from ir_recorder.reading.recording import JointSeries
from ir_recorder.traces.trace import Trace
from ir_values.arrays import BoolArray, FloatArray

# Indirect measurement (section VI of the paper): mains energy rebuilt from what the robot did.
#
# From recorded positions alone: differentiated, torques of the bodies, losses and DC link by code
# that planner and plant know nothing of (`ir_recorder.measure`). From recorded torques: their power
# instead of the bodies'. Both use the power parameters that they are given, by default the data
# sheet's.

_AROUND = 0.5  # s of the recording beside a movement that the filter may look at
NAN = math.nan


class IndirectMeter:
    """Mains energy of stretches in which the motors are on; base_pose (4, 4) of the robot in the
    cell.
    """

    def __init__(
        self,
        joints: JointSeries,
        robot: RobotModel,
        base_pose: FloatArray,
        link: DcLink,
        parameters: PowerParameters,
    ) -> None:
        self._joints = joints
        self._robot = robot
        self._link = link
        self._parameters = parameters
        self._model = PowerModel(robot, link, base_pose, parameters)
        self._second = PowerModel(robot, link, base_pose, parameters, pinocchio_torques)

    def energy(self, start: float, end: float, loads: tuple[Load, ...]) -> float:
        """J between two times [s] with these loads, from positions alone; NaN where they are
        missing.
        """
        return self._by(self._model, start, end, loads)

    def second_opinion(self, start: float, end: float, loads: tuple[Load, ...]) -> float:
        """Energy [J] with torques by Pinocchio; NaN where it isn't installed."""
        return self._by(self._second, start, end, loads) if available() else NAN

    def _by(self, model: PowerModel, start: float, end: float, loads: tuple[Load, ...]) -> float:
        """Energy [J] between two times [s] by a model of power; NaN where positions are too few."""
        joints = self._joints
        rows = (joints.time >= start - _AROUND) & (joints.time <= end + _AROUND)
        if np.count_nonzero(rows) < 2 or joints.position.shape[1] != self._robot.n:
            return NAN
        try:
            samples = samples_of(
                Trace("joint states", joints.time[rows].copy(), self._columns(rows)),
                None,
                self._robot.joint_names,
                self._parameters.modes,
                [(-np.inf, np.inf, loads)],
            ).part(start, end)
        except RecorderError:  # too short, or not the robot's joints
            return NAN
        if not len(samples) or not samples.known.all():
            return NAN
        watts = model.watts(self._parameters.mean, model.prepare(samples))
        return float(watts.mean() * (end - start))

    def _columns(self, rows: BoolArray) -> dict[str, FloatArray]:
        positions = self._joints.position[rows]
        return {name: positions[:, k].copy() for k, name in enumerate(self._joints.names)}

    def from_torques(self, start: float, end: float, loads: tuple[Load, ...]) -> float:
        """Energy [J] from recorded speed and torque; NaN where they weren't recorded."""
        joints = self._joints
        of = self._parameters.axis
        inside = (joints.time >= start - 1e-9) & (joints.time < end - 1e-9)
        speed = joints.velocity[inside]
        torque = joints.effort[inside]
        time = joints.time[inside]
        if (
            len(time) < 2
            or speed.shape[1] != self._robot.n
            or not np.isfinite([speed, torque]).all()
        ):
            return NAN
        step = float((end - start) / len(time))
        speed = self._robot.coupling.motors(speed)
        motor = torque / self._robot.gear_ratio
        axes = torque * speed + of("copper") * motor**2 + of("inverter") * np.abs(motor)
        value = self._parameters.value
        wanted = (axes + of("iron") * speed**2).sum(axis=1) + value(IDLE)
        flow = bus_flow(self._link, wanted, step, size=value(LINK))
        base = value("watts.STAND_ON_MOTORS") + value("drives_watts")
        tool = sum(load.watts(drive_bus=True) for load in loads)
        bus = flow.watts.mean() / value("rectifier_efficiency")
        return float((bus + base + value("tool_watts") * tool) * (end - start))


# Direct against indirect: the meter's joules beside those from positions, movement by movement.


@dataclass(frozen=True)
class MeasuredEnergies:
    """A movement of `seconds` [s] by each measurement [J]: the meter, positions, torques, and
    positions with Pinocchio's torques; NaN where one is not available.
    """

    label: str
    seconds: float
    direct: float
    indirect: float
    from_torques: float
    second_opinion: float

    @property
    def difference(self) -> float:
        """Indirect less direct, as a share of direct."""
        return self.indirect / self.direct - 1.0 if self.direct > 0.0 else NAN


@dataclass(frozen=True)
class Agreement:
    """Movements by both measurements, and the mean of their relative difference.

    spread: standard deviation of the relative difference over movements.
    """

    movements: tuple[MeasuredEnergies, ...]
    difference: Mean
    spread: float

    @property
    def sentence(self) -> str:
        """The finding in words, for people."""
        count = sum(math.isfinite(each.difference) for each in self.movements)
        if not count:
            return "direct and indirect measurement can't be compared: one of them is missing"
        shown = f"{100.0 * self.difference.value:+.1f} %"
        if math.isnan(self.difference.low):
            of = "1 movement is" if count == 1 else f"each of {count} movements is"
            return f"the indirect measurement of {of} {shown} off the meter"
        low = 100.0 * self.difference.low
        high = 100.0 * self.difference.high
        agree = "no difference is shown" if low <= 0.0 <= high else "the two differ"
        return (
            f"over {count} movements the indirect measurement is {shown} off the meter, between "
            f"{low:+.1f} and {high:+.1f} % with 90 % confidence: {agree}; single movements "
            f"spread by {100.0 * self.spread:.1f} %"
        )


def agreement(analysis: Analysis) -> Agreement:
    """Both measurements of all movements of a recording that ended."""
    rows = tuple(
        MeasuredEnergies(
            result.step.label,
            result.seconds,
            result.energy,
            result.indirect_energy,
            result.torque_energy,
            result.second_opinion,
        )
        for result in analysis.movements
        if result.step.outcome == "ended"
    )
    return agreement_of(rows)


def agreement_of(rows: tuple[MeasuredEnergies, ...]) -> Agreement:
    """What both measurements of some movements say together."""
    both = [row for row in rows if math.isfinite(row.difference)]
    differences = np.array([row.difference for row in both])
    return Agreement(
        rows,
        mean_of(differences),
        spread_of(differences),
    )
