"""Placements: what may move in a cell, the moved cell, overlaps, and the jobs of a placement."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product
from typing import TypeAlias

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from ir_description import Body, Cell, Equipment, Load
from ir_description.poses import composed, inverse, pose_of, rotation_from_abc
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_studies.work import Job, Row
from ir_values.arrays import FloatArray

# Overlap of two convex bodies, and its depth: is there a plane between them? Curved bodies are
# taken by points on their surface, and all bodies a millimetre smaller than they are. The robot's
# base counts against what it stands on; the planner keeps it clear of everything else.

# m that a body is smaller on each side: machines stand side by side, and data are rounded
TOUCHING = 1e-3
# m that an overlap as drawn may grow: points of a curved body that turns lie so far inside it
DEEPER = 5e-3
_APART = 1e-9  # m between a plane and the bodies that it separates
Overlaps: TypeAlias = "dict[tuple[str, str], float]"
"""Depths [m] by the names of two bodies."""


@dataclass(frozen=True, eq=False)
class _Solid:
    """points (V, 3): of its surface; smaller: of the body that may not touch."""

    name: str
    points: FloatArray
    smaller: FloatArray


@dataclass(frozen=True, eq=False)
class _Plane:
    """Solid below the z axis of its pose (4, 4)."""

    name: str
    pose: FloatArray


def overlaps(cell: Cell) -> Overlaps:
    """What reaches into each other, and how deep [m]: bodies of different machines in any of their
    states (a door that opens needs its place too), bodies and the floor, the robot's base and what
    it stands on.
    """
    machines = [[_shape(body) for body in _bodies(each)] for each in cell.equipment]
    bodies = [body for own in machines for body in own]
    floor = [_Plane("floor", np.eye(4))] if cell.floor else []
    pairs: list[tuple[_Solid | _Plane, _Solid | _Plane]] = []
    for own, other in combinations(machines, 2):
        pairs += product(own, other)
    pairs += product(bodies, floor)
    stands_on = set(cell.ignored_pairs)
    for base, body in product(_base(cell), [*bodies, *floor]):
        if (base.name, body.name) in stands_on:
            pairs.append((base, body))
    depths = {(one.name, other.name): _depth(one, other) for one, other in pairs}
    return {pair: depth for pair, depth in depths.items() if depth > 0.0}


def deeper(
    found: Mapping[tuple[str, str], float], given: Mapping[tuple[str, str], float]
) -> Overlaps:
    """How much deeper [m] than in the given cell, where that is more than DEEPER or new."""
    more = {pair: depth - given.get(pair, 0.0) for pair, depth in found.items()}
    return {pair: by for pair, by in more.items() if pair not in given or by > DEEPER}


def _bodies(machine: Equipment) -> tuple[Body, ...]:
    return machine.bodies_in(*(state.name for state in machine.states))


def _shape(body: Body) -> _Solid | _Plane:
    mesh = body_mesh(body)
    return (
        _Plane(body.name, body.pose) if mesh is None else _solid(body.name, mesh.points, body.pose)
    )


def _base(cell: Cell) -> Iterator[_Solid]:
    for capsule in cell.robot.capsules:
        if capsule.link == 0:
            yield _solid(capsule.name, capsule_mesh(capsule).points, cell.base_pose)


def _solid(name: str, points: FloatArray, pose: FloatArray) -> _Solid:
    points = np.unique(points, axis=0)  # faces share corners
    extent = np.ptp(points, axis=0)
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    share = np.maximum(1.0 - 2.0 * TOUCHING / np.maximum(extent, TOUCHING), 0.0)
    sizes = (points, middle + (points - middle) * share)
    return _Solid(name, *(each @ pose[:3, :3].T + pose[:3, 3] for each in sizes))


def _depth(first: _Solid | _Plane, second: _Solid | _Plane) -> float:
    """How far [m] one must move to come out of the other, 0 where they are apart; of two planes
    too.
    """
    if isinstance(first, _Plane):
        first, second = second, first
    if isinstance(first, _Plane):
        return 0.0
    if isinstance(second, _Plane):
        below, smaller = (
            -_least_height(each, second.pose) for each in (first.points, first.smaller)
        )
        return below if smaller > 0.0 else 0.0
    if not _boxes_overlap(first.smaller, second.smaller) or separable(
        first.smaller, second.smaller
    ):
        return 0.0
    return penetration(first.points, second.points)


def _least_height(points: FloatArray, plane: FloatArray) -> float:
    """Of points (V, 3) above a plane."""
    return float(((points - plane[:3, 3]) @ plane[:3, 2]).min())


def penetration(first: FloatArray, second: FloatArray) -> float:
    """The shortest move that takes one body out of the other: from the origin to the surface of all
    differences of their points (V, 3) and (W, 3).
    """
    try:
        hull = ConvexHull((first[:, None] - second[None]).reshape(-1, 3))
    except QhullError:  # two sheets in one plane
        return TOUCHING
    return max(float(-hull.equations[:, 3].max()), TOUCHING)


def _boxes_overlap(first: FloatArray, second: FloatArray) -> bool:
    """Whether the boxes along the axes overlap."""
    apart = (first.min(axis=0) > second.max(axis=0)) | (second.min(axis=0) > first.max(axis=0))
    return not bool(apart.any())


def separable(first: FloatArray, second: FloatArray) -> bool:
    """Whether a plane lies between points (V, 3) and (W, 3): a linear programme for its normal n,
    offset t and the distance m from both, with all components of n within 1.
    """
    rows = np.vstack(
        [
            np.column_stack([-first, np.ones(len(first)), np.ones(len(first))]),  # n a - t >= m
            np.column_stack([second, -np.ones(len(second)), np.ones(len(second))]),  # n b - t <= -m
        ]
    )
    bounds = [(-1.0, 1.0)] * 3 + [(None, None)] * 2
    found = linprog([0.0, 0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=np.zeros(len(rows)), bounds=bounds)
    return bool(found.status == 0 and -float(found.fun or 0.0) > _APART)


# Variables, and the cell with them moved.

Range: TypeAlias = "tuple[float, float]"
Values: TypeAlias = "Mapping[str, float]"
"""By variable: m or degrees from where things stand in the cell file."""

_STANDING = ("x", "y", "z", "turn_deg")
TURNS = {
    "base": _STANDING,
    "equipment": _STANDING,
    "tool": ("x", "y", "z", "a_deg", "b_deg", "c_deg"),
}
JOINTS = tuple(f"a{k}_deg" for k in range(1, 13))
# decimals: what people can set up
_METRES = 3
_DEGREES = 1


@dataclass(frozen=True)
class Variable:
    """Its name, as base.x or equipment.gauge.turn_deg, and how far it may go."""

    name: str
    low: float
    high: float

    @property
    def owner(self) -> str:
        """What moves: base, park, tool, or equipment. and a machine's name."""
        return self.name.rpartition(".")[0]

    @property
    def part(self) -> str:
        """How it moves: x, turn_deg, ..."""
        return self.name.rpartition(".")[2]

    @property
    def unit(self) -> str:
        """m or deg."""
        return "deg" if self.name.endswith("_deg") else "m"

    def at(self, share: float) -> float:
        """The value at a share of the range, in whole millimetres or tenths of degrees."""
        value = self.low + share * (self.high - self.low)
        rounded = round(value, _DEGREES if self.unit == "deg" else _METRES)
        return min(max(rounded, self.low), self.high) + 0.0


