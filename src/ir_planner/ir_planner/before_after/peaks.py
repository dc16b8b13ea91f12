"""Intervals of peak powers: what the drawn robots take in the instants that take most."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ir_msgs_py.report import PlannedMovement
from ir_planner.checks import Interval, interval, movement_energy, robots
from ir_planner.program import ProgramRequest
from ir_planner.scene import PlanningScene, scene_with

ROBOTS = 40  # drawn: each drives the movements, so that fewer than for energies are affordable
_NEAR = 0.7  # of the peak: movements that take less don't come to it with other parameters


def peak_interval(steps: Sequence[PlannedMovement], request: ProgramRequest) -> Interval:
    """The 90 % interval [W] of the largest power of some steps; it holds the nominal one."""
    peak = max((step.report.peak_power for step in steps), default=0.0)
    worst = np.zeros(ROBOTS)
    for step in steps:
        if step.trajectory is None or step.report.peak_power < _NEAR * peak:
            continue
        scene = scene_with(
            request.cell, step.load or "none", request.power, request.settings.drives
        )
        if scene.parameters is None:
            continue
        nominal = movement_energy(step.trajectory, scene).watts.max()
        drawn = [movement_energy(step.trajectory, one).watts.max() for one in _drawn(scene)]
        worst = np.maximum(
            worst, step.report.peak_power * np.array(drawn) / max(float(nominal), 1e-9)
        )
    if not worst.any():
        return Interval(peak, peak)
    return interval(peak, worst - peak)


def _drawn(scene: PlanningScene) -> list[PlanningScene]:
    """The same scene with each of the drawn robots."""
    sets = [replace(scene.parameters, mean=row) for row in robots(scene.parameters)[:ROBOTS]]
    return [
        replace(
            scene, drives=replace(scene.drives, parameters=one), power=one.power_with(scene.power)
        )
        for one in sets
    ]
