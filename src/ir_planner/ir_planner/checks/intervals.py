"""Intervals of energies: what the uncertainty of the power parameters leaves open.

Mains energy is piecewise linear in powers. What a joule more from the DC link costs at the mains is
1 while the mains feed it, 0 while the surplus is dissipated, and what the next such time says while
the capacitor does both. So one pass over the samples of a movement gives its derivative by each
power parameter, and the energies of many robots are one product with it. Slopes are taken at the
mean of the drawn robots, where optimised movements no longer balance between drawing power and
dissipating it.

All energies of one set of parameters are sampled over the same drawn robots, so that a difference
of two energies has an interval of its own, mostly far narrower than theirs.
"""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ir_description import PowerParameters
from ir_description.robot import AXIS_UNITS, IDLE, LINK, drawn_robots, interval_over
from ir_kernels import dc_bus, portable
from ir_kernels.power import DcBus
from ir_msgs_py.trajectory import JointTrajectory, MotionSamples
from ir_planner.curves import motion_at
from ir_planner.scene import CENTRE_STEP, RUNNING, PlanningScene
from ir_values.arrays import FloatArray

STEP_S = 8e-3  # intervals need no finer samples than these
_MOST = 20_000  # samples: what lasts longer is sampled more coarsely


class Sampled(NamedTuple):
    """A motion at the middles of N steps of dt s, and how long it takes [s]."""

    motion: MotionSamples
    dt: float
    span: float

    @staticmethod
    def of(trajectory: JointTrajectory) -> "Sampled":
        """Of a trajectory; no samples where nothing lasts."""
        begin = float(trajectory.times[0])
        span = trajectory.duration - begin
        count = int(np.clip(np.ceil(span / STEP_S), 1, _MOST)) if span > 0.0 else 0
        dt = span / max(count, 1)
        return Sampled(motion_at(trajectory, begin + (np.arange(count) + 0.5) * dt), dt, span)


def sampled_energy(at: Sampled, scene: PlanningScene) -> float:
    """Energy [J] at the mains of a sampled motion, with the loads of the scene."""
    if at.span <= 0.0:
        return 0.0
    _, _, bus = _powers(at, scene)
    return (
        _joules_drawn(bus, at.dt) / scene.drives.rectifier_efficiency + scene.base_watts * at.span
    )


def energy_and_slope(at: Sampled, scene: PlanningScene) -> tuple[float, FloatArray]:
    """Energy [J] at the mains with the loads of the scene, and d energy / d parameter (P,), J per
    unit.
    """
    if at.span <= 0.0:
        return 0.0, np.zeros(len(scene.parameters.names))
    torque, power, bus = _powers(at, scene)
    efficiency = scene.drives.rectifier_efficiency
    energy = _joules_drawn(bus, at.dt) / efficiency + scene.base_watts * at.span
    price = _price(power, bus, scene) * (at.dt / efficiency)
    slope = _axis_slope(_States(at.motion, torque, price), scene)
    slope[scene.parameters.index(LINK)] = -_emptied(bus, scene) / efficiency
    slope[scene.parameters.index("rectifier_efficiency")] = -_joules_drawn(bus, at.dt) / (
        efficiency * efficiency
    )
    return energy, slope + standing_slope(at.span, scene)


def _powers(at: Sampled, scene: PlanningScene) -> tuple[FloatArray, FloatArray, DcBus]:
    """Torque (N, n) Nm, power of the axes (N, n) W, and what the DC link makes of it."""
    motion = at.motion
    torque = scene.dynamics.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    power = scene.dynamics.axis_power(motion.qd, torque)
    return torque, power, dc_bus(power, at.dt, scene.dc_bus)


def _joules_drawn(bus: DcBus, dt: float) -> float:
    """Joules that the DC link takes from the rectifier, less those that go back."""
    return float(bus.mains.sum()) * dt


def holding_slope(q: FloatArray, scene: PlanningScene) -> FloatArray:
    """d watts / d parameter (P,) of motors that hold the arm still at q (n,), W per unit."""
    rest = np.zeros((1, len(q)))
    motion = MotionSamples(q[None], rest, rest, rest)
    torque = scene.dynamics.inverse_dynamics(q[None], rest, rest)
    efficiency = scene.drives.rectifier_efficiency
    slope = _axis_slope(_States(motion, torque, np.full((1, len(q)), 1.0 / efficiency)), scene)
    drawn = float(scene.dynamics.axis_power(rest, torque).sum())
    slope[scene.parameters.index("rectifier_efficiency")] = -drawn / (efficiency * efficiency)
    return slope + standing_slope(1.0, scene)


def standing_slope(
    seconds: float, scene: PlanningScene, mode: str = RUNNING, *, drive_bus: bool = True
) -> FloatArray:
    """d energy / d parameter (P,) of controller, drives and tool over some seconds in a mode."""
    parameters = scene.parameters
    slope = np.zeros(len(parameters.names))
    slope[parameters.index(f"watts.{mode}")] = seconds
    slope[parameters.index("drives_watts")] = seconds if mode == RUNNING else 0.0
    share = max(parameters.value("tool_watts"), 1e-9)
    slope[parameters.index("tool_watts")] = scene.tool_watts(drive_bus=drive_bus) * seconds / share
    return slope


class _States(NamedTuple):
    """motion, torque (N, n) Nm, and price (N, n): mains joules per watt of an axis in a sample."""

    motion: MotionSamples
    torque: FloatArray
    price: FloatArray


