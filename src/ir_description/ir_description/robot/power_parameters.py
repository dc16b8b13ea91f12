"""What the joules of a robot follow from, as one named vector with its covariance.

Per joint the friction, the copper losses and three losses that the data sheet does not have (zero
there); for the whole robot scales of masses and of watts, the rectifier, idle inverters and the
controller's watts by mode. A fit
gives the same vector with another mean and covariance, so planner, driver and report load both
alike.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ir_description.arrays import frozen
from ir_description.errors import UnknownNameError
from ir_description.robot.load import Load
from ir_description.robot.power import PowerData
from ir_description.robot.robot import RobotModel
from ir_description.robot.truncated import truncated_normal
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

AXIS_UNITS = {
    "viscous": "Nm s/rad",
    "coulomb": "Nm",
    "copper": "W/Nm^2",
    "iron": "W s^2/rad^2",
    "inverter": "W/Nm",
    "gear": "",
}
"""Per joint: friction at the joint, W per motor torque squared, W per joint speed squared, W per
motor torque magnitude, share of |joint torque x speed| lost in the gear.
"""

SCALARS = (
    "rotor_inertia",
    "link_mass",
    "load_mass",
    "counterbalance",
    "tool_watts",
    "rectifier_efficiency",
)
"""Factors of what the data say (1: as they say), and the share of the mains power that reaches the
bus.
"""

IDLE = "idle_watts"
"""W that the inverters of all axes together take from the DC link while the motors are on, whatever
moves.
"""

LEVELS = (0.05, 0.95)
"""Quantiles that are the ends of an interval over drawn robots."""

_HIGHEST = {"gear": 0.9, "rectifier_efficiency": 1.0} | dict.fromkeys(SCALARS[:5], 10.0)
_LOWEST = {"rectifier_efficiency": 0.5, "rotor_inertia": 0.1, "link_mass": 0.1}
_MOST = 1e9
_SYMMETRIC = 1e-9  # relative to the variances: rounding of a file's digits


def interval_over(nominal: float, added: FloatArray) -> tuple[float, float]:
    """Ends of the 90 % interval of a figure to which drawn robots add `added` (N,): it holds the
    nominal one, which need not be near its middle.
    """
    low, high = np.quantile(added, LEVELS)
    return nominal + min(float(low), 0.0), nominal + max(float(high), 0.0)


def parameter_names(joints: Iterable[str], modes: Iterable[str]) -> tuple[str, ...]:
    """Names in their order: "viscous.joint_a1" .., the scalars, "idle_watts", "drives_watts",
    "watts.STAND_ON_MOTORS" ..
    """
    axes = tuple(joints)
    return (
        *(f"{term}.{joint}" for term in AXIS_UNITS for joint in axes),
        *SCALARS,
        IDLE,
        "drives_watts",
        *(f"watts.{mode}" for mode in modes),
    )


def parameter_unit(name: str) -> str:
    """The unit of a parameter, "" for factors and shares."""
    kind = name.partition(".")[0]
    return "W" if kind in ("watts", "drives_watts", IDLE) else AXIS_UNITS.get(kind, "")


def physical_bounds(names: Iterable[str]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest value (P,) that physics allows each parameter."""
    kinds = [name.partition(".")[0] for name in names]
    low = np.array([_LOWEST.get(kind, 0.0) for kind in kinds])
    return low, np.array([_HIGHEST.get(kind, _MOST) for kind in kinds])


