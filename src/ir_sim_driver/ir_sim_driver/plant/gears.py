"""Friction of the gears: viscous, Coulomb, load-dependent and Stribeck, and how it falls while they
warm up.

    f = F_v e^(-beta (T - T_ref)) v + (F_c + mu |tau_load| + F_s e^(-(v / v_s)^2)) tanh(v / v_0)

mu depends on which side drives. After Bittencourt and Gunnarsson: Static friction in a robot joint:
modeling and identification of load and temperature effects (2012). Each gear is one body that its
friction heats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import add, mul

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant.plant_parameters import REFERENCE_TEMPERATURE, GearFigures

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
        f = self._figures = figures
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