def _price(power: FloatArray, bus: DcBus, scene: PlanningScene) -> FloatArray:
    """What a joule more of each axis costs at the mains (N, n), before the rectifier."""
    if scene.dc_bus.regeneration == "none":
        return np.asarray(power > 0.0, dtype=np.float64)
    decided = (bus.mains != 0.0) | (bus.dissipated > 0.0)
    places = np.where(decided, np.arange(len(decided)), len(decided))
    following = np.minimum.accumulate(places[::-1])[::-1]  # what is left at the end is not credited
    known = np.append((bus.mains != 0.0).astype(np.float64), 0.0)
    return np.repeat(known[following][:, None], power.shape[1], axis=1)


def _emptied(bus: DcBus, scene: PlanningScene) -> float:
    """Joules that a link of twice the size would have given (by its slope): what it holds, each
    time that the mains feed again after it was full.
    """
    if scene.dc_bus.regeneration == "none":
        return 0.0
    decided = np.where(bus.mains != 0.0, 1, -1)[(bus.mains != 0.0) | (bus.dissipated > 0.0)]
    return float(np.count_nonzero(np.diff(decided) > 0) * scene.power.dc_link_capacity_energy)


def _axis_slope(at: _States, scene: PlanningScene) -> FloatArray:
    """Derivatives [J per unit of the parameter] of the energy by all parameters: the part of
    friction, losses and masses; rectifier and constant watts are zero.
    """
    parameters = scene.parameters
    model = scene.dynamics
    d = scene.dynamics.data
    q = at.motion.q
    qd = d.coupling.motors(at.motion.qd)  # of the motors
    qdd = d.coupling.motors(at.motion.qdd)
    speed = np.abs(qd)
    size = np.abs(at.torque)
    ratio = np.abs(d.gear_ratio)
    sign = np.sign(at.torque)
    losses = d.inverter_loss / ratio + d.gear_loss * speed
    copper = 2.0 * d.copper_loss / (ratio * ratio) * at.torque
    of_torque = at.price * (qd + copper + sign * losses)
    direction = np.sign(qd)
    slope = np.zeros(len(parameters.names))
    axes = {
        "viscous": of_torque * qd,
        "coulomb": of_torque * direction,
        "copper": at.price * np.square(size / ratio),
        "iron": at.price * (speed * speed),
        "inverter": at.price * size / ratio,
        "gear": at.price * size * speed,
    }
    for term in AXIS_UNITS:
        slope[parameters.places(term)] = axes[term].sum(axis=0)
    slope[parameters.index(IDLE)] = at.price.mean(axis=1).sum()  # of all axes alike

    # torques that grow in proportion to one parameter
    rotor = d.rotor_inertia * qdd
    balance = d.coupling.motor_torque(model.counterbalance(q))
    body = at.torque - rotor - d.viscous * qd - d.coulomb * direction + balance
    carried = _load_torque(at, scene)
    proportional = {
        "rotor_inertia": rotor,
        "counterbalance": -balance,
        "load_mass": carried,
        "link_mass": body - carried,
    }
    for name, torque in proportional.items():
        value = max(parameters.value(name), 1e-9)
        slope[parameters.index(name)] = float((of_torque * torque).sum()) / value

    # centres of mass: by differences, as they change torques in no simple way
    motion = at.motion[:3]
    for k, (less, more) in scene.moved_centres.items():
        moved = more.inverse_dynamics(*motion) - less.inverse_dynamics(*motion)
        slope[k] = float((of_torque * moved).sum()) / CENTRE_STEP
    return slope


def _load_torque(at: _States, scene: PlanningScene) -> FloatArray:
    """The part of the torque (N, n) that is due to what is attached."""
    if not scene.loads:
        return np.zeros_like(at.torque)
    return at.torque - scene.unloaded.inverse_dynamics(*at.motion[:3])


class JouleInterval(NamedTuple):
    """5 % and 95 % quantile, J."""

    low: float
    high: float


@lru_cache(maxsize=16)
def expected(parameters: PowerParameters) -> PowerParameters:
    """The mean of the drawn robots: more than the parameters' mean where a loss can only be
    larger.
    """
    return replace(parameters, mean=drawn_robots(parameters).mean(axis=0))


@lru_cache(maxsize=64)
def expected_scene(scene: PlanningScene) -> PlanningScene:
    """The scene with the mean of the drawn robots."""
    mean = expected(scene.parameters)
    drives = replace(scene.drives, parameters=mean)
    return replace(scene, drives=drives, power=mean.power_with(scene.power))


def spread(slope: FloatArray, parameters: PowerParameters) -> FloatArray:
    """What the drawn robots add (ROBOTS,) J to an energy that is linear with this slope (P,)."""
    return portable.matmul(drawn_robots(parameters) - parameters.mean, slope)


def movement_spread(trajectory: JointTrajectory, scene: PlanningScene) -> FloatArray:
    """What the drawn robots add (ROBOTS,) J to the energy of a movement."""
    at = Sampled.of(trajectory)
    there = expected_scene(scene)
    expected_energy, slope = energy_and_slope(at, there)
    drawn = drawn_robots(scene.parameters) - there.parameters.mean
    return expected_energy - sampled_energy(at, scene) + portable.matmul(drawn, slope)


def interval(nominal: float, added: FloatArray) -> JouleInterval:
    """The 90 % interval of an energy [J] to which the drawn robots add `added` (ROBOTS,) J; it
    holds the nominal one.
    """
    return JouleInterval(*interval_over(nominal, added))
