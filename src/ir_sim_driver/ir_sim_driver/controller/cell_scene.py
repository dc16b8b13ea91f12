"""Scene of the cell: machines and their states, lying parts, pairs that may touch, clearances."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ir_description import Body, Cell, Equipment
from ir_description.cell import AllowedContact, PartRoute, cell_in, sweep_speeds
from ir_description.shapes import Capsule
from ir_kernels.chain import Chain
from ir_kernels.collision import CollisionModel
from ir_msgs_py.announcements import MachineState
from ir_sim_driver.plant import Carried
from ir_values.arrays import BoolArray, FloatArray
from ir_values.errors import InvalidValueError

# Machine states, switched by signals; a change takes its time.
#
# A machine with a switch is in the state that its cell says until its signal is heard for the
# first time. While it changes it is in both states: their bodies are all there, with what they
# sweep.

# s: a change that ends within this is waited for, as the clocks of PLC and plant differ a little
SOON = 0.5


class MachinesInScene:
    """Machines of `cell`; times [s] are of the plant."""

    def __init__(self, cell: Cell) -> None:
        self._states: dict[str, str] = {}
        self._moving: dict[str, tuple[str, float]] = {}  # the next state, and when it is reached
        self.stand_in(cell)

    def stand_in(self, cell: Cell) -> None:
        """Machines of another cell; a door that is switched as before stays as it is."""
        before = {name: state for name, state in self._states.items() if self._is_switched(name)}
        self.cell = cell
        self._states = {machine.name: machine.state for machine in cell.equipment}
        for machine in cell.equipment:
            known = [state.name for state in machine.states]
            if machine.switch is not None and before.get(machine.name) in known:
                self._states[machine.name] = before[machine.name]
        self._moving = {
            name: change
            for name, change in self._moving.items()
            if name in before and self._is_switched(name)
        }

    def _is_switched(self, name: str) -> bool:
        return any(
            machine.name == name and machine.switch is not None for machine in self.cell.equipment
        )

    @property
    def next_change(self) -> float:
        """When the next machine reaches its state; inf where none changes."""
        return min((when for _, when in self._moving.values()), default=float("inf"))

    def hear(self, signal: str, level: bool, now: float) -> bool:
        """Take the level of a signal; returns whether a machine begins to change."""
        begun = False
        for machine in self.cell.equipment:
            if machine.switch is not None and machine.switch.signal == signal:
                begun |= self._turn(
                    machine, machine.switch.on if level else machine.switch.off, now
                )
        return begun

    def _turn(self, machine: Equipment, target: str, now: float) -> bool:
        assert machine.switch is not None
        name = machine.name
        time = machine.switch.time
        state = self._states[name]
        (ahead, when) = self._moving.get(name, ("", now))
        if target == (ahead or state):
            return False
        if ahead and target == state:  # turned round in between
            self._states[name] = ahead
            time = max(0.0, time - (when - now))
        self._moving[name] = target, now + time
        return True

    def step(self, now: float) -> bool:
        """End what is due; returns whether anything was."""
        due = [name for name, (_, when) in self._moving.items() if when <= now]
        for name in due:
            self._states[name], _ = self._moving.pop(name)
        return bool(due)

    def present(self, machine: Equipment) -> tuple[str, ...]:
        """The states whose bodies are there."""
        ahead = self._moving.get(machine.name)
        return (self._states[machine.name], *(() if ahead is None else ahead[:1]))

    def present_states(self) -> dict[str, tuple[str, ...]]:
        """Present states of all machines, by name."""
        return {machine.name: self.present(machine) for machine in self.cell.equipment}

    def states(self, now: float) -> tuple[MachineState, ...]:
        """What every machine is in, and changes to."""
        result = []
        for name, state in self._states.items():
            ahead, when = self._moving.get(name, ("", now))
            result.append(MachineState(name, state, ahead, max(0.0, when - now)))
        return tuple(result)

    def soon(self, wanted: Iterable[str], now: float) -> bool:
        """Whether a machine will be in a wanted state ("lathe=door_open") within SOON, but isn't
        yet.
        """
        for text in wanted:
            name, _, state = text.partition("=")
            ahead, when = self._moving.get(name, ("", now))
            if ahead == state and when - now <= SOON:
                return True
        return False

    def refusal(self, wanted: Iterable[str], now: float) -> str:
        """Why a movement that relies on these states can't start, "" when it can."""
        sentences = (self._refusal(text, now) for text in wanted)
        return next((sentence for sentence in sentences if sentence), "")

    def _refusal(self, text: str, now: float) -> str:
        """Why a trajectory that relies on "machine=state" can't begin now; "" where it can. now
        [s].
        """
        name, _, wanted = text.partition("=")
        machine = next((each for each in self.cell.equipment if each.name == name), None)
        if machine is None:
            known = ", ".join(self._states)
            return (
                f"the trajectory relies on {text[:80]!a}: no machine has that name; known are "
                f"{known}"
            )
        states = [state.name for state in machine.states]
        if wanted not in states:
            known = ", ".join(states) or "none"
            return (
                f"the trajectory relies on {text[:80]!a}: {name} has no such state; known are "
                f"{known}"
            )
        state = self._states[name]
        (ahead, when) = self._moving.get(name, ("", now))
        if state == wanted and not ahead:
            return ""
        going = f", changing to {ahead} for another {when - now:.2f} s" if ahead else ""
        return (
            f"{name} is {state}{going}: the trajectory relies on {wanted}; "
            f"{self._advice(machine, wanted)}"
        )

    def _advice(self, machine: Equipment, wanted: str) -> str:
        switch = machine.switch
        if switch is None or wanted not in (switch.on, switch.off):
            return "no signal switches it: change the cell or plan again"
        answers = [signal.name for signal in self.cell.signals if signal.follows == switch.signal]
        no = "" if wanted == switch.on else "not "
        last = answers[0] if answers else switch.signal
        return f"wait for signal {no}{last} ({no}{switch.signal} takes {switch.time:g} s)"


