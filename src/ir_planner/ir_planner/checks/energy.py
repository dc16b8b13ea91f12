"""Energy of a trajectory at the mains: torque of every axis, their DC link, and what is
always drawn.

Energy = base + sum of the axes (signed) + dissipated + change of the capacitor, and what the
rectifier loses where its efficiency is below 1. The power is taken at the middles of steps of at
most 1 ms. Alone, a movement starts with an empty capacitor; what is left in it at the end is not
credited, but given to the next movement of a program (`carried`).
"""

from typing import NamedTuple

import numpy as np

from ir_kernels import dc_bus
from ir_kernels.power import DcBus
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import extremes, motion_at
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

STEP_S = 1e-3
_PIECE = 20_000  # samples at a time: an hour has millions


class MovementEnergy(NamedTuple):
    """Joules of a movement: total at the mains, base load, per joint (n,) at the DC link (signed),
    dissipated, capacitor.

    dt [s]: of the steps; times (N,) s (their middles) and watts (N,) at the mains: its profile;
    axes (N,) W: what all joints together take from the DC link (none: where nothing is shared).
    """

    total: float
    base: float
    joints: FloatArray
    dissipated: float
    capacitor: float
    dt: float
    times: FloatArray
    watts: FloatArray
    axes: FloatArray


def movement_energy(
    trajectory: JointTrajectory, scene: PlanningScene, step: float = STEP_S
) -> MovementEnergy:
    """Energy of a trajectory (as it is interpolated) with the loads of the scene."""
    begin = float(trajectory.times[0])
    span = trajectory.duration - begin
    count = max(int(np.ceil(span / step - 1e-9)), 1)
    dt = span / count
    times: FloatArray = begin + (np.arange(count, dtype=np.float64) + 0.5) * dt
    pieces = [times[k : k + _PIECE] for k in range(0, count, _PIECE)]
    axes = np.concatenate([_axis_power(trajectory, scene, piece) for piece in pieces])
    if dt <= 0.0:  # a single point: nothing lasts
        nothing = np.zeros(0)
        return MovementEnergy(
            0.0, 0.0, np.zeros(axes.shape[1]), 0.0, 0.0, dt, nothing, nothing, nothing
        )
    bus = dc_bus(axes, dt, scene.dc_bus)
    shares = scene.dc_bus.regeneration != "none"
    taken = axes.sum(axis=1) if shares else np.zeros(0)
    return _on_bus(bus, dt, scene, axes.sum(axis=0) * dt, times, taken)


def carried(energy: MovementEnergy, charge: float, scene: PlanningScene) -> MovementEnergy:
    """The same movement begun with `charge` J in the capacitor."""
    if charge <= 0.0 or not len(energy.axes):
        return energy
    bus = dc_bus(energy.axes[:, None], energy.dt, scene.dc_bus, charge)
    return _on_bus(bus, energy.dt, scene, energy.joints, energy.times, energy.axes)


def _on_bus(
    bus: DcBus,
    dt: float,
    scene: PlanningScene,
    joints: FloatArray,
    times: FloatArray,
    axes: FloatArray,
) -> MovementEnergy:
    """Joules of a movement from what its axes drew of the DC link: the rectifier loses its share
    in either direction, and the base load of controller and tool is added. Steps last dt s.
    """
    base = scene.base_watts
    efficiency = scene.drives.rectifier_efficiency
    watts = np.where(bus.mains > 0.0, bus.mains / efficiency, bus.mains * efficiency) + base
    return MovementEnergy(
        total=float(watts.sum() * dt),
        base=base * dt * len(times),
        joints=joints,
        dissipated=float(bus.dissipated.sum() * dt),
        capacitor=float(bus.stored[-1]),
        dt=dt,
        times=times,
        watts=watts,
        axes=axes,
    )


def _axis_power(trajectory: JointTrajectory, scene: PlanningScene, times: FloatArray) -> FloatArray:
    """What each axis takes from the DC link (N, n) W at times (N,) s."""
    motion = motion_at(trajectory, times)
    torque = scene.dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    return scene.dynamics.axis_power(motion.qd, torque)


def holding_watts(q: FloatArray, scene: PlanningScene) -> float:
    """Mains power [W] while the motors hold the arm still at q (n,): base load and copper
    losses.
    """
    rest = np.zeros((1, len(q)))
    torque = scene.dynamics.inverse_dynamics(q[None], rest, rest)
    holding = float(scene.dynamics.axis_power(rest, torque).sum())
    return scene.base_watts + holding / scene.drives.rectifier_efficiency


# The peak power is a bound that holds at every instant. Over short pieces of time the power of the
# axes is bounded by interval arithmetic. The bus' capacitor gives its charge before the mains give
# anything. With those bounds as powers it is emptied sooner than it is, so where it is not empty
# after a piece, the mains gave nothing in it.

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
    most = scene.dynamics.coupling.most(speed)
    return float(scene.dynamics.losses_at(most, torque).sum())
