"""Things in a cell: machines with states, zones and stations; parts; paths of the tool."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ir_description.cell.zones import Zone, ZoneKind, zone_around
from ir_description.poses import composed
from ir_description.robot import UNLIMITED, Load, ToolLimits
from ir_description.shapes import Body
from ir_kernels import portable
from ir_msgs_py.cartesian import CartesianPath
from ir_values.arrays import FloatArray, direction, frozen_pose, in_range, set_field
from ir_values.errors import InvalidValueError, UnknownNameError

APPROACH_MAX = 5.0
"""Longest approach [m]."""
BLEND_MAX = 1.0
"""Largest blend [m] of a stop that is passed without standing."""
CONFIGURATION_SEARCHES = ("analytic", "ccd")
STARTS_MAX = 10_000
"""Most random starts of a search for configurations."""
SWITCH_MAX = 3600.0
"""Longest change of a machine's state [s]."""
PROCESS_MAX = 86_400.0
"""Longest process of a machine [s]: a day."""
SAMPLES_MAX = 10_000
"""Most samples of a process."""
CAPACITY_MAX = 4
"""Most parts that a machine works on at once, and most that its buffer holds."""


@dataclass(frozen=True)
class EquipmentState:
    """A state of a machine ("door_open") and the bodies that are there in this state only."""

    name: str
    bodies: tuple[str, ...]


@dataclass(frozen=True)
class StateSwitch:
    """The signal that moves a machine between two of its states, and the time [s] that this takes.

    on, off: the state that it changes to when the signal is set and cleared.
    """

    signal: str
    on: str
    off: str
    time: float = 0.0

    def __post_init__(self) -> None:
        in_range(self.time, 0.0, SWITCH_MAX, "s", "time")
        if self.on == self.off:
            raise InvalidValueError(f"a switch needs two states, on and off are both {self.on}")


@dataclass(frozen=True)
class ProcessTimes:
    """How long a machine works on a part where that varies: anything from `low` to `high` s alike,
    or one of `samples` [s], each as often.
    """

    low: float
    high: float
    samples: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        in_range(self.low, 0.0, PROCESS_MAX, "s", "shortest process")
        in_range(self.high, self.low, PROCESS_MAX, "s", "longest process")
        for seconds in self.samples:
            in_range(seconds, self.low, self.high, "s", "sample of a process")

    @staticmethod
    def of(samples: Sequence[float]) -> ProcessTimes:
        """What was measured."""
        return ProcessTimes(min(samples), max(samples), tuple(samples))

    @property
    def mean(self) -> float:
        """Mean [s]."""
        if self.samples:
            return sum(self.samples) / len(self.samples)
        return 0.5 * (self.low + self.high)

    def drawn(self, generator: np.random.Generator) -> float:
        """Seconds of one part."""
        if self.samples:
            return self.samples[int(generator.integers(len(self.samples)))]
        return float(generator.uniform(self.low, self.high))

    def quantile(self, share: float) -> float:
        """Seconds [s] that so large a share in [0, 1] of the parts takes at most."""
        if self.samples:
            place = int(np.ceil(share * len(self.samples))) - 1
            return sorted(self.samples)[max(place, 0)]
        return self.low + share * (self.high - self.low)


def _check_parts(value: float, low: int, name: str) -> None:
    if in_range(value, low, CAPACITY_MAX, "parts", name) % 1.0:
        raise InvalidValueError(f"{name} is {value:g} parts, must be a whole number")


