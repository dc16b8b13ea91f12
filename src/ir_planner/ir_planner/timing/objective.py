"""Objective of a movement, and the stretch of its duration that serves it best.

movement_cost: W of eq. (9); time: T; energy: E_drive, what the drives take from the mains;
time_and_energy: J = E_drive + time_value x T. What controller and tool always draw is in neither:
it is part of what a second is worth.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ir_kernels import dc_bus, portable
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import Consumption, ToolUse, movement_energy
from ir_planner.curves import motion_at
from ir_planner.errors import RequestError
from ir_planner.request import DURATION_MAX, Context
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.timing.blended_steps import stretched
from ir_values.arrays import FloatArray

_FACTORS = np.array([1.0, 1.04, 1.1, 1.18, 1.3, 1.5, 1.8, 2.2])
# where a second costs what holding costs, and no more
_SLOWER = np.array([*_FACTORS, 3.0, 4.0, 6.0, 9.0, 14.0])
# so near that the least cost is hardly missed; how many for J
_CLOSE = portable.power(1.05, np.arange(54.0))
_USUAL = 18
_REFINED = 5
_COARSE_STEP = 4e-3  # s: energies are compared, not reported
_BOUND_STEP = 10e-3  # s: of a bound that is about right
# of a movement that is short, or lasts long
_FEWEST_STEPS = 100
_MOST_STEPS = 5000
_USUAL_WATTS = 4.0  # times the price of a second: about what the drives of an arm take in motion
_BESIDE = 5e-3  # weight of what breaks ties

Consumed = TrajectoryReport | Consumption


def drive_energy(report: Consumed) -> float:
    """E_drive [J]: at the mains, without what controller and tool always draw."""
    return report.energy - report.base_energy


def objective_value(report: Consumed, objective: str, time_value: float) -> float:
    """What is minimised; ties between equal W are broken by time."""
    values = {
        "movement_cost": report.movement_cost * (1.0 + 1e-6 * report.duration),
        "time": report.duration,
        "energy": drive_energy(report),
        "time_and_energy": drive_energy(report) + time_value * report.duration,
    }
    return values[objective]


def at_the_mains(context: Context) -> Context:
    """The same request, free in its duration, for E_mains: a second costs what is always drawn."""
    options = replace(
        context.options,
        objective="time_and_energy",
        duration=0.0,
        time_value=context.scene.base_watts,
    )
    return replace(context, options=options)


def request_cost(report: Consumed, options: PlanOptions) -> float:
    """What a request minimises: its objective, or E_drive where it asks for a duration."""
    if options.duration > 0.0:
        return drive_energy(report)
    return objective_value(report, options.objective, options.time_value)


class ObjectiveWeights(NamedTuple):
    """Cost of a joule of the drives, of a second, and of a rad of each joint (n,); `power`: about
    what a second of movement costs in all.
    """

    energy: float
    time: float
    travel: FloatArray
    power: float


def objective_weights(context: Context, path: FloatArray) -> ObjectiveWeights:
    """The objective as a sum that a descent can follow, for movements near `path` (M, n); with a
    requested duration only joules are left to choose.
    """
    options = context.options
    scene = context.scene
    watts = _USUAL_WATTS * scene.cell.robot.time_value
    still = np.zeros(len(scene.weights))
    if options.duration > 0.0 or options.objective == "energy":
        return ObjectiveWeights(1.0, 0.0, still, watts)
    if options.objective == "time":
        return ObjectiveWeights(_BESIDE, watts, still, watts)
    if options.objective == "movement_cost":  # in watts for a path of a second
        travel = scene.weights * (watts / max(path_cost(scene.weights, path), 1e-9))
        return ObjectiveWeights(0.0, 10.0 * _BESIDE * watts, travel, watts)
    return ObjectiveWeights(1.0, options.time_value, still, watts + options.time_value)


def coarse_step(trajectory: JointTrajectory) -> float:
    """Seconds between the samples by which movements are compared."""
    return max(_COARSE_STEP, trajectory.duration / _MOST_STEPS)


def coarse_energy_cost(trajectory: JointTrajectory, context: Context) -> float:
    """J of a trajectory as it is, or E_drive where the objective is not J; sampled coarsely."""
    joules = _coarse_drives(trajectory, context)
    if context.options.objective == "time_and_energy":
        return joules + context.options.time_value * trajectory.duration
    return joules


def _coarse_drives(trajectory: JointTrajectory, context: Context) -> float:
    energy = movement_energy(trajectory, context.scene, coarse_step(trajectory))
    return energy.total - energy.base


def coarse_cost(trajectory: JointTrajectory, context: Context) -> float:
    """What a request minimises, for comparisons: energies and path lengths are sampled coarsely."""
    weights = context.scene.weights
    if context.options.duration > 0.0:
        return _coarse_drives(trajectory, context)
    if context.options.objective == "time":
        return trajectory.duration
    if context.options.objective == "movement_cost":
        times = np.arange(trajectory.times[0], trajectory.times[-1], coarse_step(trajectory))
        return path_cost(weights, trajectory.sample(times).q) * (1.0 + 1e-6 * trajectory.duration)
    return coarse_energy_cost(trajectory, context)


def least_stretched_cost(fastest: JointTrajectory, context: Context) -> float:
    """About what a trajectory costs at the stretch that serves the objective best, or at the
    requested duration; no torque is asked for, so nobody who must keep it costs less.
    """
    options = context.options
    if options.duration > 0.0:
        factors = np.array([options.duration / fastest.duration])
    elif options.objective in ("time", "movement_cost"):
        return coarse_cost(fastest, context)
    else:
        factors = _CLOSE[: None if options.objective == "energy" else _USUAL]
    return float(stretched_costs(fastest, factors, context, _BOUND_STEP).min())


def best_stretch(fastest: JointTrajectory, context: Context) -> float:
    """Factor >= 1 on the duration of the fastest movement that minimises the objective."""
    if context.options.objective in ("time", "movement_cost"):
        return 1.0
    factors = _SLOWER if context.options.objective == "energy" else _FACTORS
    costs = stretched_costs(fastest, factors, context)
    k = int(np.argmin(costs))
    around = np.linspace(
        factors[max(k - 1, 0)], factors[min(k + 1, len(factors) - 1)], _REFINED + 2
    )[1:-1]
    refined = stretched_costs(fastest, around, context)
    best = int(np.argmin(refined))
    return float(around[best]) if refined[best] < costs[k] else float(factors[k])


def stretched_costs(
    fastest: JointTrajectory, factors: FloatArray, context: Context, step: float = _COARSE_STEP
) -> FloatArray:
    """J, or E_drive where the objective is not J (F,), of a trajectory stretched by `factors` (F,);
    all of them from the same samples.
    """
    scene = context.scene
    begin = float(fastest.times[0])
    span = fastest.duration - begin
    count = int(np.clip(np.ceil(span / step), _FEWEST_STEPS, _MOST_STEPS))
    motion = motion_at(fastest, begin + (np.arange(count) + 0.5) * (span / count))
    slower = factors[:, None, None]
    still = np.zeros_like(motion.q)
    drives = scene.dynamics.data
    speed = motion.qd / slower
    # what holds the arm and dry friction stay, the viscous one falls with the speed, the rest with
    # its square
    holding = scene.dynamics.inverse_dynamics(motion.q, still, still)
    turning = drives.coupling.motors(motion.qd)
    viscous = drives.viscous * turning
    dry = drives.coulomb * np.sign(turning)
    whole = scene.dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    torque = (
        (whole - holding - viscous - dry) / (slower * slower) + viscous / slower + (holding + dry)
    )
    shape = (len(factors) * count, -1)
    axes = scene.dynamics.axis_power(speed.reshape(shape), torque.reshape(shape))
    joules = _mains_joules(axes.reshape(len(factors), count, -1), factors * span / count, scene)
    options = context.options
    free = options.duration <= 0.0 and options.objective == "time_and_energy"
    per_second = options.time_value if free else 0.0
    return joules + per_second * factors * span


def _mains_joules(axes: FloatArray, steps: FloatArray, scene: PlanningScene) -> FloatArray:
    """Joules (F,) at the mains of F motions with the powers (F, N, n) W of their axes over steps
    (F,) s.

    The bus takes them one after the other; a step between two of them empties its capacitor.
    """
    motions, count, n = axes.shape
    emptying = np.zeros((motions, 1, n))
    emptying[:, 0, 0] = 2.0 * scene.dc_bus.capacity_energy / steps
    power = np.concatenate([axes, emptying], axis=1).reshape(-1, n)
    bus = dc_bus(power, np.repeat(steps, count + 1), scene.dc_bus)
    return np.asarray(bus.mains.reshape(motions, count + 1)[:, :-1].sum(axis=1) * steps)


DURATION_SLACK = 1e-6  # relative: what rounding to nanoseconds may add to a duration


def check_duration(duration: float, context: Context) -> None:
    """Raise RequestError where a movement would last longer than any may."""
    options = context.options
    if duration > DURATION_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"velocity_scaling {options.velocity_scaling:g} and acceleration_scaling "
            f"{options.acceleration_scaling:g}{_and_tool(context)} make a movement of "
            f"{duration:.4g} s: it must be at most {DURATION_MAX:g} s",
        )


def _and_tool(context: Context) -> str:
    """What bounds the tool, as a sentence goes on; "": nothing."""
    bounds = context.tool_bounds
    return f" and {bounds.text()}" if bounds.asked else ""


def check_requested(shortest: float, context: Context) -> None:
    """Raise RequestError where a duration is requested that is shorter than the shortest [s] that
    was found.
    """
    options = context.options
    if options.duration > 0.0 and shortest * (1.0 - DURATION_SLACK) > options.duration:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"duration is {options.duration:g} s: the shortest found within the limits"
            f"{_and_tool(context)} is {shortest:.4g} s{_unfinished(context)}",
        )


def _unfinished(context: Context) -> str:
    """What ended the search for a shorter movement before all was tried; "": nothing."""
    ceiling = context.work.ended_by
    return f"; {ceiling} ended before all was tried: more of it may help" if ceiling else ""


def slowed_for_tool(trajectory: JointTrajectory, context: Context) -> JointTrajectory:
    """The trajectory, evenly slower where its tool would be faster than it may be."""
    bounds = context.tool_bounds
    if not bounds.asked:
        return trajectory
    longer = float(ToolUse(trajectory, context.scene, bounds).longer.max(initial=0.0))
    return stretched(trajectory, longer) if longer > 1.0 else trajectory


def at_best_duration(quickest: JointTrajectory, context: Context) -> JointTrajectory:
    """The fastest trajectory at the requested duration, or at the one that the objective likes
    best.

    Raises RequestError when the requested duration is shorter than the fastest, or that longer than
    any may be.
    """
    options = context.options
    quickest = slowed_for_tool(quickest, context)
    check_duration(quickest.duration, context)
    check_requested(quickest.duration, context)
    if options.duration > 0.0:
        return stretched(quickest, max(options.duration / quickest.duration, 1.0))
    return stretched(quickest, best_stretch(quickest, context))
