"""How the energy of a pause changes with each power parameter.

With given switch times the energy is linear in the powers of the modes, so the seconds that count
for a mode are the energy of a robot that draws 1 W in it and nothing in the others.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.checks import holding_slope, standing_slope
from ir_planner.program.rests import BRAKES, MOTORS, Rests, Step, Steps
from ir_planner.scene import PlanningScene

Energy = Callable[[Rests], float]
"""Energy [J] of a pause that is spent in one given sequence."""


def pause_slope(q: FloatArray, scene: PlanningScene, rests: Rests, energy: Energy) -> FloatArray:
    """d energy / d parameter (P,) of a pause at q (n,), J per unit."""
    slope = np.zeros(len(scene.parameters.names))
    for mode in (MOTORS, *(rest.name for rest in rests.modes)):
        seconds = energy(_one_watt(rests, mode))
        if seconds != 0.0:
            slope += seconds * _mode_slope(mode, q, scene)
    return slope


def same_steps(steps: Steps, rests: Rests) -> Steps:
    """The steps with the powers of other rests."""
    return tuple(Step(rests.named(step.rest.name), step.at) for step in steps)


def _one_watt(rests: Rests, mode: str) -> Rests:
    modes = tuple(replace(rest, watts=float(rest.name == mode)) for rest in rests.modes)
    return replace(rests, motors=float(mode == MOTORS), modes=modes)


def _mode_slope(mode: str, q: FloatArray, scene: PlanningScene) -> FloatArray:
    if mode == MOTORS:
        return holding_slope(q, scene)
    return standing_slope(1.0, scene, mode, drive_bus=mode == BRAKES)
