"""Drivetrain of an axis: motor and inverter losses, gear friction, rotor, counterbalance."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from operator import add, gt, mul
from typing import NamedTuple

import numpy as np

from ir_description import RobotModel
from ir_sim_driver.plant.backend import MotorWork
from ir_sim_driver.plant.plant_parameters import REFERENCE_TEMPERATURE, DriveFigures, GearFigures
from ir_values.arrays import FloatArray

# Power of an axis from the DC link: torque times speed, and the losses of motor and inverter.


class AxisPower(NamedTuple):
    """Each (K, n) [W], one row per step; current [A rms], with the sign of the torque."""

    mechanical: FloatArray
    copper: FloatArray
    inverter: FloatArray
    iron: FloatArray
    current: FloatArray

    @property
    def total(self) -> FloatArray:
        """What the axes take from the DC link (K, n) [W]."""
        total: FloatArray = self.mechanical + self.copper + self.inverter + self.iron
        return total


class DriveLosses:
    """Servo drives with these figures behind gears of `ratio` (n,)."""

    def __init__(self, figures: DriveFigures, ratio: FloatArray) -> None:
        self._figures = figures
        self._ratio = np.array(ratio)

    def power(self, work: MotorWork, powered: FloatArray) -> AxisPower:
        """Power in K steps; powered (K,): 1 in steps with motors on, else 0."""
        f = self._figures
        torque = work.torque / self._ratio
        speed = np.abs(work.speed) * self._ratio
        current = torque / f.torque_constant
        on = powered[:, None]
        return AxisPower(
            work.torque * work.speed,
            f.copper * torque**2,
            f.inverter * np.abs(current) + f.switching * on,
            (f.iron_linear * speed + f.iron_square * speed**2) * on,
            current,
        )


# Friction of the gears: viscous, Coulomb, load-dependent and Stribeck; it falls while they warm
# up.
#
#     f = F_v e^(-beta (T - T_ref)) v + (F_c + mu |tau_load| + F_s e^(-(v / v_s)^2)) tanh(v / v_0)
#
# mu depends on which side drives. After Bittencourt and Gunnarsson: Static friction in a robot
# joint: modeling and identification of load and temperature effects (2012). Each gear is one body
# that its friction heats.

SMOOTHING = 1e-3
"""v_0 [rad/s]: Coulomb friction changes its sign over 1/1000 of working speed, and is zero at rest,
so that it never hides the holding torque.
"""
_STEEP = 1.0 / SMOOTHING
_WARMING = 100  # steps between two looks at the temperature: it takes minutes to change


class Gears:
    """n gears with these figures, stepped by dt [s]. temperature (n,) [deg C].

    Plain floats where they are faster than arrays of n: this runs every millisecond.
    """

    def __init__(self, figures: GearFigures, dt: float) -> None:
        f = figures
        self._figures = figures
        self._dt = dt
        self._plain = not (f.load_driven.any() or f.load_back.any() or f.stribeck.any())
        dry = (f.coulomb, f.load_driven, f.load_back, f.stribeck, 1.0 / np.array(f.stribeck_speed))
        self._dry: list[list[float]] = np.array(dry).T.tolist()
        self._coulomb: list[float] = f.coulomb.tolist()
        self.temperature: FloatArray = np.array(f.start)
        self._heat = [0.0] * len(self.temperature)  # J since the last look, over dt
        self._steps = 0
        self._warm()

    def dry(self, speed: Sequence[float], load: Sequence[float]) -> list[float]:
        """What multiplies tanh (n,) [Nm] at this speed and torque (n,) through the gear to the
        link.
        """
        if self._plain:
            return self._coulomb
        return [
            coulomb
            + (driven if t * v >= 0.0 else back) * abs(t)
            + stribeck * math.exp(-((v * per) ** 2))
            for v, t, (coulomb, driven, back, stribeck, per) in zip(
                speed, load, self._dry, strict=True
            )
        ]

    def friction(
        self, speed: Sequence[float], dry: Sequence[float], chord: bool = False
    ) -> tuple[list[float], list[float]]:
        """Torque (n,) [Nm] against the motion, and its derivative by speed; or, where `chord`, the
        slope of its chord through rest, with which every step of an iteration comes nearer.
        """
        torque = []
        slope = []
        for v, viscous, most in zip(speed, self._viscous, dry, strict=True):
            tanh = math.tanh(v * _STEEP)
            torque.append(viscous * v + most * tanh)
            chordal = chord and v != 0.0
            slope.append(viscous + most * (tanh / v if chordal else _STEEP * (1.0 - tanh * tanh)))
        return torque, slope

    def heat(self, friction: Sequence[float], speed: Sequence[float]) -> None:
        """Count one step in which the friction (n,) [Nm] took place at this speed."""
        self._heat = list(map(add, self._heat, map(mul, friction, speed)))
        self.cool()

    def cool(self) -> None:
        """Count one step at rest."""
        self._steps += 1
        if self._steps >= _WARMING:
            self._warm()

    def _warm(self) -> None:
        """Bring temperature and viscous friction up to the present step."""
        f = self._figures
        lost = f.conductance * (self.temperature - f.ambient) * self._steps
        self.temperature = self.temperature + self._dt * (np.array(self._heat) - lost) / f.capacity
        self._heat = [0.0] * len(self.temperature)
        self._steps = 0
        falling = np.exp(f.viscous_per_kelvin * (REFERENCE_TEMPERATURE - self.temperature))
        self._viscous: list[float] = (f.viscous * falling).tolist()


# Rotor inertia, counterbalance and the torque envelope (eq. 8).
#
# One robot at a time and in plain floats where that is faster: this runs every millisecond.


class Drivetrain:
    """Drives of the n joints of `robot` (an ir_description RobotModel).

    rotor_inertia (n,) [kg m^2], seen at the joint.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.rotor_inertia: FloatArray = np.array(robot.reflected_inertia)
        c = robot.counterbalance
        self._gas_joint = -1 if c is None else c.joint
        # plain floats: five times faster than numpy's, every millisecond
        self._gas_spring = (
            None
            if c is None
            else tuple(
                float(x)
                for x in (
                    *c.pivot,
                    *c.rod_eye,
                    c.piston_area,
                    c.gas_volume,
                    c.charge_pressure,
                    c.rod_length_at_charge,
                    c.exponent,
                )
            )
        )
        self._speeds: list[list[float]] = np.array(robot.envelope_speed).tolist()
        self._torques: list[list[float]] = np.array(robot.envelope_torque).tolist()
        self._least: list[float] = np.array(robot.envelope_torque)[:, -1].tolist()

    def counterbalance(self, q: Sequence[float]) -> list[float]:
        """What the counterbalance does about the positive axes (n,) [Nm]."""
        torque = [0.0] * len(q)
        if self._gas_spring is not None:
            torque[self._gas_joint] = self.counterbalance_torque(q[self._gas_joint])
        return torque

    def counterbalance_torque(self, angle: float) -> float:
        """Torque [Nm] about the positive axis at the joint angle [rad]; formula of ir_description's
        data.
        """
        if self._gas_spring is None:
            return 0.0
        bx, bz, ex, ez, area, gas_volume, pressure, length_at_charge, exponent = self._gas_spring
        sin = math.sin(angle)
        cos = math.cos(angle)
        px = cos * ex + sin * ez
        pz = cos * ez - sin * ex
        length = math.hypot(px - bx, pz - bz)
        volume = gas_volume - area * (length - length_at_charge)
        force: float = area * pressure * (gas_volume / volume) ** exponent
        return force * (pz * (bx - px) - px * (bz - pz)) / length

    def limited(self, torque: Sequence[float], qd: Sequence[float]) -> tuple[FloatArray, bool]:
        """Torque (n,) within the envelope at the speeds qd, and whether anything was cut off."""
        result = np.array(torque)
        cut = False
        if not any(map(gt, map(abs, torque), self._least)):
            return result, cut
        for j, (t, least) in enumerate(zip(torque, self._least, strict=True)):
            if abs(t) > least:
                limit = self._limit_of(j, abs(qd[j]))
                if abs(t) > limit:
                    result[j] = math.copysign(limit, t)
                    cut = True
        return result, cut

    def limit(self, qd: FloatArray) -> FloatArray:
        """Torque (n,) [Nm] available at the speeds |qd|."""
        return np.array([self._limit_of(j, speed) for j, speed in enumerate(np.abs(qd).tolist())])

    def _limit_of(self, j: int, speed: float) -> float:
        speeds = self._speeds[j]
        torques = self._torques[j]
        k = bisect_right(speeds, speed)
        if k == 0 or k == len(speeds):
            return torques[k]
        share = (speed - speeds[k - 1]) / (speeds[k] - speeds[k - 1])
        return torques[k] + share * (torques[k + 1] - torques[k])
