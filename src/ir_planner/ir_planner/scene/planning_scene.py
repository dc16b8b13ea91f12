"""The scene of one request: the cell as it stands, what the robot holds, and the models of both.
Never changed.

A request takes its snapshot once; a cell that changes meanwhile does not reach it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ir_description import (
    Cell,
    Load,
    PartPlaces,
    PowerData,
    PowerParameters,
    RobotModel,
    Station,
    data_sheet_of,
)
from ir_description.cell import AllowedContact, Zone
from ir_description.robot import LINK
from ir_kernels import Chain, CollisionModel, DynamicsModel, inverse_kinematics
from ir_kernels.ik_set import IkSet, InverseKinematics
from ir_kernels.inverse_kinematics import RailIk
from ir_kernels.power import DcBusParameters, Regeneration
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, unknown_name
from ir_planner.scene.actuators import LinkVoltage, within_current_and_voltage
from ir_planner.scene.motion_limits import MotionLimits
from ir_planner.scene.movement_cost import movement_weights
from ir_planner.scene.tool_bounds import ToolBounds
from ir_values.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Drives:
    """regeneration: what the DC link does with braking energy. torque_reserve: share of the torque
    envelope that plans leave to the feedback. parameters: None, as the data have them. voltage:
    where current and voltage bound the torque, eq. (8), not the envelope of the data.
    """

    regeneration: Regeneration = "shared"
    torque_reserve: float = 0.0
    parameters: PowerParameters | None = None
    voltage: LinkVoltage | None = None

    @property
    def rectifier_efficiency(self) -> float:
        """Share of the mains power that reaches the DC link."""
        return 1.0 if self.parameters is None else self.parameters.value("rectifier_efficiency")

    @property
    def link_size(self) -> float:
        """Times the joules that the data of the DC link give it."""
        return 1.0 if self.parameters is None else self.parameters.value(LINK)

    def robot(self, robot: RobotModel) -> RobotModel:
        """The robot with the friction, losses and masses of the parameters, and the torque that is
        available. Raises RequestError for parameters of another robot, and for a voltage that does
        not reach full speed.
        """
        parameters = self.parameters
        if parameters is None:
            return self._with_torque_left(robot)
        if (parameters.robot, parameters.joints) != (robot.name, robot.joint_names):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"power parameters {parameters.name!r} are of robot {parameters.robot!r}: "
                f"the cell has {robot.name!r}",
            )
        return self._with_torque_left(parameters.robot_with(robot))

    def _with_torque_left(self, robot: RobotModel) -> RobotModel:
        """The robot with the torque that current and voltage leave, where these bound it."""
        return robot if self.voltage is None else within_current_and_voltage(robot, self.voltage)

    def loads(self, loads: Iterable[Load]) -> tuple[Load, ...]:
        """Loads with the masses and watts of the parameters."""
        return tuple(loads) if self.parameters is None else self.parameters.loads_with(loads)

    def power(self, power: PowerData) -> PowerData:
        """The controller with the watts of the parameters."""
        return power if self.parameters is None else self.parameters.power_with(power)


PROOF_TOLERANCE = 1e-6  # m: proofs show d > S_m - 1e-6
END_TOLERANCE = 2e-7  # m: a state is free where d > S_m - 2e-7, so that a proof can begin there
_TURN = 2.0 * np.pi
RUNNING = "STAND_ON_MOTORS"
CENTRE_STEP = 2e-3  # m: between two centres of mass whose torques are compared


Stops = str | tuple[str, ...]
"""A station or a path whose contacts are allowed, "" for none; several, each in its own zone."""


def load_text(cell: Cell) -> str:
    """How the load is written: "gripper+part", "gripper", "none"."""
    names = [load.name for load in cell.loads("")]
    return LOAD_SEPARATOR.join(names) or NO_LOAD


@dataclass(frozen=True, eq=False)
class PlanningScene:
    """cell: its parts lie where they are for this request. loads: what is attached, in the frame of
    the last link. drives: what is assumed of them. cell_hash: of the cell as it stood when the
    request came, "" where nobody asked. doors: machines that are not as that cell has them, by what
    a driver says.
    """

    cell: Cell
    loads: tuple[Load, ...]
    power: PowerData
    drives: Drives = field(default_factory=Drives)
    cell_hash: str = ""
    doors: tuple[tuple[str, tuple[str, ...]], ...] = ()

    def leaving(self, torque_reserve: float) -> "PlanningScene":
        """The same with another share of the torque for the feedback; what is computed stays."""
        scene = replace(self, drives=replace(self.drives, torque_reserve=torque_reserve))
        scene.__dict__.update({**self.__dict__, "drives": scene.drives})
        return scene

    @property
    def load_text(self) -> str:
        """What is attached, as people write it."""
        return LOAD_SEPARATOR.join(load.name for load in self.loads) or NO_LOAD

    @cached_property
    def chain(self) -> Chain:
        """Kinematics up to the tcp."""
        return Chain(self.cell.robot, self.cell.base_pose, self.cell.tcp)

    @cached_property
    def dynamics(self) -> DynamicsModel:
        """Dynamics with the loads."""
        drives = self.drives
        return DynamicsModel(drives.robot(self.cell.robot), self._attached, self.cell.base_pose)

    @cached_property
    def collision(self) -> CollisionModel:
        """All pairs of capsules and bodies, and of capsules among themselves."""
        robot = self.cell.robot
        capsules = (*robot.capsules, *(capsule for load in self.loads for capsule in load.capsules))
        pairs = (
            *(
                (c.name, other)
                for load in self.loads
                for c in load.capsules
                for other in robot.load_self_capsules
            ),
            *robot.self_pairs,
        )
        bodies = self.cell.bodies()
        there = {*(capsule.name for capsule in capsules), *(body.name for body in bodies)}
        ignored = tuple(pair for pair in self.cell.ignored_pairs if there.issuperset(pair))
        return CollisionModel(self.chain, capsules, bodies, pairs, ignored)

    @cached_property
    def inverse_kinematics(self) -> InverseKinematics:
        """All branches and turns, by the method that the arm allows."""
        return inverse_kinematics(
            self.chain, self.cell.robot.position_min, self.cell.robot.position_max
        )

    def inverse_kinematics_at(self, places: ArrayLike) -> InverseKinematics:
        """The same with a rail at these places (P,) [m], which without a rail say nothing."""
        everywhere = self.inverse_kinematics
        return everywhere.with_places(places) if isinstance(everywhere, RailIk) else everywhere

    def inverse_kinematics_beside(self, q: FloatArray) -> InverseKinematics:
        """The same with a rail that stays where it is at q (n,)."""
        return self.inverse_kinematics_at(q[:1])

    def inverse_kinematics_along(self, poses: FloatArray, rails: FloatArray) -> IkSet:
        """All solutions for poses (N, 4, 4) of the tcp in the world, with the rail at places (N, 1)
        [m] of their own; (N, 0) without one.
        """
        everywhere = self.inverse_kinematics
        if isinstance(everywhere, RailIk):
            return everywhere.solve_each(poses, rails[:, 0])
        return everywhere.solve(poses)

    def rail_places(self, near: FloatArray) -> FloatArray:
        """Places (P,) [m] of the rail at which a pose is sought: evenly over its travel, and where
        it is at near (n,); empty without a rail.
        """
        everywhere = self.inverse_kinematics
        if not isinstance(everywhere, RailIk):
            return np.zeros(0)
        return np.unique(np.append(everywhere.places, near[0]))

    @cached_property
    def turning(self) -> BoolArray:
        """Axes (n,) that turn twice: a whole turn to both sides of 0."""
        robot = self.cell.robot
        twice = np.asarray((robot.position_min <= -_TURN) & (robot.position_max >= _TURN))
        twice[: robot.base] = False
        return twice

    @cached_property
    def inverse_kinematics_once(self) -> InverseKinematics:
        """The same without whole turns of the axes that turn twice: these in [-pi, pi]."""
        robot = self.cell.robot
        turning = self.turning
        low = np.where(turning, -np.pi, robot.position_min)
        return inverse_kinematics(self.chain, low, np.where(turning, np.pi, robot.position_max))

    @cached_property
    def weights(self) -> FloatArray:
        """Weights (n,) of eq. (9) with the loads."""
        robot = self.cell.robot
        return movement_weights(
            robot.link_mass, robot.velocity_max, sum(load.mass for load in self.loads)
        )

    @cached_property
    def tool_points(self) -> tuple[FloatArray, FloatArray]:
        """Points (P, 3) m in the frame of the last link and radii (P,) m: the tcp, then the ends of
        the capsules of tool and part.
        """
        points = [self.chain.tcp[:3, 3]]
        radii = [0.0]
        for load in self.loads:
            for capsule in load.capsules:
                points += [capsule.p0, capsule.p1]
                radii += [capsule.radius, capsule.radius]
        return np.array(points), np.array(radii)

    @cached_property
    def tool_bounds(self) -> ToolBounds:
        """What the loads let the tool do."""
        return ToolBounds.of(load.limits for load in self.loads)

    @property
    def limits(self) -> MotionLimits:
        """Bounds of every joint's motion, and of the tool's with the loads."""
        robot = self.cell.robot
        bounds = (robot.velocity_max, robot.acceleration_max, robot.jerk_max)
        limits = MotionLimits(
            *bounds, torque_reserve=self.drives.torque_reserve, tool=self.tool_bounds
        )
        return limits.with_torque_share(limits.torque_share)

    @property
    def base_watts(self) -> float:
        """Mains power [W] of controller, drives and tool while the motors are on, without the
        axes.
        """
        tool = self.tool_watts(drive_bus=True)
        return (
            self.power.mode(RUNNING).controller_watts + self.power.drives_and_brake_release + tool
        )

    @property
    def load_mass(self) -> float:
        """Mass [kg] of what is attached, as it is declared."""
        return float(sum(load.mass for load in self.loads))

    def tool_watts(self, *, drive_bus: bool) -> float:
        """Watts of what is attached, with its share of the drive bus where that is up."""
        return float(sum(load.watts(drive_bus=drive_bus) for load in self._attached))

    @cached_property
    def _attached(self) -> tuple[Load, ...]:
        """The loads with the masses and watts of the parameters."""
        return self.drives.loads(self.loads)

    @cached_property
    def parameters(self) -> PowerParameters:
        """What the joules follow from."""
        return self.drives.parameters or data_sheet_of(self.cell.robot, self.power)

    @cached_property
    def moved_centres(self) -> dict[int, tuple[DynamicsModel, DynamicsModel]]:
        """By the place of each uncertain centre of mass among the parameters: dynamics with it on
        both sides of where it is, CENTRE_STEP apart.
        """
        parameters = self.parameters
        places = range(len(parameters.names))[parameters.centre_places()]
        moved = {}
        for k in (k for k in places if parameters.deviation[k] > 0.0):
            step = 0.5 * CENTRE_STEP * np.eye(len(parameters.mean))[k]
            sides = [
                replace(parameters, mean=parameters.mean + side * step) for side in (-1.0, 1.0)
            ]
            robots = [side.robot_with(self.cell.robot) for side in sides]
            pose = self.cell.base_pose
            less, more = (DynamicsModel(robot, self._attached, pose) for robot in robots)
            moved[k] = (less, more)
        return moved

    @cached_property
    def unloaded(self) -> DynamicsModel:
        """Dynamics without what is attached."""
        return DynamicsModel(self.drives.robot(self.cell.robot), (), self.cell.base_pose)

    @property
    def dc_bus(self) -> DcBusParameters:
        """What the drives' bus does with braking energy."""
        capacity = self.power.dc_link_capacity_energy * self.drives.link_size
        return DcBusParameters(capacity, self.drives.regeneration)

    def thresholds(self, safety_distance: float, station: Stops = "") -> FloatArray:
        """Distance (Z,) m that each pair must exceed: S_m, less where the robot's data have the
        pair near by construction, or what `station` allows the pair.
        """
        result = np.minimum(safety_distance, self._reduced)
        for contact in self._contacts(station):
            for z in self._numbers_of(contact.body_a, contact.body_b):
                result[z] = min(result[z], contact.safety_distance)
        return result

    @cached_property
    def _reduced(self) -> FloatArray:
        """What pairs (Z,) keep at most: less than infinity where they are near by construction."""
        result = np.full(len(self.collision.pairs), np.inf)
        for first, second, distance, _ in self.cell.robot.reduced_distances:
            result[self._numbers_of(first, second)] = distance
        return result

    def own_distance(self, station: Stops) -> BoolArray:
        """Which pairs (Z,) have a safety distance of their own at `station`: those that it allows,
        and those that are near by construction of the robot.
        """
        return self.allowed(station) | np.isfinite(self._reduced)

    def allowed(self, station: Stops) -> BoolArray:
        """Which pairs (Z,) may touch at `station`; none for ""."""
        result = np.zeros(len(self.collision.pairs), dtype=bool)
        for contact in self._contacts(station):
            result[self._numbers_of(contact.body_a, contact.body_b)] = True
        return result

    @cached_property
    def _numbers(self) -> dict[tuple[str, str], list[int]]:
        """Numbers of the pairs of two names, in their order."""
        numbers: dict[tuple[str, str], list[int]] = {}
        for z, (_, body_a, body_b) in enumerate(self.collision.pairs):
            numbers.setdefault((body_a, body_b), []).append(z)
        return numbers

    def _numbers_of(self, a: str, b: str) -> list[int]:
        return self._numbers.get((a, b), []) + self._numbers.get((b, a), [])

    def _contacts(self, station: Stops) -> tuple[AllowedContact, ...]:
        if not isinstance(station, str):
            return tuple(contact for stop_name in station for contact in self._contacts(stop_name))
        if not station:
            return ()
        try:
            return self.cell.contacts_at(station)
        except LookupError:
            names = [stop.name for stop in self.cell.stations] + [
                path.name for path in self.cell.paths
            ]
            raise unknown_name("station", station, names) from None

    def zone_of(self, station: str) -> Zone | None:
        """The forbidden zone of the machine of a station or a path, in the world; None: it has
        none.
        """
        return self.cell.zone_at(station)

    def station(self, name: str) -> Station:
        """The station of that name; RequestError lists the known."""
        for station in self.cell.stations:
            if station.name == name:
                return station
        raise unknown_name("station", name, (station.name for station in self.cell.stations))


