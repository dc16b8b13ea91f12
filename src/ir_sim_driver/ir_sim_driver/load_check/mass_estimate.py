"""Estimate of a load from torques by generalised least squares, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ir_description import Load, PowerParameters, RobotModel
from ir_description.robot import RELATIVE_DEVIATION
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.plant import Carried
from ir_values.arrays import FloatArray

# Uncertainty of the torques along a movement, parameter by parameter.
#
# Friction, gears, rotors, counterbalance and the scale of all masses have the covariance of the
# power parameters (the data's marks of confidence, or a fit). Each link's own mass, centre and
# inertia, and the friction at low speed, have the deviations of the table below, whatever was
# fitted: an energy fit does not separate them. An axis that stands has whatever friction holds
# it: its motor's torque says how the gravity on it changes, hardly how large that is. One that
# creeps, as back to its place after a stop, has a friction that grows with its speed nobody knows
# how soon: any mixture of the growths below.

LINK_SIZE = 0.2
"""m: a link's centre of mass is off by its mark's share of this, in each direction."""
STRIBECK_SHARE = 0.15
STRIBECK_SPEED = 0.05
"""Friction more at rest as a share of the Coulomb friction, gone over so many rad/s: an
assumption.
"""
STANDING_SHARE = 0.75
"""Friction of an axis that stands, as a share of the Coulomb friction: either way, all along the
movement.
"""
_SIGN = 0.01  # rad/s over which the sign of a friction turns
_STANDS = 0.003  # rad/s below which friction is whatever holds the axis
_CREEPS = (0.0003, 0.001, 0.003)  # rad/s within which the friction of a creeping axis may grow
_AXIS_TERMS = ("viscous", "coulomb", "gear")
_SCALES = ("rotor_inertia", "link_mass", "counterbalance")


class Uncertainty:
    """Of `robot` standing at base_pose (4, 4), known as `parameters` and its data's marks say.

    model: the robot as it is expected.
    """

    def __init__(
        self,
        robot: RobotModel,
        parameters: PowerParameters,
        marks: Mapping[str, str],
        base_pose: FloatArray,
    ) -> None:
        model = parameters.robot_with(robot)
        self.model = model
        self._base_pose = base_pose
        places = [
            parameters.index(f"{term}.{joint}")
            for term in _AXIS_TERMS
            for joint in robot.joint_names
        ]
        places += [parameters.index(name) for name in _SCALES]
        covariance = parameters.covariance[np.ix_(places, places)]
        values, vectors = np.linalg.eigh(covariance)
        self._root: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0))
        self._plain = self._dynamics(model)
        self._scaled = self._dynamics(
            replace(model, link_mass=2.0 * model.link_mass, link_inertia=2.0 * model.link_inertia)
        )
        self._links = [self._dynamics(other) for other in _other_links(model, marks)]

    def carrying(self, loads: Sequence[Load]) -> DynamicsModel:
        """The dynamics that are expected with these loads."""
        return DynamicsModel(self.model, tuple(loads), self._base_pose)

    def columns(
        self, q: FloatArray, qd: FloatArray, qdd: FloatArray, torque: FloatArray
    ) -> FloatArray:
        """Torques (N, n, P) [Nm] more for one standard deviation of each of P independent
        parameters, where `torque` is expected; all (N, n).
        """
        n = self._plain.n
        coupling = self.model.coupling
        plain = self._plain.inverse_dynamics(q, qd, qdd)
        links = [link.inverse_dynamics(q, qd, qdd) - plain for link in self._links]
        rotors = self.model.reflected_inertia * coupling.motors(qdd)
        scaled = self._scaled.inverse_dynamics(q, qd, qdd) - plain
        balance = coupling.motor_torque(self._plain.counterbalance(q))
        qd = coupling.motors(qd)
        sign = np.tanh(qd / _SIGN)

        # known with their covariance: viscous, Coulomb and gear friction of each axis, and masses
        known = []
        for values in (qd, sign, np.abs(torque) * sign):
            known += [_on_axis(values, j) for j in range(n)]
        known += [rotors, scaled, -balance]
        of_known = np.stack(known, axis=2) @ self._root

        # Stribeck friction of each axis
        falls = np.exp(-np.abs(qd) / STRIBECK_SPEED)
        rest = self.model.friction_coulomb * STRIBECK_SHARE * falls * sign
        stribeck = np.stack([_on_axis(rest, j) for j in range(n)], axis=2)

        # friction of an axis that stands may point anywhere; of one that creeps, its sign is unsure
        standing = self.standing(qd)
        moving = np.sign(qd) * (1.0 - standing)
        shapes = [standing]
        for speed in _CREEPS:
            creeping = np.tanh(qd / speed) - moving
            shapes.append(creeping / np.sqrt(len(_CREEPS)))
        either_way = STANDING_SHARE * self.model.friction_coulomb
        unknown = []
        for shape in shapes:
            unknown += [_on_axis(either_way * shape, j) for j in range(n)]
        parts = (of_known, np.stack(links, axis=2), stribeck, np.stack(unknown, axis=2))
        return np.concatenate(parts, axis=2)

    def standing(self, qd: FloatArray) -> FloatArray:
        """Share (N, n) of the Coulomb friction that may act either way, because the motor hardly
        moves.
        """
        return np.asarray(1.0 / (1.0 + (qd / _STANDS) ** 2))

    def _dynamics(self, robot: RobotModel) -> DynamicsModel:
        return DynamicsModel(robot, (), self._base_pose)


def _on_axis(values: FloatArray, j: int) -> FloatArray:
    """Values (N, n) of axis j, the others zero."""
    column = np.zeros_like(values)
    column[:, j] = values[:, j]
    return column


def _other_links(robot: RobotModel, marks: Mapping[str, str]) -> list[RobotModel]:
    """The robot with one figure of one moving link off by a standard deviation, for each."""
    others = []
    for i, name in enumerate(robot.link_names):
        if i == 0:
            continue

        def share(figure: str, link: str = name) -> float:
            return RELATIVE_DEVIATION[marks.get(f"links.{link}.{figure}", "L")]

        mass = robot.link_mass.copy()
        inertia = robot.link_inertia.copy()
        mass[i] *= 1.0 + share("mass_kg")
        inertia[i] *= 1.0 + share("inertia_kgm2")
        others += [replace(robot, link_mass=mass), replace(robot, link_inertia=inertia)]
        for k in range(3):
            com = robot.link_com.copy()
            com[i, k] += LINK_SIZE * share("com_m")
            others.append(replace(robot, link_com=com))
    return others


# Mass that explains the torques of a movement best: generalised least squares.
#
# found = expected + d m + J p + e: d is the torque per kg at the declared load's centre, p the
# robot's parameters, one standard deviation each, e what no parameter explains. With V = J J' +
# S, S diagonal, m = d' V^-1 (found - expected) / (d' V^-1 d), and its variance is 1 / (d' V^-1
# d).

UNEXPLAINED = 0.005
"""Standard deviation of what no parameter explains, at one instant, as a share of the peak torque:
twice what the stepped plants show.
"""
LOAD_MASS = 0.01
LOAD_CENTRE = 0.01
"""Standard deviations of a declared load: share of its mass, m of its centre in each direction."""
# of the Coulomb friction
_CHANGES = 0.1
_STARTS = 2.0
_KG = 1.0


class NotedMotion(NamedTuple):
    """What was found at N instants of a movement, each (N, n): q, qd, qdd [rad, s] and torque
    [Nm].
    """

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    torque: FloatArray


@dataclass(frozen=True)
class LoadFinding:
    """What a movement's torques say of the load.

    trajectory_id: what was driven; load: what was declared, as its text names it. noticed: the mass
    is beyond the threshold. joint: where the difference is largest for its deviation; expected,
    found, deviation [Nm]: mean torque there in the direction in which more load shows, and a
    standard deviation of the difference. mass, mass_deviation [kg]: more than declared, and its
    standard deviation.
    """

    trajectory_id: str
    load: str
    noticed: bool
    joint: str
    expected: float
    found: float
    deviation: float
    mass: float
    mass_deviation: float

    @property
    def sentence(self) -> str:
        """Expected and found torque; "" where nothing is noticed."""
        if not self.noticed:
            return ""
        more = "heavier" if self.mass > 0.0 else "lighter"
        return (
            f"the load is about {abs(self.mass):.0f} kg {more} than {self.load[:80]!a} declares: "
            f"{self.joint} expects {self.expected:.0f} Nm in the mean, found are "
            f"{self.found:.0f} Nm, a standard deviation is {self.deviation:.0f} Nm"
        )


class Declared:
    """A declared load carried by a robot that is known as `robot`, and the loads near it that it is
    compared with.
    """

    def __init__(self, load: Carried, robot: Uncertainty) -> None:
        self.load = load
        self.robot = robot
        self._model = robot.carrying(load.loads)
        self._others = [
            robot.carrying(loads) for loads in (_heavier(load.loads), *_shifted(load.loads))
        ]

    def torques(self, motion: NotedMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Expected (N, n) [Nm], more for one kg (N, n), and more for a shift of the centre (N, n,
        3).
        """
        q, qd, qdd, _ = motion
        expected = self._model.inverse_dynamics(q, qd, qdd)
        more, *shifted = (other.inverse_dynamics(q, qd, qdd) - expected for other in self._others)
        speed = self.robot.model.coupling.motors(qd)
        either_way = self.robot.standing(speed) * self.robot.model.friction_coulomb
        return expected - np.sign(speed) * either_way, more / _KG, np.stack(shifted, axis=2)