def variables(groups: Mapping[str, Mapping[str, Range]]) -> tuple[Variable, ...]:
    """One per range."""
    return tuple(
        Variable(f"{group}.{name}", *ends)
        for group, ranges in groups.items()
        for name, ends in ranges.items()
    )


def text_of(values: Values) -> str:
    """Values as the key of a placement; what does not move is left out."""
    return (
        " ".join(f"{name}={value!r}" for name, value in sorted(values.items()) if value)
        or "as given"
    )


@dataclass(frozen=True)
class Placing:
    """carried: machines that move with the base."""

    carried: tuple[str, ...] = ()

    def cell(self, given: Cell, values: Values, payload: Mapping[str, float] | None = None) -> Cell:
        """The cell with everything moved by the values, and parts of other masses.

        Raises InvalidValueError for a cell without sense: a posture beyond the joints' limits, too
        much load.
        """
        groups: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            owner, _, part = name.rpartition(".")
            groups.setdefault(owner, {})[part] = value
        cell = given
        if "base" in groups:
            cell = self._with_base(cell, groups["base"])
        for machine in given.equipment:
            moved = groups.get(f"equipment.{machine.name}")
            if moved:
                cell = cell.with_equipment(
                    machine.name, standing(cell.machine(machine.name).pose, moved)
                )
        if "park" in groups:
            park = np.array(cell.park)
            for name, value in groups["park"].items():
                park[JOINTS.index(name)] += np.radians(value)
            cell = replace(cell, park=park)
        if "tool" in groups:
            cell = with_tool(cell, groups["tool"])
        return with_masses(cell, payload or {})

    def _with_base(self, cell: Cell, moved: Mapping[str, float]) -> Cell:
        pose = standing(cell.base_pose, moved)
        by = composed(pose, inverse(cell.base_pose))
        for name in self.carried:
            cell = cell.with_equipment(name, composed(by, cell.machine(name).pose))
        return replace(cell, base_pose=pose)


