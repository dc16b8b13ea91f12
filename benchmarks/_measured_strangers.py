"""Robots that are not in the repository, drawn at random, and what a meter would read of them.

The plant shares no code with the model that is fitted: torques by Pinocchio, with friction, losses,
DC link and meter of this module. What the fit is given is what a stranger knows: the kinematics, a
total mass spread by guess, and drives estimated from their peak torques.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from _measured_robots import estimated

from ir_description import RobotModel, load_robot
from ir_description.robot import without_table
from ir_recorder.measure import Samples, samples_of
from ir_recorder.traces import Trace
from ir_values.arrays import FloatArray

DT = 0.004  # s: of the plant
LOGGED = 2  # of its steps between rows of the log
READING = 25  # of its steps between readings of the meter
MODES = ("STAND_ON_MOTORS",)
_REST = 10.0  # s before and after
_STIFF = 2e-3  # rad/s over which dry friction changes its sign


@dataclass(frozen=True, eq=False)
class Stranger:
    """What is known of a robot, and the figures of the one that stands there."""

    known: RobotModel
    carries: float  # kg, rated
    masses: FloatArray  # (n,) factors
    centres: FloatArray  # (n, 3) m
    payload: float  # kg, which nobody told
    viscous: FloatArray
    coulomb: FloatArray
    stick: FloatArray  # of coulomb, near rest
    warm: float  # of viscous, at the start
    rotors: FloatArray  # factors
    copper: FloatArray  # W/Nm^2 of the motor
    switching: FloatArray  # W/Nm
    iron: FloatArray  # W s^2/rad^2 of the joint
    gears: tuple[float, float]  # share of the torque lost, driven and driven back
    capacity: float  # J
    lower: float  # of it, at which the chopper opens again
    efficiency: float
    standing: float  # W


def stranger(seed: int, far: float = 1.0) -> Stranger:
    """A robot of a payload between 4 and 200 kg; far: times the usual deviation from what is
    known.
    """
    rng = np.random.default_rng(seed)
    payload = float(np.exp(rng.uniform(np.log(4.0), np.log(200.0))))
    return standing_for(_built(payload, rng), payload, rng, far)


def standing_for(
    known: RobotModel, payload: float, rng: np.random.Generator, far: float = 1.0
) -> Stranger:
    """A robot of which `known` is known, for a payload [kg], with figures of its own; far: times
    the usual deviation.
    """
    n = known.n

    def spread(deviation: float) -> FloatArray:
        return rng.lognormal(0.0, far * deviation, n)

    peak = known.envelope_torque[:, 0]
    swing = 0.5 * known.reflected_inertia * known.velocity_max**2
    return Stranger(
        known=known,
        carries=payload,
        masses=spread(0.15),
        centres=rng.normal(0.0, far * 0.02 * payload**0.2, (n, 3)),
        payload=far * rng.uniform(0.0, 0.3) * payload,
        viscous=known.friction_viscous * spread(0.6),
        coulomb=known.friction_coulomb * spread(0.5),
        stick=rng.uniform(0.05, 0.3, n),
        warm=rng.uniform(0.0, 0.2),
        rotors=spread(0.2),
        copper=known.copper_loss * spread(0.3),
        switching=rng.uniform(0.3, 2.5, n),
        iron=0.004 * peak / known.velocity_max * spread(0.4),
        gears=(rng.uniform(0.0, 0.04), rng.uniform(0.0, 0.06)),
        capacity=float(swing[:3].max() * rng.uniform(0.2, 1.5)),
        lower=rng.uniform(0.7, 0.95),
        efficiency=rng.uniform(0.93, 0.99),
        standing=rng.uniform(60.0, 450.0),
    )


def _built(payload: float, rng: np.random.Generator) -> RobotModel:
    """Six axes as most robots have them, of a size that goes with the payload, drives estimated."""
    reach = 0.75 * payload**0.25 * rng.uniform(0.85, 1.15)
    total = 13.0 * payload**0.85
    upper, fore = rng.uniform(0.4, 0.5, 2) * reach
    elbow = 0.1 * reach
    wrist = 0.09 * reach
    places = np.array(
        [
            (0.0, 0.0, 0.3 * reach),
            (rng.uniform(0.0, 0.2) * reach, 0.0, 0.15 * reach),
            (0.0, 0.0, upper),
            (0.3 * fore, 0.0, elbow),
            (0.7 * fore, 0.0, 0.0),
            (wrist, 0.0, 0.0),
        ]
    )
    origins = np.tile(np.eye(4), (6, 1, 1))
    origins[:, :3, 3] = places
    axes = np.eye(3)[[2, 1, 1, 0, 1, 0]]
    mass = total * np.array([0.2, 0.3, 0.17, 0.14, 0.09, 0.05, 0.02])
    along = np.vstack([places[1:], [[0.3 * wrist, 0.0, 0.0]]])
    size = np.linalg.norm(along, axis=1) + 0.05 * reach
    inertia = mass[1:, None, None] * (0.09 * size**2)[:, None, None] * np.eye(3)
    held = 9.81 * (mass[2:].sum() * 0.35 + payload) * reach
    peak = held * np.array([1.5, 1.9, 1.1, 0.17, 0.15, 0.09])
    speed = np.array([3.2, 3.0, 3.2, 5.5, 5.5, 8.0]) * rng.uniform(0.8, 1.2) / payload**0.12
    like = load_robot("kr6_r900_2")
    robot = replace(
        like,
        name="stranger",
        joint_origin=origins,
        joint_axis=axes,
        position_min=np.full(6, -2.5),
        position_max=np.full(6, 2.5),
        machine_home=np.array([0.0, 0.2, 0.2, 0.0, 0.5, 0.0]),
        link_mass=mass,
        link_com=np.vstack([np.zeros(3), 0.45 * along]),
        link_inertia=np.concatenate([like.link_inertia[:1], inertia]),
        gear_ratio=np.full(6, 100.0),
        counterbalance=None,
        capsules=(),
        self_pairs=(),
        load_self_capsules=(),
    )
    return estimated(robot, peak, speed, without_table())


def recorded(robot: Stranger, seconds: float, seed: int) -> Samples:
    """What the log of the controller and a meter beside it give of a run of random movements."""
    joints, meter = logged(robot, seconds, seed)
    return samples_of(joints, meter, robot.known.joint_names, MODES, [(-np.inf, np.inf, ())])


def logged(robot: Stranger, seconds: float, seed: int) -> tuple[Trace, Trace]:
    """The log of the controller, and that of a meter beside it on the same clock."""
    rng = np.random.default_rng(seed)
    time, q, qd, qdd = motion(robot.known, seconds, rng)
    watts = watts_of(robot, time, qd, torques(robot, time, q, qd, qdd))
    return joint_log(robot, time, q, rng), meter_log(watts, rng)


def joint_log(
    robot: Stranger,
    time: FloatArray,
    q: FloatArray,
    rng: np.random.Generator,
    torque: FloatArray | None = None,
) -> Trace:
    """What the controller writes of positions (N, n), and of torques of its motors (N, n)."""
    names = robot.known.joint_names
    seen = (q + rng.normal(0.0, 2e-5, q.shape))[::LOGGED]
    columns = {name: seen[:, k].copy() for k, name in enumerate(names)}
    if torque is not None:
        columns |= {f"{name}_effort": torque[::LOGGED, k].copy() for k, name in enumerate(names)}
    return Trace("log", time[::LOGGED], columns)


def meter_log(watts: FloatArray, rng: np.random.Generator) -> Trace:
    """What a meter reads of watts (N,)."""
    count = len(watts) // READING
    mean = watts[: count * READING].reshape(count, READING).mean(axis=1)
    mean = mean * (1.0 + rng.normal(0.0, 0.005, count)) + rng.normal(0.0, 2.0, count)
    return Trace("meter", DT * READING * np.arange(1, count + 1), {"power": mean})


def motion(
    robot: RobotModel, seconds: float, rng: np.random.Generator, rest: float = _REST
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Single axes and all together, fast and slow, with pauses: time (N,), and motion (N, n)."""
    time = np.arange(0.0, seconds, DT)
    here = np.array(robot.machine_home)
    q = np.tile(here, (len(time), 1))
    qd = np.zeros_like(q)
    qdd = np.zeros_like(q)
    now = rest
    number = 0
    while True:
        travel = rng.uniform(-0.8, 0.8, robot.n)
        if rng.random() < 0.45:
            only = np.eye(robot.n)[number % robot.n]
            travel = only * rng.uniform(0.4, 1.2) * rng.choice([-1.0, 1.0])
        goal = np.clip(robot.machine_home + travel, robot.position_min, robot.position_max)
        way = goal - here
        fastest = float((np.abs(way) / robot.velocity_max).max()) * 1.9
        lasts = max(fastest / rng.choice([1.0, 0.6, 0.25]), 0.4)
        if now + lasts > seconds - rest:
            return time, q, qd, qdd
        rows = (time >= now) & (time < now + lasts)
        x = ((time[rows] - now) / lasts)[:, None]
        q[rows] = here + way * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        qd[rows] = way * 30.0 * x**2 * (1.0 - x) ** 2 / lasts
        qdd[rows] = way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / lasts**2
        q[time >= now + lasts] = goal
        here = goal
        now += lasts + rng.uniform(0.1, 0.8)
        number += 1


