"""Mains power predicted by the data: at rest, and of planned movements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import yaml

from ir_description import (
    Cell,
    DescriptionError,
    Load,
    PowerData,
    PowerParameters,
    RobotModel,
    load_power_data,
)
from ir_description.files import power_from_yaml
from ir_description.robot import DcLink, drawn_robots, interval_over
from ir_kernels import DynamicsModel
from ir_msgs_py.modes import drive_bus_up
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.format import contents
from ir_recorder.measure import PowerModel, Samples, planned_samples, standing_sample
from ir_recorder.reading.recording import Recording
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

# The figures of controller and DC link that a recording was made with, not those of this
# installation.

_PLANT = {  # of a plant file's dc_link
    "voltage": "mains_v",
    "capacitance": "capacitance_f",
    "chopper_on": "chopper_on_v",
    "chopper_off": "chopper_off_v",
}


def recorded_power_data(recording: Recording, cell: Cell | None) -> tuple[PowerData, str]:
    """The attached data of the controller, else those of the robot of the recording's `cell`, else
    the bundled ones; and a sentence where the attached ones can't be read.
    """
    own = load_power_data() if cell is None else cell.robot.controller
    if not recording.power_yaml:
        return own, ""
    try:
        return power_from_yaml(recording.power_yaml, contents.POWER), ""
    except (DescriptionError, InvalidValueError) as error:
        return own, f"the attached {contents.POWER} can't be read: {error}"


def recorded_link(recording: Recording, data: PowerData) -> DcLink:
    """The DC link of the simulated plant where one is recorded, whose mains may have another
    voltage; else that of the data.
    """
    try:
        page = yaml.safe_load(recording.plant_yaml) if recording.plant_yaml else {}
        figures = page.get("dc_link", {})
        return replace(
            data.dc_link,
            **{name: float(figures[key]) for name, key in _PLANT.items() if key in figures},
        )
    except (yaml.YAMLError, AttributeError, TypeError, ValueError, InvalidValueError):
        return data.dc_link


# Mains power of a robot at rest, by the data of controller, tool and robot: mode, load and
# posture.

MOTORS = "STAND_ON_MOTORS"
BRAKES = "STAND_ON_BRAKES"


def resting_watts(
    mode: str, q: FloatArray, cell: Cell, loads: tuple[Load, ...], data: PowerData
) -> float:
    """W at the mains in a mode at q (n,): controller, tool, and with motors on drives and holding
    torque; of a mode that was measured by posture and load, what its table says.
    """
    table = data.measured_rest(mode)
    if table is not None:
        return table.watts(mode, q.tolist(), float(sum(load.mass for load in loads)))
    tool = sum(load.watts(drive_bus=drive_bus_up(mode)) for load in loads)
    watts = data.resting(mode).controller_watts + tool
    if mode != MOTORS:
        return float(watts)
    model = DynamicsModel(cell.robot, loads)
    still = np.zeros((1, cell.robot.n))
    held = model.inverse_dynamics(q[None, :], still, still)
    return float(watts + data.drives_and_brake_release + model.axis_power(still, held).sum())


Power = TypeVar("Power", float, FloatArray)


@dataclass(frozen=True)
class BrakeTimer:
    """The controller left alone: `after` [s] on motors it closes the brakes by itself, and opens
    them when the pause ends; closing, opening [s] at the power of motors, at least `stay` [s]
    between.
    """

    after: float
    closing: float
    opening: float
    stay: float

    @classmethod
    def of(cls, data: PowerData) -> BrakeTimer:
        """That of the data of a controller."""
        own = data.resting(BRAKES)
        return cls(
            data.motors_to_brakes_in_program,
            own.time_to_pause,
            own.regular_time_to_operate,
            own.minimum_stay,
        )

    def joules(self, motors: Power, brakes: Power, seconds: float) -> Power:
        """J from the start of a pause until the robot is ready after it; motors, brakes [W]: at
        rest in the two modes.
        """
        if seconds <= self.after:
            return motors * seconds
        closed = self.after + self.closing
        awake = max(seconds, closed + self.stay)
        return motors * (closed + self.opening) + brakes * (awake - closed)


def pause_joules(watts: Power, motors: Power, seconds: float, change: float) -> Power:
    """J of a pause of `seconds` in a mode of `watts`; `change` [s] of it, in and out, at `motors`
    [W].
    """
    return motors * change + watts * (seconds - change)


# What given power parameters predict for planned movements, with the 90 % interval.
#
# The plan's own figures are of the parameters that it was planned with.


class Predictor:
    """Energies of movements of one robot, mounted at base_pose (4, 4), by these parameters."""

    def __init__(
        self, robot: RobotModel, link: DcLink, base_pose: FloatArray, parameters: PowerParameters
    ) -> None:
        self._model = PowerModel(robot, link, base_pose, parameters)
        self._parameters = parameters
        self._draws = drawn_robots(parameters)

    def report(
        self, planned: TrajectoryReport, trajectory: JointTrajectory, loads: Sequence[Load]
    ) -> TrajectoryReport:
        """The plan's report with energy [J], interval and name of these parameters."""
        samples = planned_samples(trajectory, loads, self._parameters.modes)
        energy, low, high = self._energies(samples)
        return replace(
            planned,
            energy=energy,
            energy_low=low,
            energy_high=high,
            power_parameters=self._parameters.name,
        )

    def standing(self, q: FloatArray, loads: Sequence[Load]) -> tuple[float, float, float]:
        """Power [W] while it stands at q (n,) on motors, with the ends of its 90 % interval."""
        return self._energies(standing_sample(q, loads, self._parameters.modes))

    def added_at_rest(self, mode: str, q: FloatArray, loads: Sequence[Load]) -> FloatArray:
        """W (N,) that the drawn robots add to the power of standing at q (n,) in a mode: linear
        around the mean, as the planner's pauses, so that a saving has one interval.
        """
        samples = standing_sample(q, loads, self._parameters.modes, mode)
        mean = self._parameters.mean
        _, slopes = self._model.watts_and_slopes(mean, self._model.prepare(samples))
        return np.asarray(samples.step * ((self._draws - mean) @ slopes.sum(axis=0)))

    def _energies(self, samples: Samples) -> tuple[float, float, float]:
        """Energy [J] of samples, and the ends of its 90 % interval."""
        energy, added = self._added(samples)
        return energy, *interval_over(energy, added)

    def _added(self, samples: Samples) -> tuple[float, FloatArray]:
        """Energy [J] of samples, and what the drawn robots add (N,) to it."""
        prepared = self._model.prepare(samples)
        expected = self._draws.mean(axis=0)
        energy = samples.step * float(self._model.watts(self._parameters.mean, prepared).sum())
        watts, slopes = self._model.watts_and_slopes(expected, prepared)
        drawn = samples.step * (watts.sum() + (self._draws - expected) @ slopes.sum(axis=0))
        return energy, np.asarray(drawn - energy)