@dataclass(frozen=True, eq=False)
class Equipment:
    """A machine. pose (4, 4) in the world; bodies and zone_in_equipment in the machine's frame.

    A body that no state names is always there; one that states name is there in these states only.
    Where there is a switch, `state` is the one that plans assume and that counts until its signal
    is heard. process [s]: how long it works on a part as plans count, 0: it doesn't. process_times:
    where that varies. capacity: parts that it works on at once, each for itself; buffer: how many
    more it holds, which wait for its work or to be taken, first in, first out.
    """

    name: str
    pose: FloatArray
    bodies: tuple[Body, ...]
    zone_in_equipment: Zone
    states: tuple[EquipmentState, ...] = ()
    state: str = ""
    enabled: bool = True
    switch: StateSwitch | None = None
    process: float = 0.0
    process_times: ProcessTimes | None = None
    capacity: int = 1
    buffer: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", frozen_pose(self.pose, f"pose of {self.name}"))
        in_range(self.process, 0.0, PROCESS_MAX, "s", f"process of {self.name}")
        _check_parts(self.capacity, 1, f"capacity of {self.name}")
        _check_parts(self.buffer, 0, f"buffer of {self.name}")
        names = {body.name for body in self.bodies}
        if len(names) != len(self.bodies):
            raise InvalidValueError(f"equipment {self.name} names a body twice")
        known = [state.name for state in self.states]
        if len(set(known)) != len(known):
            raise InvalidValueError(f"equipment {self.name} names a state twice")
        for state in self.states:
            for body in state.bodies:
                if body not in names:
                    raise UnknownNameError(
                        f"body in state {state.name} of {self.name}", body, names
                    )
        if self.state not in (known or [""]):
            raise UnknownNameError(f"state of {self.name}", self.state, known)
        for end in () if self.switch is None else (self.switch.on, self.switch.off):
            if end not in known:
                raise UnknownNameError(f"state that the switch of {self.name} names", end, known)

    @property
    def places(self) -> int:
        """How many parts it holds at most."""
        return self.capacity + self.buffer

    def has_default_zone(self, stations: Iterable[Station]) -> bool:
        """Whether its zone is the one that a machine with these stations has where none is
        given.
        """
        if all(body.kind == "plane" for body in self.bodies):
            return False
        own = self.zone_in_equipment
        tcps = [station.pose_in_equipment[:3, 3] for station in stations]
        default = zone_around(own.kind, self.bodies, tcps)
        return np.array_equal(default.pose, own.pose) and np.array_equal(default.size, own.size)

    @cached_property
    def zone(self) -> Zone:
        """The forbidden zone in the world."""
        zone = self.zone_in_equipment
        return replace(zone, pose=composed(self.pose, zone.pose))

    def present_bodies(self) -> tuple[Body, ...]:
        """Return the bodies that are there in the current state, in the machine's frame."""
        return self._bodies_of((self.state,))

    def bodies_in(self, *states: str) -> tuple[Body, ...]:
        """Return the bodies that are there in any of these states, in the world."""
        return tuple(body.placed(self.pose) for body in self._bodies_of(states))

    def _bodies_of(self, states: tuple[str, ...]) -> tuple[Body, ...]:
        if not self.enabled:
            return ()
        bound = {body for state in self.states for body in state.bodies}
        here = {body for state in self.states if state.name in states for body in state.bodies}
        return tuple(body for body in self.bodies if body.name not in bound or body.name in here)

    def world_bodies(self) -> tuple[Body, ...]:
        """Return the bodies that are there in the current state, in the world."""
        return self._world_bodies

    @cached_property
    def _world_bodies(self) -> tuple[Body, ...]:
        """Placed once: every scene of a program asks for them."""
        return tuple(body.placed(self.pose) for body in self.present_bodies())


def begin_of_work(now: float, ends: Iterable[float], capacity: int) -> float:
    """When a machine that works on so many parts at once begins with one that comes `now` [s]: at
    once, or when it has finished one of those that came before, which it does at `ends`.
    """
    last = sorted(ends)[-capacity:]
    return max(now, last[0]) if len(last) == capacity else now


@dataclass(frozen=True)
class AllowedContact:
    """A pair that may come closer than the safety distance at a station, and its own distance
    [m].
    """

    body_a: str
    body_b: str
    safety_distance: float

    def __post_init__(self) -> None:
        in_range(self.safety_distance, 0.0, 10.0, "m", "safety_distance")
        if self.body_a == self.body_b:
            raise InvalidValueError(f"an allowed contact pairs {self.body_a} with itself")


@dataclass(frozen=True)
class StationSearch:
    """How a program finds the configurations at a station and the path out of it.

    configurations: "analytic" for all of the closed form, "ccd" for those that cyclic coordinate
    descent finds from `starts` random starts. withdrawal: the search that finds the path out even
    where a straight line is free; "": a straight line where that is free.
    """

    configurations: str = CONFIGURATION_SEARCHES[0]
    starts: int = 32
    withdrawal: str = ""

    def __post_init__(self) -> None:
        in_range(self.starts, 1, STARTS_MAX, "", "starts")
        if self.configurations not in CONFIGURATION_SEARCHES:
            raise UnknownNameError(
                "search for configurations", self.configurations, CONFIGURATION_SEARCHES
            )


@dataclass(frozen=True)
class ToolTilt:
    """How far the tool may lean: an axis (3,) in the frame of the tcp, (): that which points in the
    direction where a movement begins, by at most `most` [rad] from a direction (3,) in the cell,
    (): up.
    """

    most: float
    axis: tuple[float, ...] = ()
    direction: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        in_range(self.most, 0.0, math.pi, "rad", "tilt")
        for name in ("axis", "direction"):
            given = getattr(self, name)
            set_field(self, name, direction(given, f"{name} of a tilt") if given else ())