def torques(
    robot: Stranger, time: FloatArray, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> FloatArray:
    """Nm of the motors at the joints (N, n)."""
    import pinocchio

    known = robot.known
    model = pinocchio.Model()
    parent = 0
    for k in range(known.n):
        place = pinocchio.SE3(known.joint_origin[k][:3, :3], known.joint_origin[k][:3, 3])
        joint = pinocchio.JointModelRevoluteUnaligned(known.joint_axis[k])
        parent = model.addJoint(parent, joint, place, str(k))
        body = pinocchio.Inertia(
            known.link_mass[k + 1] * robot.masses[k],
            known.link_com[k + 1] + robot.centres[k],
            known.link_inertia[k + 1] * robot.masses[k],
        )
        model.appendBodyToJoint(parent, body, pinocchio.SE3.Identity())
    held = pinocchio.Inertia(robot.payload, np.array([0.08, 0.0, 0.02]), 0.01 * np.eye(3))
    model.appendBodyToJoint(parent, held, pinocchio.SE3.Identity())
    data = model.createData()
    bodies = np.array(
        [pinocchio.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)]
    )
    driven, back = robot.gears
    lost = np.where(bodies * qd >= 0.0, driven, back) * np.abs(bodies)
    near_rest = robot.coulomb * robot.stick * np.exp(-((qd / 0.05) ** 2))
    dry = (robot.coulomb + near_rest + lost) * np.tanh(qd / _STIFF)
    cold = 1.0 + robot.warm * np.exp(-time / 300.0)
    rotors = robot.rotors * known.reflected_inertia * qdd
    return np.asarray(bodies + rotors + dry + robot.viscous * cold[:, None] * qd)


def watts_of(robot: Stranger, time: FloatArray, qd: FloatArray, torque: FloatArray) -> FloatArray:
    """W at the mains (N,): the axes share a link whose chopper has a hysteresis."""
    motor = torque / robot.known.gear_ratio
    axes = torque * qd + robot.copper * motor**2 + robot.switching * np.abs(motor)
    wanted = (axes + robot.iron * qd**2).sum(axis=1)
    given = np.zeros(len(time))
    charge = 0.0
    open_again = robot.lower * robot.capacity
    for k, joules in enumerate((wanted * DT).tolist()):
        charge -= joules
        if charge < 0.0:
            given[k] = -charge / DT
            charge = 0.0
        elif charge > robot.capacity:
            charge = open_again
    return given / robot.efficiency + robot.standing
