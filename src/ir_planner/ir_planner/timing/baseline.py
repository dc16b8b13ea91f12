"""The baseline movement: the straight joint segment, as a controller's PTP would run it.

One seven-phase S-curve for all joints (synchronous) with the data's limits, uniformly slowed until
torque keeps its share of the envelope; longer durations by uniform time scaling. Every answer of
the default portfolio is compared with it.
"""

import numpy as np

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.request import Context
from ir_planner.scene import STILL, MotionLimits
from ir_planner.timing.blended_steps import TimedPath, blended, stretched
from ir_planner.timing.jerk_limited_laws import StepLaws
from ir_planner.timing.movement import Movement, within_torque
from ir_planner.timing.objective import (
    DURATION_SLACK,
    at_best_duration,
    least_stretched_cost,
    slowed_for_tool,
)
from ir_planner.timing.ptp import free_law, path_limits, torque_per_segment
from ir_values.arrays import FloatArray

_ROUNDS = 25  # gravity doesn't fall with speed: a load near the envelope takes several
_BELOW = 1.0005  # a little slower than asked for, so that few rounds end it
_NEAR = 0.99  # of the torque's share: nearer isn't looked for
_REFINEMENTS = 8  # one to three are enough but for kinks of the torque envelope


def baseline(start: FloatArray, goal: FloatArray, context: Context) -> Movement | None:
    """The baseline from `start` to `goal` (n,), at the requested duration or the best for the
    objective; None where no duration carries the load, or the requested one is too short. Its
    clearance is not asked for here.
    """
    ends = np.stack([start, goal])
    if np.abs(goal - start).max() < STILL:
        return None

    def timed(limits: MotionLimits) -> Movement | None:
        quickest = _quickest(ends, limits, context)
        requested = context.options.duration
        if quickest is None or 0.0 < requested < quickest.duration * (1.0 - DURATION_SLACK):
            return None
        return Movement(ends, at_best_duration(quickest, context), context)

    movement = within_torque(timed, context)
    return movement if movement is not None and movement.prove_torque().violation is None else None


def baseline_costs_at_least(start: FloatArray, goal: FloatArray, context: Context) -> float:
    """About what the baseline from `start` to `goal` (n,) costs at least: without limits of
    torque.
    """
    ends = np.stack([start, goal])
    law = free_law(path_limits(goal - start, context.limits))
    at_limits = blended(TimedPath(ends, (StepLaws((law,)),), ()), context.joint_names)
    return least_stretched_cost(at_limits, context)


def _quickest(ends: FloatArray, limits: MotionLimits, context: Context) -> JointTrajectory | None:
    """The law at the limits, uniformly slowed by no more than its torque asks for."""
    law = free_law(path_limits(ends[1] - ends[0], limits))
    at_limits = slowed_for_tool(
        blended(TimedPath(ends, (StepLaws((law,)),), ()), context.joint_names), context
    )

    def use_at(factor: float) -> float:
        trajectory = stretched(at_limits, factor)
        return (
            float(torque_per_segment(trajectory, context.scene.dynamics).max())
            / limits.torque_share
        )

    # too fast, and the use of torque there
    fast = 1.0
    beyond = use_at(1.0)
    if beyond <= 1.0:
        return at_limits
    for _ in range(_ROUNDS):
        slow = fast * float(np.sqrt(beyond)) * _BELOW
        within = use_at(slow)
        if within <= 1.0:
            break
        fast = slow
        beyond = within
    else:
        return None
    for k in range(_REFINEMENTS):
        if within >= _NEAR:
            break
        # torque is about a constant and a part that falls with the square of the factor; its
        # envelope has kinks, so that every second time the middle is taken
        share = 0.5 if k % 2 else (1.0 - within) / (beyond - within)
        squares = 1.0 / (slow * slow) + share * (1.0 / (fast * fast) - 1.0 / (slow * slow))
        factor = float(1.0 / np.sqrt(squares)) * _BELOW
        use = use_at(factor)
        if use <= 1.0:
            slow = min(factor, slow)
            within = use
        else:
            fast = factor
            beyond = use
    return stretched(at_limits, slow)