def with_parts(cell: Cell, parts: PartPlaces) -> Cell:
    """The cell while a program is under way: parts lie where they are between two steps."""
    moved = tuple(replace(part, station=parts.lying[part.name]) for part in cell.parts)
    return replace(cell, parts=moved, program=(), route=None)


def scene_with(
    cell: Cell, load: str, power: PowerData, drives: Drives | None = None
) -> PlanningScene:
    """Scene in which `load` ("gripper+part", "none") is attached; a part that is held lies nowhere.

    Raises RequestError for an unknown load (it lists the known) or two parts at once.
    """
    if load in [one.name for one in cell.whole_loads]:
        return PlanningScene(cell, (cell.whole_load(load),), power, drives or Drives())
    names = [] if load == NO_LOAD else load.split(LOAD_SEPARATOR)
    tool = {cell.tool.name: cell.tool} if cell.tool is not None else {}
    held = [name for name in names if name not in tool]
    _check_load(cell, names, held)
    start = cell.parts_at_start()
    lying = {**start.lying, **dict.fromkeys(held, "")}
    loads = (
        *(tool[name] for name in names if name in tool),
        *(cell.part(name).held(cell.tcp) for name in held),
    )
    standing = with_parts(cell, replace(start, lying=lying)) if held else cell
    return PlanningScene(standing, loads, power, drives or Drives())


def _check_load(cell: Cell, names: Iterable[str], held: list[str]) -> None:
    known = [
        *((cell.tool.name,) if cell.tool is not None else ()),
        *(part.name for part in cell.parts),
    ]
    names = list(names)
    for name in names:
        if name not in known:
            raise unknown_name("load", name, [*known, NO_LOAD])
    if len(held) > 1 or len(set(names)) < len(names):
        listed = LOAD_SEPARATOR.join(names)
        raise RequestError(
            StatusCode.INVALID_OBJECT_NAME,
            f"load {listed!r}: the robot holds one part at a time, each load once",
        )