# Parts: held by the robot, lying where they were put down, or not there.

_THERE = 0.01  # m: twice the tube that the tool is kept in


class Parts:
    """Parts of `cell`; a part lies as it was held when the tcp stood at its place (4, 4). Where the
    cell has a route, parts come to its first station and go from its last one by themselves, and a
    machine that holds several takes them in.
    """

    def __init__(self, cell: Cell, load: Carried) -> None:
        self.stand_in(cell, load)

    def stand_in(self, cell: Cell, load: Carried) -> None:
        """Parts of another cell lie where that says, but for those that are held."""
        self.cell = cell
        self._held = _parts_of(load)
        start = cell.parts_at_start()
        self._inside = start.inside.keys() - self._held
        self._rooms = [cell.station(name).pose for name in start.rooms]
        self._places = {
            name: cell.station(station).pose
            for name, station in start.lying.items()
            if station and name not in self._held
        }

    def carry(self, load: Carried, tcp: FloatArray) -> None:
        """Hold the parts of this load from now on; what is let go stays where the tcp (4, 4) is."""
        held = _parts_of(load)
        known = {part.name for part in self.cell.parts}
        for name in self._held - held:
            if name in known:
                self._places[name] = tcp
        for name in held:
            self._places.pop(name, None)
        self._inside -= held
        released = self._held - held
        self._held = held
        if released and self.cell.route is not None:
            self._supply(self.cell.route)

    def _supply(self, route: PartRoute) -> None:
        """What lies at the last station is taken away, what lies at a machine for several is in it;
        the next part comes to the first station when one was put down elsewhere.
        """
        first, last = (self.cell.station(name).pose for name in (route.visits[0], route.visits[-1]))
        for name, place in list(self._places.items()):
            room = any(_is_at_station(place, station) for station in self._rooms)
            if room or _is_at_station(place, last):
                del self._places[name]
            if room:
                self._inside.add(name)
        there = self._held | self._places.keys() | self._inside
        absent = (part.name for part in self.cell.parts if part.name not in there)
        following = route.following(absent)
        if following and not any(_is_at_station(place, first) for place in self._places.values()):
            self._places[following] = first

    def bodies(self) -> tuple[Body, ...]:
        """What lies there, in the world."""
        return tuple(
            body for name, pose in self._places.items() for body in self.cell.part(name).lying(pose)
        )


