"""Parameters of a robot's energy: one named vector with its covariance, and where it starts.

The prior follows from the marks of confidence of the data. Draws of the vector respect what physics
allows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from ir_description.robot.power import PowerData
from ir_description.robot.robot import Load, RobotModel
from ir_kernels import portable
from ir_values.arrays import BoolArray, FloatArray, frozen
from ir_values.errors import InvalidValueError, UnknownNameError

# Draws of a normal distribution that physics cuts off: correlations hold at the bounds too.
#
# Only parameters that have a bound within reach are drawn one after the other, each from its own
# distribution given the others (Geweke, 1991); the others follow from them in one step.

_REACH = 6.0  # standard deviations: what lies beyond is not drawn in a lifetime
_SWEEPS = 60
_RIDGE = 1e-9  # relative: covariances of a file are rounded


def truncated_normal(
    mean: FloatArray,
    covariance: FloatArray,
    low: FloatArray,
    high: FloatArray,
    count: int,
    seed: int,
) -> FloatArray:
    """Vectors (count, P) of N(mean (P,), covariance (P, P)) between low and high (P,).

    What has no deviation stays at its mean.
    """
    generator = np.random.default_rng(seed)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    free = deviation > 0.0
    scale = deviation[free]
    matrix = covariance[np.ix_(free, free)] / np.outer(scale, scale)
    matrix = matrix + _RIDGE * np.eye(len(matrix))
    least = (low - mean)[free] / scale
    most = (high - mean)[free] / scale
    near = np.asarray((least > -_REACH) | (most < _REACH))
    drawn = np.empty((count, len(scale)))
    drawn[:, near] = _draws_between(
        matrix[np.ix_(near, near)], least[near], most[near], count, generator
    )
    drawn[:, ~near] = _following(matrix, near, drawn[:, near], generator)
    result = np.tile(mean, (count, 1))
    result[:, free] += scale * np.clip(drawn, least, most)
    return np.asarray(np.clip(result, low, high))


def _draws_between(
    matrix: FloatArray,
    least: FloatArray,
    most: FloatArray,
    count: int,
    generator: np.random.Generator,
) -> FloatArray:
    """Draws (count, B) about 0 with covariance (B, B) between the bounds (B,)."""
    from scipy.special import ndtr, ndtri

    size = len(matrix)
    precision = portable.inv(matrix)
    deviation = 1.0 / np.sqrt(np.diag(precision))
    alone = np.array_equal(matrix, np.diag(np.diag(matrix)))
    drawn = np.clip(np.zeros((count, size)), least, most)
    for _ in range(1 if alone else _SWEEPS):
        for j in range(size):
            middle = drawn[:, j] - portable.matmul(drawn, precision[:, j]) * np.square(deviation[j])
            first = ndtr((least[j] - middle) / deviation[j])
            last = ndtr((most[j] - middle) / deviation[j])
            share = first + (last - first) * generator.random(count)
            value = middle + deviation[j] * ndtri(np.clip(share, 1e-12, 1.0 - 1e-12))
            drawn[:, j] = np.clip(value, least[j], most[j])
    return drawn


def _following(
    matrix: FloatArray, near: BoolArray, given: FloatArray, generator: np.random.Generator
) -> FloatArray:
    """Draws (count, F) of those that are not near a bound, given the others (count, B)."""
    own = matrix[np.ix_(~near, ~near)]
    across = matrix[np.ix_(~near, near)]
    gain = portable.solve(matrix[np.ix_(near, near)], across.T).T if near.any() else across
    root = portable.symmetric_root(own - portable.matmul(gain, across.T))
    noise = generator.standard_normal((len(given), len(own)))
    return portable.matmul(given, gain.T) + portable.matmul(noise, root.T)


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
    "dc_link",
    "rectifier_efficiency",
)
"""Factors of what the data say (1: as they say), and the share of the mains power that reaches the
bus.
"""

LINK = "dc_link"
"""Factor of the braking energy that fits into the DC link."""

IDLE = "idle_watts"
"""W that the inverters of all axes together take from the DC link while the motors are on, whatever
moves.
"""

CENTRES = ("centre_1", "centre_2")
"""Per joint, where they are parameters: m by which the centre of mass of its link lies elsewhere
than the data say, in the two directions of `centre_directions`.
"""

LEVELS = (0.05, 0.95)
"""Quantiles that are the ends of an interval over drawn robots."""

ROBOTS = 1000
"""Drawn for an interval: its ends are then known to some 5 % of its width."""

_DRAW_SEED = 90
_FARTHEST = 1.0  # m: of a centre of mass
_HIGHEST = {
    "gear": 0.9,
    "rectifier_efficiency": 1.0,
    LINK: 1000.0,
    **dict.fromkeys(SCALARS[:5], 10.0),
    **dict.fromkeys(CENTRES, _FARTHEST),
}
_LOWEST = {
    "rectifier_efficiency": 0.5,
    "rotor_inertia": 0.1,
    "link_mass": 0.1,
    **dict.fromkeys(CENTRES, -_FARTHEST),
}
_MOST = 1e9
_SYMMETRIC = 1e-9  # relative to the variances: rounding of a file's digits


def interval_over(nominal: float, added: FloatArray) -> tuple[float, float]:
    """Ends of the 90 % interval of a figure to which drawn robots add `added` (N,): it holds the
    nominal one, which need not be near its middle.
    """
    low, high = np.quantile(added, LEVELS)
    return nominal + min(float(low), 0.0), nominal + max(float(high), 0.0)


@lru_cache(maxsize=16)
def drawn_robots(parameters: PowerParameters) -> FloatArray:
    """The robots (ROBOTS, P) that all intervals are over; always the same for the same
    parameters.
    """
    return parameters.draws(ROBOTS, _DRAW_SEED)


def parameter_names(
    joints: Iterable[str], modes: Iterable[str], *, centres: bool = False
) -> tuple[str, ...]:
    """Names in their order: "viscous.joint_a1" .., the scalars, "idle_watts", "drives_watts",
    "watts.STAND_ON_MOTORS" .. and, with centres, "centre_1.joint_a1" ..
    """
    axes = tuple(joints)
    return (
        *(f"{term}.{joint}" for term in AXIS_UNITS for joint in axes),
        *SCALARS,
        IDLE,
        "drives_watts",
        *(f"watts.{mode}" for mode in modes),
        *(f"{term}.{joint}" for term in CENTRES if centres for joint in axes),
    )


def centre_directions(robot: RobotModel) -> FloatArray:
    """The directions (2, n, 3) in which the parameters CENTRES move the links' centres of mass, in
    the frames of the links: both across the joint's axis, for only these are felt at it.
    """
    axes = robot.joint_axis
    first = np.zeros_like(axes)
    for row, axis in zip(first, axes, strict=True):
        least = int(np.argmin(np.abs(axis)))
        row[least] = 1.0
        row -= axis[least] * axis
        row /= np.sqrt(np.square(row).sum())
    return np.stack([first, np.cross(axes, first)])


def parameter_unit(name: str) -> str:
    """The unit of a parameter, "" for factors and shares."""
    kind = name.partition(".")[0]
    if kind in CENTRES:
        return "m"
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
    the order; sources (P,): where each is from ("data M", "fit"); centres: whether centres of mass
    are among them.
    """

    name: str
    robot: str
    controller: str
    joints: tuple[str, ...]
    modes: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray
    sources: tuple[str, ...]
    centres: bool = False

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
        return parameter_names(self.joints, self.modes, centres=self.centres)

    @property
    def deviation(self) -> FloatArray:
        """Standard deviations (P,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def index(self, name: str) -> int:
        """Place of a parameter in the vector. Raises UnknownNameError for none of them."""
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

    def centre_places(self) -> slice:
        """Where the joints' CENTRES stand in the vector, term by term."""
        size = len(self.names)
        return slice(size - (len(CENTRES) * len(self.joints) if self.centres else 0), size)

    def with_centres(self, deviation: FloatArray) -> PowerParameters:
        """The same with centres of mass as the data have them, with deviations (2 n,) m."""
        if self.centres:
            return self
        size = len(self.mean)
        covariance = np.zeros((size + len(deviation), size + len(deviation)))
        covariance[:size, :size] = self.covariance
        covariance[size:, size:] = np.diag(np.square(deviation))
        return replace(
            self,
            mean=np.concatenate([self.mean, np.zeros(len(deviation))]),
            covariance=covariance,
            sources=(*self.sources, *["assumed"] * len(deviation)),
            centres=True,
        )

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
        com = robot.link_com
        if self.centres:
            shifts = self.mean[self.centre_places()].reshape(len(CENTRES), robot.n, 1)
            com = com.copy()
            com[1:] += (shifts * centre_directions(robot)).sum(axis=0)
        return replace(
            robot,
            link_com=com,
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


# How far a robot may be from its data sheet, before anything is measured: from the marks of
# confidence.
#
# This is the one table of the planner's assumptions: its intervals, the reserve of torque and the
# start of a fit read it. The plants of the simulation are drawn by rules of their own
# (docs/plant.md), so that what holds on them is a finding.

DATA_SHEET = "data_sheet"
"""Name of the parameters that are the data's own."""

RELATIVE_DEVIATION = {"H": 0.02, "M": 0.10, "L": 0.30}
"""Standard deviation as a share of the value, by the mark of confidence in the data."""

ESTIMATED_DEVIATION = 0.5
"""The same of a drive's figure that a rule estimated, whatever its mark: its order is known."""

_FACTORS = {"viscous": 1.5, "coulomb": 1.5}
"""Friction is this much less certain than its mark says: it changes with temperature, grease and
wear.
"""

COUNTERBALANCE = 0.03
"""Gas pressure of the counterbalance: filled and checked to a few per cent, whatever its geometry's
mark.
"""

LOAD_MASS = 0.01
TOOL_WATTS = 0.20
"""Of the declared load and of the tool's declared watts: the cell files have no marks."""

IRON_SHARE = 0.005
"""Iron loss at full speed, as a share of peak torque times full speed: half normal, its scale."""

INVERTER_WATTS = 3.0
"""W per Nm of motor torque: 1 to 2 V across each conducting switch, 1 to 2 A per Nm; half
normal.
"""

GEAR_SHARE = 0.04
"""Loss of the gears that grows with the torque, beyond the friction that the data have; half
normal.
"""

IDLE_WATTS = 10.0
"""Per axis: switching losses of an inverter without a current; half normal. The data count them
with the drives, which they can't exceed; but they come from the DC link, where braking axes pay for
them.
"""

LINK_KNOWN = 0.25
LINK_ESTIMATED = 1.0
"""Of the joules that fit into a DC link: where its capacitance is read, capacitors differ by 20 %
(their makers' tolerance, and age), mains by 3 % and choppers by 1 % of their volts, which are 13 %
and 6 % of the joules between the two; where it is an estimate only the order is known.
"""

CENTRE_SHARE = 0.5
"""Of a link's length, where its centre of mass may be guessed to lie: it is known by its mark's
share of that.
"""

RECTIFIER_LOSS = 0.02
"""Diode rectifier and mains filter; half normal below 1."""


_PLACES = {
    "viscous": "drives.friction_viscous_nms_rad",
    "coulomb": "drives.friction_coulomb_nm",
    "copper": "drives.copper_loss_w_per_nm2",
    "rotor_inertia": "drives.reflected_inertia_kgm2",
    "drives_watts": "drives_and_brake_release_w",
}

Marks = Mapping[str, str]
"""H, M or L by the place of a figure in its file."""


def prior(robot: RobotModel, power: PowerData, marks: Marks) -> PowerParameters:
    """The parameters as the data have them, independent, with the deviations of this module."""
    joints = robot.joint_names
    modes = tuple(mode.name for mode in power.modes)
    names = parameter_names(joints, modes)
    watts = [
        float(robot.idle_loss.sum()),
        power.drives_and_brake_release,
        *(mode.controller_watts for mode in power.modes),
    ]
    # in the order of AXIS_UNITS
    means = (
        robot.friction_viscous,
        robot.friction_coulomb,
        robot.copper_loss,
        robot.iron_loss,
        robot.inverter_loss,
        robot.gear_loss,
    )
    mean = np.concatenate([*means, np.ones(len(SCALARS)), watts])
    known = [_mark(name, robot, marks) for name in names]
    share = np.array([_share(name, mark, robot) for name, mark in zip(names, known, strict=True)])
    deviation = np.abs(mean) * share
    for name, value in _assumed(robot, power, marks).items():
        deviation[names.index(name)] = value
    return PowerParameters(
        name=DATA_SHEET,
        robot=robot.name,
        controller=power.name,
        joints=joints,
        modes=modes,
        mean=mean,
        covariance=np.diag(deviation * deviation),
        sources=tuple(f"data {mark}" if mark else "assumed" for mark in known),
    )


def centre_deviations(robot: RobotModel) -> FloatArray:
    """How far (2 n,) m the centres of mass may lie from where the data have them."""
    length = np.sqrt(np.square(robot.joint_origin[1:, :3, 3]).sum(axis=1))
    own = np.sqrt(np.square(robot.link_com[1:]).sum(axis=1))
    size = np.maximum(np.append(length, 0.0), own)
    marks = [robot.marks.get(f"links.{link}.com_m", "L") for link in robot.link_names[1:]]
    share = np.array([RELATIVE_DEVIATION[mark] for mark in marks])
    return np.tile(CENTRE_SHARE * share * size, len(CENTRES))


def _assumed(robot: RobotModel, power: PowerData, marks: Marks) -> dict[str, float]:
    """Standard deviations of what the data have no mark for."""
    read = marks.get("dc_link.capacitance_f", "L") != "L"
    iron = IRON_SHARE * robot.envelope_torque[:, 0] / robot.velocity_max
    return {
        **{
            f"iron.{joint}": float(value)
            for joint, value in zip(robot.joint_names, iron, strict=True)
        },
        **{f"inverter.{joint}": INVERTER_WATTS for joint in robot.joint_names},
        **{f"gear.{joint}": GEAR_SHARE for joint in robot.joint_names},
        "load_mass": LOAD_MASS,
        "counterbalance": COUNTERBALANCE,
        "tool_watts": TOOL_WATTS,
        LINK: LINK_KNOWN if read else LINK_ESTIMATED,
        "rectifier_efficiency": RECTIFIER_LOSS,
        IDLE: min(IDLE_WATTS * robot.n, power.drives_and_brake_release),
    }


def _share(name: str, mark: str, robot: RobotModel) -> float:
    """The standard deviation of a parameter as a share of its value; 0 without a mark."""
    kind = name.partition(".")[0]
    if _PLACES.get(kind) in robot.estimated:
        return ESTIMATED_DEVIATION
    return RELATIVE_DEVIATION.get(mark, 0.0) * _FACTORS.get(kind, 1.0)


def _mark(name: str, robot: RobotModel, marks: Marks) -> str:
    """The mark of a parameter; "" where the data say nothing of it."""
    kind, _, part = name.partition(".")
    if kind == "link_mass":
        return _of_most(robot, marks)
    place = f"modes.{part}.controller_w" if kind == "watts" else _PLACES.get(kind)
    return marks.get(place, "L") if place else ""


def _of_most(robot: RobotModel, marks: Marks) -> str:
    """The mark that most of the moving mass has."""
    mass_of = dict.fromkeys(RELATIVE_DEVIATION, 0.0)
    for link, mass in zip(robot.link_names[1:], robot.link_mass[1:], strict=True):
        mass_of[marks.get(f"links.{link}.mass_kg", "L")] += float(mass)
    return max(mass_of, key=lambda mark: mass_of[mark])
