"""The largest power at the mains along a trajectory: a bound that holds at every instant.

Over short pieces of time the power of the axes is bounded by interval arithmetic. The bus'
capacitor gives what it has before the mains do. With those bounds as powers it is emptied sooner
than it is, so where it is not empty after a piece, the mains gave nothing in it.
"""

import numpy as np

from ir_kernels import dc_bus
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes
from ir_planner.scene import PlanningScene

_PIECE_S = 4e-3  # the bound is too large by 0.1 % of the power, or less
_MOST = 200_000  # pieces: what lasts longer than minutes changes its power slowly


def peak_power(trajectory: JointTrajectory, scene: PlanningScene, charge: float = 0.0) -> float:
    """Watts that are never exceeded, base load included; begun with `charge` J in the capacitor."""
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return 0.0
    longest = max(_PIECE_S, float(durations.sum()) / _MOST)
    bounds = scene.dynamics.power_bounds(coefficients, durations, longest)
    further = _further(trajectory, scene)
    efficiency = scene.drives.rectifier_efficiency
    if scene.dc_bus.regeneration == "none":
        return scene.base_watts + max(float(bounds.taken.max()) + further, 0.0) / efficiency
    net = bounds.net + further
    stored = dc_bus(net[:, None], bounds.seconds, scene.dc_bus, charge).stored
    drawn = net[stored <= 0.0]
    return scene.base_watts + max(float(drawn.max(initial=0.0)), 0.0) / efficiency


def _further(trajectory: JointTrajectory, scene: PlanningScene) -> float:
    """Watts that the losses of iron, inverters and gears never exceed: at full speed with the full
    torque.
    """
    if not scene.dynamics.lossy:
        return 0.0
    coefficients, durations = trajectory.coefficients()
    speed = extremes(coefficients, durations).velocity.max(axis=0, keepdims=True)
    share = np.asarray(scene.dynamics.torque_bounds(coefficients, durations).upper)
    torque = share * scene.dynamics.torque_limit(np.zeros_like(speed))
    return float(scene.dynamics.further_losses(speed, torque).sum())
