"""The descent on the speed profile along a fixed path: s at the knots of a uniform spline; its
duration.
"""

from ir_msgs_py.arrays import FloatArray
from ir_planner.optimize.fixed_path import FixedPath
from ir_planner.optimize.spline_cost import spline_cost
from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.timing import objective_weights

_SPARSE = 40  # places of the path for the weight of an objective
_GAIN = 1e-5  # share of the value that ten steps must gain together


def optimised_profile(
    path: FixedPath,
    s: FloatArray,
    duration: float,
    limits: MotionLimits,
    effort: tuple[float, float, int],
    context: Context,
) -> tuple[FloatArray, float, int]:
    """s (count - 3,) at the inner knots, duration [s] and evaluations, from a profile s and its
    duration, which stays where the request has one. effort: stiffness of penalties, against the
    power that the objective is about, smoothing of the bus [W], and evaluations.
    """
    weights = objective_weights(context, path.q[::_SPARSE])
    stiffness, smoothing, most = effort
    cost = spline_cost(context, limits, weights, stiffness * weights.power, smoothing=smoothing)
    found = cost.descend_profile(
        path.cubics,
        s,
        duration,
        fixed_duration=context.options.duration > 0.0,
        evaluations=most,
        tolerance=_GAIN,
    )
    return found.s, found.duration, found.evaluations
