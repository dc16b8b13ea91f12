"""The objective and the limits of a request as the compiled cost of splines takes them."""

import numpy as np

from ir_kernels import SplineCost, SplineTerms
from ir_msgs_py.arrays import FloatArray
from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.timing import ObjectiveWeights

_MARGIN = 1e-3  # m of clearance beyond S_m that the descent asks for
_SCALE = 1e-2  # m that lack count like a limit used twice
_FAR = -1e3  # m: no pair is ever that near, so clearance costs nothing


def spline_cost(
    context: Context,
    limits: MotionLimits,
    weights: ObjectiveWeights,
    penalty: float,
    threshold: FloatArray | None = None,
    smoothing: float = 0.0,
) -> SplineCost:
    """Cost of splines by the objective; what exceeds the limits costs `penalty` W for a relative
    excess of 1.

    threshold (R, Z) m: what the pairs must keep; None: path and clearance are given and cost
    nothing. smoothing [W]: of the bus' switch.
    """
    scene = context.scene
    robot = context.scene.cell.robot
    given = threshold is None
    terms = SplineTerms(
        limits.velocity,
        limits.acceleration,
        limits.jerk,
        robot.position_min,
        robot.position_max,
        np.zeros(robot.n) if given else weights.travel,
        np.full((1, len(scene.collision.pairs)), _FAR) if threshold is None else threshold,
        torque_share=limits.torque_share,
        energy_value=weights.energy,
        time_value=weights.time,
        capacity_energy=scene.dc_bus.capacity_energy,
        regeneration=scene.dc_bus.regeneration,
        smoothing=smoothing,
        clearance_margin=_MARGIN,
        clearance_scale=_SCALE,
        penalty=penalty,
        clearance_penalty=0.0 if given else penalty,
    )
    return SplineCost(scene.collision, scene.dynamics, terms)