def weighed(motion: NotedMotion, declared: Declared, threshold: float) -> LoadFinding | None:
    """Weigh what was carried along a movement; None where no torque depends on the load."""
    q, qd, qdd, torque = motion
    load = declared.load
    robot = declared.robot
    expected, more, shifted = declared.torques(motion)
    columns = np.concatenate((robot.columns(q, qd, qdd, expected), shifted), axis=2)
    noise = _noise(robot, qd)
    inverse = _Covariance(columns, noise)
    information = float((more * inverse.times(more)).sum())
    if not information > 0.0:
        return None
    mass = float((more * inverse.times(torque - expected)).sum()) / information
    deviation = float(np.hypot(information**-0.5, LOAD_MASS * load.mass))
    j, seen, found, spread = _clearest(more, expected, torque, columns, noise)
    joint = robot.model.joint_names[j]
    noticed = abs(mass) > threshold * deviation
    return LoadFinding("", load.text, noticed, joint, seen, found, spread, mass, deviation)


class _Covariance:
    """V = J J' + S for columns J (N, n, P) and deviations (N, n) of S, never formed."""

    def __init__(self, columns: FloatArray, noise: FloatArray) -> None:
        self._shape = noise.shape
        self._noise = noise.ravel()
        self._white = columns.reshape(len(self._noise), -1) / self._noise[:, None]
        self._inner = np.eye(self._white.shape[1]) + self._white.T @ self._white

    def times(self, torque: FloatArray) -> FloatArray:
        """V^-1 times a torque (N, n)."""
        white = torque.ravel() / self._noise
        rest = white - self._white @ np.linalg.solve(self._inner, self._white.T @ white)
        result: FloatArray = (rest / self._noise).reshape(self._shape)
        return result