@dataclass(frozen=True, eq=False)
class PowerParameters:
    """Mean (P,) and covariance (P, P) of the parameters of a robot and its controller, read-only.

    name: what reports call them; robot, controller: whose; joints, modes: their names, which give
    the order; sources (P,): where each is from ("data M", "fit").
    """

    name: str
    robot: str
    controller: str
    joints: tuple[str, ...]
    modes: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray
    sources: tuple[str, ...]

    def __post_init__(self) -> None:
        size = len(self.names)
        object.__setattr__(self, "mean", frozen(self.mean, (size,), "mean"))
        object.__setattr__(self, "covariance", frozen(self.covariance, (size, size), "covariance"))
        if len(self.sources) != size:
            raise InvalidValueError(
                f"sources has {len(self.sources)} entries: there are {size} parameters"
            )
        low, high = physical_bounds(self.names)
        for name, value, least, most in zip(self.names, self.mean, low, high, strict=True):
            if not least <= value <= most:
                unit = parameter_unit(name)
                raise InvalidValueError(
                    f"{name} is {value:g} {unit}, must be in [{least:g}, {most:g}]"
                )
        self._check_covariance()

    def _check_covariance(self) -> None:
        scale = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        scale[scale == 0.0] = 1.0
        relative = self.covariance / np.outer(scale, scale)
        if np.abs(relative - relative.T).max() > _SYMMETRIC:
            raise InvalidValueError("covariance must be symmetric")
        if np.linalg.eigvalsh(relative).min() < -1e-6:
            raise InvalidValueError("covariance must not have a negative eigenvalue")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        return parameter_names(self.joints, self.modes)

    @property
    def deviation(self) -> FloatArray:
        """Standard deviations (P,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def index(self, name: str) -> int:
        """Place of a parameter in the vector."""
        if name not in self.names:
            raise UnknownNameError("power parameter", name, self.names)
        return self.names.index(name)

    def value(self, name: str) -> float:
        """Mean of a parameter."""
        return float(self.mean[self.index(name)])

    def places(self, term: str) -> slice:
        """Where the joints' values of a term of AXIS_UNITS stand in the vector."""
        n = len(self.joints)
        at = tuple(AXIS_UNITS).index(term) * n
        return slice(at, at + n)

    def axis(self, term: str) -> FloatArray:
        """Means (n,) of a term of AXIS_UNITS."""
        return self.mean[self.places(term)]

    def draws(self, count: int, seed: int) -> FloatArray:
        """Vectors (count, P) of the normal distribution, cut off at the physical bounds: a loss
        that the data sheet has at zero is drawn as a half normal one, and correlations hold at the
        bounds.
        """
        return truncated_normal(
            self.mean, self.covariance, *physical_bounds(self.names), count, seed
        )

    def drawn(self, seed: int) -> PowerParameters:
        """One robot of these: a draw as the mean, without uncertainty."""
        return replace(
            self,
            name=f"{self.name}, seed {seed}",
            mean=self.draws(1, seed)[0],
            covariance=np.zeros_like(self.covariance),
            sources=("drawn",) * len(self.names),
        )

    def robot_with(self, robot: RobotModel) -> RobotModel:
        """The robot with these friction, losses, masses and counterbalance."""
        balance = robot.counterbalance
        mass = self.value("link_mass")
        if balance is not None:
            pressure = balance.charge_pressure * max(self.value("counterbalance"), 1e-9)
            balance = replace(balance, charge_pressure=pressure)
        return replace(
            robot,
            friction_viscous=self.axis("viscous"),
            friction_coulomb=self.axis("coulomb"),
            copper_loss=self.axis("copper"),
            iron_loss=self.axis("iron"),
            inverter_loss=self.axis("inverter"),
            gear_loss=self.axis("gear"),
            idle_loss=np.full(robot.n, self.value(IDLE) / robot.n),
            reflected_inertia=robot.reflected_inertia * self.value("rotor_inertia"),
            link_mass=robot.link_mass * mass,
            link_inertia=robot.link_inertia * mass,
            counterbalance=balance,
        )

    def loads_with(self, loads: Iterable[Load]) -> tuple[Load, ...]:
        """Loads with these masses and watts."""
        mass = self.value("load_mass")
        watts = self.value("tool_watts")
        return tuple(
            replace(
                load,
                mass=load.mass * mass,
                inertia=load.inertia * mass,
                watts_always=load.watts_always * watts,
                watts_drive_bus=load.watts_drive_bus * watts,
            )
            for load in loads
        )

    def power_with(self, data: PowerData) -> PowerData:
        """The controller with these watts."""
        modes = tuple(
            replace(m, controller_watts=self.value(f"watts.{m.name}")) for m in data.modes
        )
        return replace(data, modes=modes, drives_and_brake_release=self.value("drives_watts"))
