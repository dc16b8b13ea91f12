"""What the dynamics need to know of a robot and its loads: structural types, for n joints.

Any object with these attributes serves (ir_description's dataclasses do). Link 0 is the base, link
i is moved by joint i (1..n); arrays over joints are indexed 0..n-1.
"""

from collections.abc import Sequence
from typing import Protocol

from ir_kernels.data import ChainLike
from ir_values.arrays import FloatArray


class CounterbalanceLike(Protocol):
    """A gas cylinder between a pivot on the link before `joint` and an eye on the link after it."""

    @property
    def joint(self) -> int:
        """0..n-1."""

    @property
    def pivot(self) -> Sequence[float] | FloatArray:
        """(2,) x, z in the frame of the joint [m]."""

    @property
    def rod_eye(self) -> Sequence[float] | FloatArray:
        """(2,) x, z in the frame of the joint at q = 0 [m]."""

    @property
    def piston_area(self) -> float:
        """[m^2]."""

    @property
    def gas_volume(self) -> float:
        """At charge [m^3]."""

    @property
    def charge_pressure(self) -> float:
        """[Pa]."""

    @property
    def rod_length_at_charge(self) -> float:
        """[m]."""

    @property
    def exponent(self) -> float:
        """Of the gas: p V^exponent is constant."""


class LoadLike(Protocol):
    """Something bolted to the last link."""

    @property
    def name(self) -> str:
        """For messages."""

    @property
    def mass(self) -> float:
        """[kg]."""

    @property
    def com(self) -> FloatArray:
        """(3,) in the frame of the last link [m]."""

    @property
    def inertia(self) -> FloatArray:
        """(3, 3) about the centre of mass [kg m^2]."""


class RobotLike(ChainLike, Protocol):
    """Links and drives of a serial chain."""

    @property
    def link_mass(self) -> FloatArray:
        """(n + 1,) [kg]."""

    @property
    def link_com(self) -> FloatArray:
        """(n + 1, 3) in the links' frames [m]."""

    @property
    def link_inertia(self) -> FloatArray:
        """(n + 1, 3, 3) about the centres of mass [kg m^2]."""

    @property
    def reflected_inertia(self) -> FloatArray:
        """(n,) of rotor and gear at the joint [kg m^2]."""

    @property
    def friction_viscous(self) -> FloatArray:
        """(n,) [Nm s/rad]."""

    @property
    def friction_coulomb(self) -> FloatArray:
        """(n,) [Nm]."""

    @property
    def gear_ratio(self) -> FloatArray:
        """(n,)."""

    @property
    def copper_loss(self) -> FloatArray:
        """(n,) [W/Nm^2] of the motor torque."""

    @property
    def envelope_speed(self) -> FloatArray:
        """(n, K) joint speeds [rad/s], growing."""

    @property
    def envelope_torque(self) -> FloatArray:
        """(n, K + 1) torque available [Nm]: below the first speed, then at each."""

    @property
    def counterbalance(self) -> CounterbalanceLike | None:
        """None where there is none."""
