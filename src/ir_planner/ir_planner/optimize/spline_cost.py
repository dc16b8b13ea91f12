"""A request's objective and limits for uniform splines: as the compiled cost, and by slowing.

While a spline is optimised, a limit is a penalty; what is sent is slowed until every limit holds.
"""

from typing import Any

import numpy as np

from ir_kernels import SplineCost
from ir_kernels.spline_terms import SplineTerms
from ir_planner.checks import ToolUse
from ir_planner.curves import UniformSpline
from ir_planner.request import Context
from ir_planner.scene import MotionLimits, PlanningScene, ToolBounds, lasting_longer, torque_use
from ir_planner.timing import ObjectiveWeights
from ir_values.arrays import FloatArray

_MARGIN = 1e-3  # m of clearance beyond S_m that the descent asks for
_SCALE = 1e-2  # m that lack count like a limit used twice
_TILT_MARGIN = 2e-3  # rad below the largest tilt that the descent asks for, at most
_TILT_SHARE = 0.05  # of that tilt
_TILT_SCALE = 0.02  # rad of excess that count like a limit used twice
_FAR = -1e3  # m: no pair is ever that near, so clearance costs nothing


def spline_cost(
    context: Context,
    limits: MotionLimits,
    weights: ObjectiveWeights,
    penalty: float,
    threshold: FloatArray | None = None,
    smoothing: float = 0.0,
    upright: float = 0.0,
) -> SplineCost:
    """Cost of splines by the objective; what exceeds the limits costs `penalty` W for a relative
    excess of 1.

    threshold (R, Z) m: what the pairs must keep; None: path and clearance are given and cost
    nothing. smoothing [W]: of the DC link's switch. upright [rad]: by how much less than it may the
    tool is to lean.
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
        **_tilt_terms(context, upright),
    )
    return SplineCost(scene.collision, scene.dynamics, terms)


def _tilt_terms(context: Context, upright: float) -> dict[str, Any]:
    """Terms of the cone that the tool has to stay in, a little narrower."""
    cone = context.cone
    if cone is None:
        return {}
    margin = min(_TILT_MARGIN, _TILT_SHARE * cone.most) + upright
    return {
        "tilt_axis": cone.axis_of_link,
        "tilt_direction": cone.direction,
        "tilt_max": max(cone.most - margin, 0.0),
        "tilt_scale": _TILT_SCALE,
    }


_TORQUE_SAMPLES = 6  # per interval; the proof comes after
_ROUNDS = 25
_ROUNDED = 5e-7  # relative: of a limit that an end in motion reaches exactly
# rounds as if all of the torque fell with the speed: enough unless weight takes much of it
_PLAIN = 3
_CREEPING = 1e-6  # of the speed: weight and dry friction are left of the torque
_BELOW = 1.0005  # a little slower than asked for, so that few rounds end it


def beyond_limits(
    spline: UniformSpline, limits: MotionLimits, scene: PlanningScene
) -> tuple[float, float]:
    """By what factor a spline exceeds its share of torque (at samples), and by what factor it would
    have to last longer for its speed, acceleration and jerk, and those of the tool.
    """
    top = spline.extremes()
    torque = torque_use(scene.dynamics, *spline.samples(_TORQUE_SAMPLES)).max()
    none = np.zeros(spline.control.shape[1])
    longer = float(lasting_longer(limits, top.velocity, top.acceleration, top.jerk, none))
    if limits.tool.asked:
        trajectory = spline.trajectory(scene.cell.robot.joint_names)
        longer = max(longer, float(ToolUse(trajectory, scene, limits.tool).longer.max()))
    return float(torque) / limits.torque_share, longer


def slowed_to_limits(
    spline: UniformSpline, limits: MotionLimits, scene: PlanningScene
) -> UniformSpline | None:
    """The spline at its own duration or longer, within the limits; torque at samples. None where no
    duration carries it. One in motion at its ends is within them as it is, or None: what it begins
    with doesn't slow down.
    """
    if spline.ends is not None:
        return spline if max(beyond_limits(spline, limits, scene)) <= 1.0 + _ROUNDED else None
    spline = _slowed_for_tool(spline, limits.tool, scene)
    for k in range(_ROUNDS):
        top = spline.extremes()
        samples = spline.samples(_TORQUE_SAMPLES)
        torque = torque_use(scene.dynamics, *samples)
        share = torque.max(axis=0)
        longer = float(lasting_longer(limits, top.velocity, top.acceleration, top.jerk, share))
        if longer <= 1.0:
            return spline
        if k >= _PLAIN:
            longer = max(longer, _longer_by_inertia(torque, samples, limits, scene))
        spline = spline.at_interval(spline.interval * longer * _BELOW)
    return None


def _slowed_for_tool(
    spline: UniformSpline, bounds: ToolBounds, scene: PlanningScene
) -> UniformSpline:
    """The spline, evenly slower where its tool would be faster than it may be."""
    if not bounds.asked:
        return spline
    trajectory = spline.trajectory(scene.cell.robot.joint_names)
    longer = float(ToolUse(trajectory, scene, bounds).longer.max())
    return UniformSpline(spline.control, spline.interval * max(longer, 1.0))


def _longer_by_inertia(
    torque: FloatArray,
    samples: tuple[FloatArray, FloatArray, FloatArray],
    limits: MotionLimits,
    scene: PlanningScene,
) -> float:
    """By what factor a motion should last longer, as weight and dry friction don't fall with its
    speed; 1 where they alone are more than the joints may give. torque: share (N, n) of the samples
    q, qd, qdd.
    """
    q, qd, _ = samples
    still = torque_use(scene.dynamics, q, _CREEPING * qd, np.zeros_like(q))
    left = limits.torque_share - still
    over = (torque > limits.torque_share) & (left > 0.0)
    return float(np.sqrt(np.max((torque - still)[over] / left[over], initial=1.0)))
