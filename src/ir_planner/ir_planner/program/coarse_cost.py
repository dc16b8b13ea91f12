"""What a movement would cost if nothing were in its path: a coarse solution that never meets a
body.

The descent is that of movements, on a spline with fewer points, without clearance. A movement that
keeps
clear of everything has one constraint more, so it costs as much or more, but for two things: the
descent may end in a poorer local minimum than the planner's, and a coarse spline bends less. MARGIN
is for both; benchmarks/program.py judges it by what chosen chains cost above the best of all
chains.
"""

import numpy as np

from ir_kernels import SplineCost, SplineTerms
from ir_msgs_py.arrays import FloatArray
from ir_planner.curves import UniformSpline, along_path, fewest_seconds
from ir_planner.program.bounds import Rates
from ir_planner.request import Context
from ir_planner.timing import objective_weights

MARGIN = 0.04  # share of a coarse cost by which the planner's movement may be cheaper
_SPACING = 0.1  # s between the knots of the coarse spline
# its control points
_FEWEST = 12
_MOST = 64
_SLOWER = 1.3  # than the straight segment at full speed: where the descent starts
_STIFFNESS = 4.0  # of penalties, against the objective's power: limits may be exceeded a little
_EVALUATIONS = (80, 60)  # on the coarse spline, and on one with a knot more in every interval


class CoarseCost:
    """Costs of movements in one scene, whatever stands there."""

    def __init__(self, context: Context, rates: Rates) -> None:
        self.context = context
        self.rates = rates
        scene = context.scene
        limits = context.limits
        robot = scene.cell.robot
        nobody = np.full((1, len(scene.collision.pairs)), -np.inf)
        ends = np.zeros((2, robot.n))
        self.weights = weights = objective_weights(context, ends)
        terms = SplineTerms(
            limits.velocity,
            limits.acceleration,
            limits.jerk,
            robot.position_min,
            robot.position_max,
            weights.travel,
            nobody,
            torque_share=limits.torque_share,
            energy_value=weights.energy,
            time_value=weights.time,
            capacity_energy=scene.dc_bus.capacity_energy,
            regeneration=scene.dc_bus.regeneration,
            penalty=_STIFFNESS * weights.power,
            clearance_penalty=0.0,
        )
        self.cost = SplineCost(scene.collision, scene.dynamics, terms)

    def between(self, first: FloatArray, second: FloatArray) -> float:
        """Cost of the coarse movement from rest at first (n,) to rest at second (n,)."""
        ends = np.stack([first, second])
        limits = self.context.limits
        least = fewest_seconds(ends, limits.velocity, limits.acceleration)
        count = int(np.clip(np.ceil(least / _SPACING), _FEWEST, _MOST))
        spline = along_path(ends, count, _SLOWER * least)
        value = np.inf
        for evaluations in _EVALUATIONS:
            found = self.cost.descend(spline.control, spline.interval, evaluations=evaluations)
            value = found.value
            spline = UniformSpline(found.control, found.interval).subdivided()
        # the descent's weights differ from the rates by a factor where time alone counts
        scale = self.rates.second / self.weights.time if self.rates.joule == 0.0 else 1.0
        return float(value) * scale
