"""How far the torques of a robot may be from its model's: parameter by parameter, along a movement.

Friction, gears, rotors, counterbalance and the scale of all masses have the covariance of the power
parameters (the data's marks of confidence, or a fit). Each link's own mass, centre and inertia, and
the
friction at low speed, have the deviations of the table below, whatever was fitted: an energy fit
does not separate them. An axis that stands has whatever friction holds it: its motor's torque says
how the gravity on it changes, hardly how large that is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ir_description import RELATIVE_DEVIATION, Load, PowerParameters, RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import FloatArray

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
        self.model = model = parameters.robot_with(robot)
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
        plain = self._plain.inverse_dynamics(q, qd, qdd)
        links = [link.inverse_dynamics(q, qd, qdd) - plain for link in self._links]
        sign = np.tanh(qd / _SIGN)
        n = self._plain.n
        rest = (
            self.model.friction_coulomb
            * STRIBECK_SHARE
            * np.exp(-np.abs(qd) / STRIBECK_SPEED)
            * sign
        )
        axes = (qd, sign, np.abs(torque) * sign)
        known = [_on_axis(values, j) for values in axes for j in range(n)]
        standing = STANDING_SHARE * self.model.friction_coulomb * self.standing(qd)
        known.append(self.model.reflected_inertia * qdd)
        known.append(self._scaled.inverse_dynamics(q, qd, qdd) - plain)
        known.append(-self._plain.counterbalance(q))
        return np.concatenate(
            (
                np.stack(known, axis=2) @ self._root,
                np.stack(links, axis=2),
                np.stack(
                    [_on_axis(values, j) for values in (rest, standing) for j in range(n)], axis=2
                ),
            ),
            axis=2,
        )

    def standing(self, qd: FloatArray) -> FloatArray:
        """Share (N, n) of the Coulomb friction that may act either way, because the axis hardly
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
