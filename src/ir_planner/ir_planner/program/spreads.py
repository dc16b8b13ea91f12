"""Spread of a program's joules and savings by the uncertainty of the power parameters.

Every step, movement or pause, is followed over the same drawn robots, so sums and differences have
intervals of their own.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ir_msgs_py.modes import modes_of
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_planner.checks import interval, movement_spread, spread
from ir_planner.program.request import ProgramPlan, ProgramRequest
from ir_planner.program.rests import Rests, pause_slope, rests_at
from ir_planner.scene import PlanningScene, scene_with
from ir_values.arrays import FloatArray


class Spreads:
    """Of the steps of one request's programs."""

    def __init__(self, request: ProgramRequest) -> None:
        self._request = request
        self._scenes: dict[str, PlanningScene] = {}
        self._movements: dict[tuple[str, str], FloatArray] = {}
        self._pauses: dict[tuple[str, bytes, str, float], FloatArray] = {}

    def of(self, steps: Sequence[PlannedMovement]) -> list[FloatArray]:
        """What the drawn robots add (ROBOTS,) J to the energy of each step."""
        q = self._request.start
        found = list[FloatArray]()
        for step in steps:
            if step.trajectory is None:
                found.append(self._paused(step, q))
            else:
                found.append(self._moved(step))
                q = step.trajectory.positions[-1]
        return found

    @property
    def name(self) -> str:
        """Of the parameters."""
        return self._scene("").parameters.name

    def _scene(self, load: str) -> PlanningScene:
        if load not in self._scenes:
            r = self._request
            self._scenes[load] = scene_with(
                r.cell, load or "none", r.power, r.settings.drives(r.cell.robot)
            )
        return self._scenes[load]

    def _moved(self, step: PlannedMovement) -> FloatArray:
        assert step.trajectory is not None  # asked before
        key = (step.load, step.trajectory_id)
        if key not in self._movements:
            self._movements[key] = movement_spread(step.trajectory, self._scene(step.load))
        return self._movements[key]

    def _paused(self, step: PlannedMovement, q: FloatArray) -> FloatArray:
        key = (step.load, q.tobytes(), step.power_mode, step.duration)
        if key not in self._pauses:
            self._pauses[key] = self._rested(step, q)
        return self._pauses[key]

    def _rested(self, step: PlannedMovement, q: FloatArray) -> FloatArray:
        scene = self._scene(step.load)
        rests = rests_at(q, scene, self._request.settings.transitions)
        names = [mode.name for mode in modes_of(step.power_mode)]

        def energy(of: Rests) -> float:
            spent = (
                of.in_time([of.named(name) for name in names], step.duration) if names else np.inf
            )
            return spent if np.isfinite(spent) else of.cost((), step.duration)[0]

        return spread(pause_slope(q, scene, rests, energy), scene.parameters)


def with_intervals(plan: ProgramPlan, spreads: Spreads) -> ProgramPlan:
    """The plan with the interval of every energy."""
    if not plan.movements:
        return plan
    added = spreads.of(plan.movements)
    steps = tuple(
        replace(step, report=_bounded(step.report, one, spreads.name))
        for step, one in zip(plan.movements, added, strict=True)
    )
    return replace(
        plan,
        movements=steps,
        report=_bounded(plan.report, np.sum(added, axis=0), spreads.name),
    )


def _bounded(report: TrajectoryReport, added: FloatArray, name: str) -> TrajectoryReport:
    within = interval(report.energy, added)
    return replace(report, energy_low=within.low, energy_high=within.high, power_parameters=name)
