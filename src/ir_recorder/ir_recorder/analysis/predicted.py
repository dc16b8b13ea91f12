"""What given power parameters predict for planned movements, with the 90 % interval.

The plan's own figures are of the parameters that it was planned with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ir_description import Load, PowerParameters, RobotModel, interval_over
from ir_description.robot import DcLink
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.measure import PowerModel, Samples, planned_samples, standing_sample

_DRAWS = 400


class Predictor:
    """Energies of movements of one robot, mounted at base_pose (4, 4), by these parameters."""

    def __init__(
        self, robot: RobotModel, link: DcLink, base_pose: FloatArray, parameters: PowerParameters
    ) -> None:
        self._model = PowerModel(robot, link, base_pose, parameters)
        self._parameters = parameters
        self._draws = parameters.draws(_DRAWS, 0)

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

    def _energies(self, samples: Samples) -> tuple[float, float, float]:
        """Energy [J] of samples, and the ends of its 90 % interval."""
        prepared = self._model.prepare(samples)
        expected = self._draws.mean(axis=0)
        energy = samples.step * float(self._model.watts(self._parameters.mean, prepared).sum())
        watts, slopes = self._model.watts_and_slopes(expected, prepared)
        drawn = samples.step * (watts.sum() + (self._draws - expected) @ slopes.sum(axis=0))
        return energy, *interval_over(energy, drawn - energy)