def _heavier(loads: Sequence[Load]) -> tuple[Load, ...]:
    """The loads, one kilogram heavier in proportion."""
    factor = 1.0 + _KG / sum(load.mass for load in loads)
    return tuple(
        replace(load, mass=load.mass * factor, inertia=load.inertia * factor) for load in loads
    )


def _shifted(loads: Sequence[Load]) -> list[tuple[Load, ...]]:
    """The loads with their centres off by a standard deviation, in each direction."""
    return [
        tuple(replace(load, com=load.com + LOAD_CENTRE * direction) for load in loads)
        for direction in np.eye(3)
    ]


def _noise(robot: Uncertainty, qd: FloatArray) -> FloatArray:
    """Deviation (N, n) [Nm] of what no parameter explains; of axes that stand, and more so of those
    that start or stop, the friction that may change from one instant to the next.
    """
    unexplained = UNEXPLAINED * robot.model.envelope_torque[:, 0]
    standing = robot.standing(robot.model.coupling.motors(qd))
    changing = _CHANGES * standing + _STARTS * standing * (1.0 - standing)
    return np.asarray(np.hypot(unexplained, changing * robot.model.friction_coulomb))


def _clearest(
    more: FloatArray,
    expected: FloatArray,
    found: FloatArray,
    columns: FloatArray,
    noise: FloatArray,
) -> tuple[int, float, float, float]:
    """The joint that shows the difference best: its index, mean torques expected and found,
    deviation.
    """
    weight = more / np.maximum(np.abs(more).sum(axis=0), 1e-12)
    means = (weight * expected).sum(axis=0), (weight * found).sum(axis=0)
    of_parameters = np.einsum("kj,kjp->jp", weight, columns)
    spread = np.sqrt((of_parameters**2).sum(axis=1) + ((weight * noise) ** 2).sum(axis=0))
    j = int((np.abs(means[1] - means[0]) / np.maximum(spread, 1e-9)).argmax())
    return j, float(means[0][j]), float(means[1][j]), float(spread[j])
