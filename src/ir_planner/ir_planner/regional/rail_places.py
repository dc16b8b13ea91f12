"""Where a rail stands at a pose that leaves it open: configurations over its travel, ordered by
about what the straight movement to each of them costs.

W of eq. (9) weighs a metre of the rail by the masses that it moves, which says little of joules and
seconds. The places beside the cheapest ones are looked at again, more finely.
"""

import numpy as np

from ir_kernels import portable
from ir_planner.configurations import Configurations, free_configurations, joined
from ir_planner.request import Context
from ir_planner.scene import movement_cost
from ir_values.arrays import FloatArray, IntArray

# Largest speed, acceleration and jerk of the law 10 u^3 - 15 u^4 + 6 u^5 from 0 to 1 in 1 s.
_SPEED = 1.875
_ACCELERATION = 10.0 / np.sqrt(3.0)
_JERK = 60.0
_SAMPLES = 16
_SHORTEST = 1e-3  # s: where a goal is the start
_SLOWER = (1.0, 1.15, 1.35, 1.7, 2.3, 4.0)  # times the quickest: J is flat about its least
_BEST = 3  # places beside which more are looked at
_FINE = np.array([-0.2, -0.15, -0.1, -0.05, 0.05, 0.1, 0.15, 0.2])  # m
_NEARER = 0.25  # m between the first few places, which differ little
_APART = 0.5  # m between others
_FIRST = 4
_DIFFERENT = 6


def straight_costs(start: FloatArray, goals: FloatArray, context: Context) -> FloatArray:
    """About what straight movements from start (n,) to goals (K, n) cost (K,) by the objective,
    with one law for all joints and at the duration that serves best; no limits of torque.
    """
    scene = context.scene
    options = context.options
    step = goals - start
    away = np.abs(step)
    limits = context.limits
    quickest = np.maximum(
        np.maximum(
            _SPEED * away / limits.velocity, np.sqrt(_ACCELERATION * away / limits.acceleration)
        ),
        portable.cbrt(_JERK * away / limits.jerk),
    ).max(axis=1, initial=_SHORTEST)
    if options.duration <= 0.0 and options.objective == "movement_cost":
        return movement_cost(scene.weights, start, goals)
    if options.duration <= 0.0 and options.objective == "time":
        return np.asarray(quickest)
    if options.duration > 0.0:
        return _joules(start, step, np.maximum(quickest, options.duration), context)
    second = options.time_value if options.objective == "time_and_energy" else 0.0
    costs = [
        _joules(start, step, quickest * slower, context) + second * quickest * slower
        for slower in _SLOWER
    ]
    return np.asarray(np.min(costs, axis=0))


def _joules(
    start: FloatArray, step: FloatArray, seconds: FloatArray, context: Context
) -> FloatArray:
    """What the drives take (K,) for steps (K, n) from start (n,) in so many seconds (K,)."""
    u = (np.arange(_SAMPLES) + 0.5)[:, None] / _SAMPLES
    along = step[:, None]
    rate = 1.0 / seconds[:, None, None]
    q = start + u * u * u * (10.0 - 15.0 * u + 6.0 * u * u) * along
    qd = 30.0 * u * u * (1.0 - u) * (1.0 - u) * along * rate
    qdd = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * along * (rate * rate)
    n = len(start)
    flat = (np.ascontiguousarray(each.reshape(-1, n)) for each in (q, qd, qdd))
    power = portable.matmul(context.scene.dynamics.drive_power(*flat), np.ones(n))
    taken = np.maximum(power.reshape(-1, _SAMPLES), 0.0)
    return np.asarray(portable.matmul(taken, np.full(_SAMPLES, 1.0 / _SAMPLES)) * seconds)


def configurations_over(pose: FloatArray, start: FloatArray, context: Context) -> Configurations:
    """All free configurations (K, 7) of a pose (4, 4) from `start` (7,) on, cheapest first, with
    different ones in front: a search takes the first few.
    """
    scene = context.scene
    threshold = context.thresholds()
    found = free_configurations(pose, scene, threshold, start)
    if len(found.q) == 0:
        return found
    costs = straight_costs(start, found.q, context)
    robot = scene.cell.robot
    best = np.unique(found.q[np.argsort(costs, kind="stable"), 0][:_BEST])
    beside = (best[:, None] + _FINE).ravel()
    within = (beside >= robot.position_min[0]) & (beside <= robot.position_max[0])
    finer = free_configurations(pose, scene, threshold, start, np.unique(beside[within]))
    found = joined(found, finer)
    return found.ordered(_varied(found, straight_costs(start, found.q, context)))


def _varied(found: Configurations, costs: FloatArray) -> IntArray:
    """The order of configurations by their costs (K,), different ones in front."""
    order = np.argsort(costs, kind="stable")
    first: list[int] = []
    for k in order:
        apart = _NEARER if len(first) < _FIRST else _APART
        if all(
            abs(found.q[k, 0] - found.q[other, 0]) >= apart
            or found.branch[k] != found.branch[other]
            for other in first
        ):
            first.append(int(k))
        if len(first) == _DIFFERENT:
            break
    rest = [int(k) for k in order if int(k) not in first]
    return np.array([*first, *rest], dtype=np.int64)
