"""The charge of the DC link's capacitor, carried from step to step of a program.

A movement leaves what its braking gave, the next one takes it first. While the motors hold the arm
the charge feeds the holding torque; with the brakes closed it stays.
"""

from dataclasses import replace

from ir_msgs_py.modes import TransitionTimes, modes_of
from ir_msgs_py.report import PlannedMovement
from ir_planner.checks import MovementEnergy, carried, holding_watts, peak_power
from ir_planner.program.pauses import Pause
from ir_planner.scene import PlanningScene


class Charge:
    """stored [J] after the steps so far; empty at first."""

    def __init__(self, times: TransitionTimes) -> None:
        self.stored = 0.0
        self._times = times

    def moved(
        self, step: PlannedMovement, alone: MovementEnergy, scene: PlanningScene
    ) -> PlannedMovement:
        """The step of a movement with the energy that it takes from the mains now; alone: what it
        takes with an empty capacitor.
        """
        assert step.trajectory is not None  # it moves
        charge = self.stored
        energy = self.taken(alone, scene)
        report = step.report
        if energy is not alone:
            peak = peak_power(step.trajectory, scene, charge)
            report = replace(
                report, energy=energy.total, burnt_energy=energy.dissipated, peak_power=peak
            )
        return replace(step, report=report)

    def taken(self, alone: MovementEnergy, scene: PlanningScene) -> MovementEnergy:
        """What a movement takes from the mains now; alone: the same with an empty capacitor."""
        energy = carried(alone, self.stored, scene)
        self.stored = energy.capacitor
        return energy

    def stood(self, step: PlannedMovement, pause: Pause) -> PlannedMovement:
        """The step of a pause, whose holding torque takes the charge first."""
        scene = pause.scene
        watts = holding_watts(pause.q, scene) - scene.base_watts
        fed = min(self.stored, max(watts, 0.0) * self._holding(step, pause))
        self.stored -= fed
        report = step.report
        energy = report.energy - fed
        return replace(step, report=replace(report, energy=energy, base_energy=energy))

    def _holding(self, step: PlannedMovement, pause: Pause) -> float:
        """How long the motors hold the arm [s]; the controller's own timer closes the brakes long
        after the charge has gone.
        """
        modes = modes_of(step.power_mode)
        times = self._times
        if not modes:
            return pause.seconds
        return min(times.enter(modes[0].name) + times.leave(modes[-1].name), pause.seconds)