def _is_at_station(place: FloatArray, station: FloatArray) -> bool:
    """Whether a part was put down at a station: the tcp was there within what it may be off its
    path.
    """
    return float(np.linalg.norm(place[:3, 3] - station[:3, 3])) < _THERE


def _parts_of(load: Carried) -> set[str]:
    return {each.name for each in load.loads if each.kind == "part"}


# Collision scene at one moment: robot, tool and part against machines, floor and lying parts.

TOUCH = 1e-5  # m of overlap that counts as touching: ten times what distances are off by
ALLOWED_DEPTH = 5e-3  # m that an allowed pair may overlap: as far as the tool may be off its path
# links
_UPPER_ARM = 2
_FOREARM = 3
ZONE_MARGIN = 0.05  # m around a zone where its contacts are still allowed: beyond usual S_m


class ContactScene:
    """All pairs of `capsules` and `bodies`, and of capsules among themselves. Never changed.

    speeds: bounds [m/s] of bodies that move by themselves, by name.
    """

    def __init__(
        self,
        cell: Cell,
        chain: Chain,
        load: Carried,
        bodies: Iterable[Body],
        speeds: Mapping[str, float] | None = None,
    ) -> None:
        self.cell = cell
        self.chain = chain
        bodies = tuple(bodies)
        self.speeds = speeds or {}
        self.capsules: tuple[Capsule, ...] = (
            *cell.robot.capsules,
            *(capsule for each in load.loads for capsule in each.capsules),
        )
        own = (
            *(
                (capsule.name, other)
                for each in load.loads
                for capsule in each.capsules
                for other in cell.robot.load_self_capsules
            ),
            *cell.robot.self_pairs,
        )
        there = {*(capsule.name for capsule in self.capsules), *(body.name for body in bodies)}
        ignored = tuple(pair for pair in cell.ignored_pairs if there.issuperset(pair))
        self.model = CollisionModel(chain, self.capsules, bodies, own, ignored)
        self.touching: FloatArray = self._touching()

    def _touching(self) -> FloatArray:
        """Distances (Z,) that count as touching: capsules that overlap by construction touch where
        they do so deeper than plans go, and by what the robot may be off its path.
        """
        result = np.full(len(self.model.pairs), -TOUCH)
        reduced = {
            frozenset((first, second)): distance
            for first, second, distance, _ in self.cell.robot.reduced_distances
            if distance < ALLOWED_DEPTH
        }
        for z, (_, a, b) in enumerate(self.model.pairs if reduced else ()):
            if frozenset((a, b)) in reduced:
                result[z] = min(-TOUCH, reduced[frozenset((a, b))] - ALLOWED_DEPTH)
        return result

    @classmethod
    def of(
        cls, cell: Cell, chain: Chain, load: Carried, machines: MachinesInScene, parts: Parts
    ) -> ContactScene:
        """The scene of the cell as its machines and parts are now."""
        floor = tuple(body for body in cell.bodies() if body.name == "floor") if cell.floor else ()
        states = machines.present_states()
        elsewhere = {
            each.name: states[each.name]
            for each in cell.equipment
            if states[each.name] != (each.state,)
        }
        # machines as the file has them keep their placed bodies, which take long to make
        around = (
            body for each in cell_in(cell, elsewhere).equipment for body in each.world_bodies()
        )
        speeds = {
            name: speed
            for machine in cell.equipment
            if len(states[machine.name]) == 2
            for name, speed in sweep_speeds(machine, *states[machine.name]).items()
        }
        return cls(cell, chain, load, (*floor, *around, *parts.bodies()), speeds)

    @cached_property
    def groups(self) -> tuple[tuple[BoolArray, FloatArray], ...]:
        """Pairs (Z,) with the reaches (n,) [m] of the joints that move them: those of links 1 and 2
        with what stands around, those of the wrist among themselves, and all others.
        """
        n = len(self.reach)
        base = self.cell.robot.base
        upper_arm = _UPPER_ARM + base
        forearm = _FOREARM + base
        link = {capsule.name: capsule.link for capsule in self.capsules}
        outer = np.array([max(link[a], link.get(b, 0)) for _, a, b in self.model.pairs], dtype=int)
        inner = np.array([min(link[a], link.get(b, 0)) for _, a, b in self.model.pairs], dtype=int)
        wrist = inner >= forearm
        near = (inner == 0) & (outer <= upper_arm)
        joints = np.arange(n)
        return (
            (near, self._reach_of(_ends(c for c in self.capsules if c.link <= upper_arm))),
            (wrist, np.where(joints >= forearm, self.reach, 0.0)),
            (~near & ~wrist, self.reach),
        )

    @cached_property
    def reach(self) -> FloatArray:
        """(n,): how far from each joint's axis anything that it moves can be [m]; of a rail 1, as
        it moves all by its own motion.
        """
        return self._reach_of(_ends(self.capsules))

    def _reach_of(self, points: Iterable[tuple[int, float]]) -> FloatArray:
        """Reach for points on links, so far [m] from their frames."""
        robot = self.cell.robot
        offsets = np.linalg.norm(np.array(robot.joint_origin)[:, :3, 3], axis=1)
        result = np.zeros(robot.n)
        for link, far in points:
            for joint in range(link - 1, -1, -1):
                result[joint] = max(result[joint], far)
                far += float(offsets[joint])
        result[: robot.base] = 1.0
        return result

    def contacts(self, stop: str) -> tuple[AllowedContact, ...]:
        """What a station or a path allows. Raises InvalidValueError (one that nobody has)."""
        try:
            return self.cell.contacts_at(stop)
        except LookupError as error:
            raise InvalidValueError(str(error)) from error

    def allowed(self, station: str) -> BoolArray:
        """Which pairs (Z,) may touch at a station; none for ""."""
        if not station:
            return np.zeros(len(self.model.pairs), dtype=bool)
        contacts = {frozenset((c.body_a, c.body_b)) for c in self.contacts(station)}
        return np.array([frozenset((a, b)) in contacts for _, a, b in self.model.pairs], dtype=bool)

    def inside(self, q: FloatArray, station: str) -> bool:
        """Whether the tcp at q (n,) is in the zone of a station's machine, or within ZONE_MARGIN of
        it.
        """
        return bool(self.depth(q[None], station)[0] >= 0.0)

    def depth(self, q: FloatArray, station: str) -> FloatArray:
        """(N,): how far [m] the tcp at q (N, n) is from leaving that; negative: from getting
        there.
        """
        zone = self.cell.zone_at(station)
        if zone is None:
            return np.full(len(q), -np.inf)
        tcp = self.chain.tcp_poses(q)[:, :3, 3]
        local = (tcp - zone.pose[:3, 3]) @ zone.pose[:3, :3]
        beyond = np.abs(local) - 0.5 * zone.size
        far = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        depth: FloatArray = ZONE_MARGIN - far - np.minimum(beyond.max(axis=1), 0.0)
        return depth

    @cached_property
    def tcp_reach(self) -> FloatArray:
        """(n,): how far from each joint's axis the tcp can be [m]."""
        return self._reach_of([(self.cell.robot.n, float(np.linalg.norm(self.cell.tcp[:3, 3])))])