@dataclass(frozen=True, eq=False)
class Station:
    """Where the tool works: pose (4, 4) of the tcp in the WORLD, and the same in its machine's
    frame.

    zone is the kind of its machine's zone. The tool leaves by approach_distance [m] along -x of the
    tcp. The allowed contacts hold inside the machine's zone only. tilt: how far the tool may lean
    on the movement to it, None: as it likes. limits: of the movements into and out of it. takes:
    states in which parts of a route may be put down there, (): any; gives: the state in which they
    are taken, "": not said, or taken by nobody. blend [m]: how near a program passes the outer end
    of its line, and the station where nothing happens there, instead of standing still; 0: it
    stands still.
    """

    name: str
    equipment: str
    pose: FloatArray
    zone: ZoneKind
    pose_in_equipment: FloatArray
    allowed_contacts: tuple[AllowedContact, ...] = ()
    approach_distance: float = 0.0
    search: StationSearch = StationSearch()
    tilt: ToolTilt | None = None
    limits: ToolLimits = UNLIMITED
    takes: tuple[str, ...] = ()
    gives: str = ""
    blend: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", frozen_pose(self.pose, f"pose of {self.name}"))
        object.__setattr__(
            self, "pose_in_equipment", frozen_pose(self.pose_in_equipment, f"pose of {self.name}")
        )
        in_range(
            self.approach_distance, 0.0, APPROACH_MAX, "m", f"approach_distance of {self.name}"
        )
        in_range(self.blend, 0.0, BLEND_MAX, "m", f"blend of {self.name}")

    def moved(self, machine: Equipment, pose_in_equipment: FloatArray) -> Station:
        """Return the same station at a pose (4, 4) in the frame of its machine as that stands."""
        return replace(
            self,
            pose=composed(machine.pose, pose_in_equipment),
            zone=machine.zone_in_equipment.kind,
            pose_in_equipment=pose_in_equipment,
        )


def station_at(
    equipment: Equipment,
    name: str,
    pose_in_equipment: FloatArray,
    allowed_contacts: tuple[AllowedContact, ...] = (),
    approach_distance: float = 0.0,
    search: StationSearch = StationSearch(),
    tilt: ToolTilt | None = None,
    limits: ToolLimits = UNLIMITED,
    takes: tuple[str, ...] = (),
    gives: str = "",
    blend: float = 0.0,
) -> Station:
    """Return a station of a machine from its pose (4, 4) in the machine's frame."""
    return Station(
        name=name,
        equipment=equipment.name,
        pose=composed(equipment.pose, pose_in_equipment),
        zone=equipment.zone_in_equipment.kind,
        pose_in_equipment=pose_in_equipment,
        allowed_contacts=allowed_contacts,
        approach_distance=approach_distance,
        search=search,
        tilt=tilt,
        limits=limits,
        takes=takes,
        gives=gives,
        blend=blend,
    )


# A part: a load while it is held, bodies of the cell while it lies at a station.


@dataclass(frozen=True, eq=False)
class Part:
    """load and bodies stand in the part's own frame; grasp (4, 4) is that frame in the tcp when it
    is held.

    station: where it lies, "" for nowhere (held, or not there). Lying at a station means lying as
    it is held when the tcp stands at the station. tilt: how far the tool may lean while it is held.
    """

    load: Load
    bodies: tuple[Body, ...]
    grasp: FloatArray
    station: str = ""
    tilt: ToolTilt | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "grasp", frozen_pose(self.grasp, f"grasp of {self.load.name}"))
        if self.load.kind != "part":
            raise InvalidValueError(
                f"the load of part {self.name} is of kind {self.load.kind}, must be part"
            )
        if any(body.kind == "plane" for body in self.bodies):
            raise InvalidValueError(f"part {self.name} has a plane as body; a part is finite")

    @property
    def name(self) -> str:
        """The name of the part."""
        return self.load.name

    def held(self, tcp: FloatArray) -> Load:
        """Return the load in the frame of the last link, where the tcp (4, 4) stands."""
        return self.load.placed(composed(tcp, self.grasp))

    def lying(self, station_pose: FloatArray) -> tuple[Body, ...]:
        """Return its bodies in the world, lying where the tcp (4, 4) would hold it."""
        pose = composed(station_pose, self.grasp)
        return tuple(body.placed(pose) for body in self.bodies)


# A path of the tool that a cell has a name for: a seam, an edge, a bead.


@dataclass(frozen=True, eq=False)
class CellPath:
    """path: its poses are poses of the tcp in the cell. equipment: the machine that it belongs to
    and moves with, "": none. The allowed contacts hold inside that machine's zone, as a station's
    do.
    """

    name: str
    path: CartesianPath
    equipment: str = ""
    allowed_contacts: tuple[AllowedContact, ...] = ()

    def __post_init__(self) -> None:
        if self.allowed_contacts and not self.equipment:
            raise InvalidValueError(
                f"path {self.name} allows contacts but names no equipment: they hold in a "
                "machine's zone"
            )

    def moved(self, by: FloatArray) -> CellPath:
        """The path where its machine has been moved by a transform (4, 4) of the world."""
        segments = tuple(
            replace(segment, poses=tuple(portable.matmul(by, pose) for pose in segment.poses))
            for segment in self.path.segments
        )
        return replace(
            self,
            path=replace(self.path, start=portable.matmul(by, self.path.start), segments=segments),
        )