def standing(pose: FloatArray, moved: Mapping[str, float]) -> FloatArray:
    """A pose (4, 4) moved along the world's axes and turned about its own vertical."""
    turn = rotation_from_abc((moved.get("turn_deg", 0.0), 0.0, 0.0))
    shift = np.array([moved.get(axis, 0.0) for axis in "xyz"])
    return pose_of(pose[:3, 3] + shift, turn @ pose[:3, :3])


def with_tool(cell: Cell, moved: Mapping[str, float]) -> Cell:
    """The cell with its tool mounted elsewhere, the tcp with it."""
    turned = rotation_from_abc([moved.get(f"{name}_deg", 0.0) for name in "abc"])
    by = pose_of([moved.get(axis, 0.0) for axis in "xyz"], turned)
    assert cell.tool is not None  # settings ask for it
    return replace(cell, tool=cell.tool.placed(by), tcp=composed(by, cell.tcp))


def with_masses(cell: Cell, payload: Mapping[str, float]) -> Cell:
    """The cell with parts of other masses, as large as before."""
    parts = tuple(
        replace(part, load=of_mass(part.load, payload[part.name])) if part.name in payload else part
        for part in cell.parts
    )
    return replace(cell, parts=parts) if payload else cell


def of_mass(load: Load, mass: float) -> Load:
    """The same body of another density."""
    return replace(load, mass=mass, inertia=load.inertia * (mass / load.mass))


FIRST_SEED = 0


@dataclass(frozen=True)
class PlacementCondition:
    """What every placement is planned for: a cycle time (0: free) and the masses [kg] of parts."""

    cycle_time: float
    payload: tuple[tuple[str, float], ...] = ()

    @property
    def text(self) -> str:
        """In words."""
        cycle = f"{shortest(self.cycle_time)} s" if self.cycle_time else "no cycle time"
        return " ".join([cycle, *(f"{name} {shortest(mass)} kg" for name, mass in self.payload)])


def shortest(value: float) -> str:
    """The shortest decimal that no other number has: rows are known by it."""
    return repr(float(value)).removesuffix(".0")


@dataclass(frozen=True)
class Placement:
    """Where things stand, by variable. What stands as given is left out: its jobs are those of the
    cell.
    """

    values: Values

    def __post_init__(self) -> None:
        moved = {name: value for name, value in sorted(self.values.items()) if value}
        object.__setattr__(self, "values", moved)

    @cached_property
    def key(self) -> str:
        """What it is known by."""
        return text_of(self.values)

    def look(self, conditions: Sequence[PlacementCondition]) -> Job:
        """The job of a look at it."""
        payloads = [dict(one) for one in payloads_of(conditions)]
        return Job(
            f"look|{self.key}|{payloads}",
            {"stage": "look", "values": self.values, "payloads": payloads},
        )

    def plan(
        self, condition: PlacementCondition, seed: int = FIRST_SEED, *, robots: bool = False
    ) -> Job:
        """The job of its program in full; robots: with what the drawn robots add."""
        asked = {
            "values": self.values,
            "payload": dict(condition.payload),
            "seed": seed,
            "robots": robots,
        }
        words = {"stage": "plan", "cycle_time": condition.cycle_time, **asked}
        stage = "plan and robots" if robots else "plan"
        return Job(f"{stage}|{self.key}|{condition.text}|{seed}", words)


def payloads_of(conditions: Sequence[PlacementCondition]) -> list[tuple[tuple[str, float], ...]]:
    """The masses of parts, each once."""
    return list(dict.fromkeys(condition.payload for condition in conditions))


@dataclass(frozen=True)
class Known:
    """What is known of a placement.

    look: the row of the look; plans: those of its programs by condition, as far as they were made.
    """

    placement: Placement
    look: Row
    plans: Mapping[PlacementCondition, Row]
    conditions: tuple[PlacementCondition, ...]

    @property
    def coarse(self) -> float:
        """Mean cost of coarse movements over the conditions; inf where it is impossible."""
        if not self.look.get("solved"):
            return math.inf
        costs = dict(zip(payloads_of(self.conditions), self.look["coarse"], strict=True))
        return float(np.mean([costs[condition.payload] for condition in self.conditions]))

    @property
    def planned(self) -> bool:
        """Whether its programs were planned for all conditions."""
        return len(self.plans) == len(self.conditions)

    @property
    def cost(self) -> float:
        """Mean cost of its programs; inf where one is impossible, NaN where one isn't planned."""
        if not self.look.get("solved"):
            return math.inf
        if not self.planned:
            return math.nan
        return float(
            np.mean(
                [row["cost_j"] if row.get("solved") else math.inf for row in self.plans.values()]
            )
        )

    @property
    def reason(self) -> tuple[str, str]:
        """Kind and sentence of what makes it impossible, empty where nothing does."""
        for row in (self.look, *self.plans.values()):
            if not row.get("solved"):
                return str(row.get("kind", row.get("outcome", ""))), str(row.get("message", ""))
        return "", ""