def _ends(capsules: Iterable[Capsule]) -> Iterator[tuple[int, float]]:
    """Link and distance [m] from its frame of what moves farthest of each: the end of its
    segment.
    """
    for capsule in capsules:
        yield (
            capsule.link,
            max(float(np.linalg.norm(capsule.p0)), float(np.linalg.norm(capsule.p1))),
        )


# Clearances of a trajectory, and where along it the contacts of its station are allowed.
#
# An allowed contact belongs to a station: it counts where the tcp is surely in the zone of the
# station's machine or within a margin of it, as for who watches the robot.

_FINEST = 2e-3  # m of movement of the tcp in which entering the zone is found
_ORDERS = np.arange(6)
_SHIFT = np.array([[math.comb(k, j) for k in range(6)] for j in range(6)], dtype=float)  # Taylor's


class PathPiece(NamedTuple):
    """A part of a path with coefficients (S, n, 6) and durations (S,) [s] along which the distances
    (Z,) [m] must be kept.
    """

    coefficients: FloatArray
    durations: FloatArray
    thresholds: FloatArray


@dataclass(frozen=True, eq=False)
class Keep:
    """Distances (Z,) [m] that the pairs of a scene must keep outside the zone of a station, and
    inside; "" and None: there is no such station.
    """

    scene: ContactScene
    outside: FloatArray
    station: str = ""
    inside: FloatArray | None = None

    def at(self, q: FloatArray) -> FloatArray:
        """What counts at q (n,)."""
        if self.inside is None or not self.scene.inside(q, self.station):
            return self.outside
        return self.inside

    def pieces(self, coefficients: FloatArray, durations: FloatArray) -> Iterator[PathPiece]:
        """The path of segments (S, n, 6) with durations (S,) [s], one piece after the other."""
        if self.inside is None:
            yield PathPiece(coefficients, durations, self.outside)
            return
        parts, spans, inside = self._divided(coefficients, durations)
        bounds = [0, *(np.flatnonzero(np.diff(inside)) + 1).tolist(), len(spans)]
        for a, b in pairwise(bounds):
            yield PathPiece(parts[a:b], spans[a:b], self.inside if inside[a] else self.outside)

    def _divided(
        self, coefficients: FloatArray, durations: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """The same path in halves of its segments until each is inside or not: whether it is,
        (S,).
        """
        parts = coefficients
        spans = durations
        order: FloatArray = np.arange(len(spans), dtype=float)  # places along the path
        width = np.ones(len(spans))
        done: list[tuple[FloatArray, FloatArray, FloatArray, BoolArray]] = []
        while len(spans):
            depth = self.scene.depth(np.ascontiguousarray(parts[:, :, 0]), self.station)
            travel = self._travel(parts, spans)
            known = (np.abs(depth) > travel) | (travel < _FINEST)
            done.append((order[known], parts[known], spans[known], depth[known] > travel[known]))
            first = parts[~known]
            half = 0.5 * spans[~known]
            there = order[~known]
            wide = 0.5 * width[~known]
            parts = np.concatenate((first, _later(first, half)))
            spans = np.concatenate((half, half))
            width = np.concatenate((wide, wide))
            order = np.concatenate((there, there + wide))
        columns = [np.concatenate(column) for column in zip(*done, strict=True)]
        along = np.argsort(columns[0])
        return columns[1][along], columns[2][along], columns[3][along]

    def _travel(self, parts: FloatArray, spans: FloatArray) -> FloatArray:
        """Bound (S,) [m] of how far the tcp gets from the start of each segment."""
        far = np.abs(parts) * spans[:, None, None] ** _ORDERS
        travel: FloatArray = far[:, :, 1:].sum(axis=2) @ self.scene.tcp_reach
        return travel


def _later(parts: FloatArray, by: FloatArray) -> FloatArray:
    """The polynomials (S, n, 6) from `by` (S,) [s] on."""
    lag = by[:, None, None] ** np.maximum(_ORDERS - _ORDERS[:, None], 0) * _SHIFT
    later: FloatArray = np.einsum("sjk,snk->snj", lag, parts)
    return later
