"""Access to stations: configurations that reach them, and the straight line out of each.

`ir check` prints it; `--deep` adds every configuration with its line.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_cli.output import Columns, Row, number, text
from ir_description import Cell, Station
from ir_description.cell import AllowedContact
from ir_description.cell_review import CellFinding
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.program.steps import Route, Scenes, placed_steps
from ir_planner.scene import PlanningScene, tcp_inside
from ir_planner.service import line_poses
from ir_planner.settings import PlannerSettings
from ir_planner.timing import need_of
from ir_values.arrays import FloatArray

# Situations at a station, and the configurations that reach it.

_SAME = 1e-6  # rad
_ABOUT = 0.02  # rad about machine home


@dataclass(frozen=True, eq=False)
class StationVisit:
    """A station with what is held there, where the parts lie and how the doors stand."""

    station: Station
    scene: PlanningScene

    @property
    def lying(self) -> str:
        """Which parts lie where: "gear at pallet", "" for none."""
        return ", ".join(
            f"{part.name} at {part.station}" for part in self.scene.cell.parts if part.station
        )


def visits(cell: Cell) -> Iterator[StationVisit]:
    """Every station as the program finds it when it arrives and when it leaves; as it is before the
    program where that does not go. Each situation once.
    """
    scenes = Scenes(cell, cell.robot.controller)
    route = Route.over(placed_steps(cell, cell.program, cell.parts_at_start()), scenes)
    found: dict[str, list[PlanningScene]] = {station.name: [] for station in cell.stations}
    for place in range(len(route)):
        if route.at(place).step.kind == "STATION":
            found[route.name(place)] += [route.arriving(place), route.leaving(place)]
    start = scenes.of(cell.parts_at_start())
    for name, situations in found.items():
        once = {id(scene): scene for scene in situations or [start]}
        yield from (StationVisit(cell.station(name), scene) for scene in once.values())


def heavy_loads(cell: Cell) -> Iterator[CellFinding]:
    """Loads that need more of a joint's torque, moved slowly about machine home, than the default
    reserve leaves, or than there is.
    """
    scenes = [PlanningScene(cell, cell.loads(), cell.robot.controller)]
    scenes += [
        PlanningScene(cell, cell.loads(part.name), cell.robot.controller) for part in cell.parts
    ]
    here = np.array(cell.machine_home)
    reserve = PlannerSettings().torque_reserve
    for scene in scenes:
        need = need_of([(here - _ABOUT, here + _ABOUT)], scene)
        if need >= 1.0:
            yield CellFinding(
                "error",
                scene.load_text,
                f"needs {need:.2f} times the torque of a joint to be moved slowly at machine home: "
                "it must be below 1",
            )
        elif need > 1.0 - reserve:
            yield CellFinding(
                "warning",
                scene.load_text,
                f"needs {need:.3f} of the torque of a joint to be moved slowly at machine home: "
                f"{1.0 - need:.3f} is left at most, less than the reserve of {reserve:g} for the "
                "feedback; such movements leave less and say so",
            )


def reaching(visit: StationVisit) -> FloatArray:
    """Configurations (K, n) that reach a station, free or not, those that differ by whole turns
    once: the one nearest to machine home.
    """
    home = visit.scene.cell.machine_home
    q = visit.scene.inverse_kinematics.solve(np.asarray(visit.station.pose)[None]).q
    kept: list[FloatArray] = []
    for one in q[np.argsort(np.abs(q - home).sum(axis=1), kind="stable")]:
        if all(np.abs(np.sin(0.5 * (one - other))).max() > _SAME for other in kept):
            kept.append(one)
    return np.array(kept).reshape(-1, len(home))


def stations_of(cell: Cell) -> list[Row]:
    """One row per situation at a station: configurations that reach it, how many of them keep 20 mm
    (or what the station allows), the best clearance, and the obstructing pairs where none does.
    """
    return [_access_row(visit, cell) for visit in visits(cell)]


def _access_row(visit: StationVisit, cell: Cell) -> Row:
    """How many configurations of a visit are free, the best clearance [m], or what obstructs."""
    station = visit.station
    scene = visit.scene
    threshold = scene.thresholds(DEFAULT_SAFETY_DISTANCE, station.name)
    found = free_configurations(station.pose, scene, threshold, cell.machine_home)
    none = (
        "" if len(found.q) else no_configuration(station.pose, scene, found, station.name).message
    )
    clearances = scene.collision.min_distance(found.q, threshold).distance if len(found.q) else ()
    return {
        "station": station.name,
        "load": scene.load_text,
        "reached": found.reached,
        "free": len(found.q),
        "clearance": float(max(clearances)) if len(found.q) else None,
        "obstacle": none,
    }


# The straight line out of a station, judged by distances.

HAND = 5  # links from here on, tool and part may touch what they work at
_SHARE = 0.5  # of the distance on the line: how near a contact may come
_GRID = 1e-4  # m, to which it is rounded down
_NOISE = 1e-6  # of it: processors give distances that differ in their last bits
_JUMP = 0.35  # rad between points of a line: more is another branch


@dataclass(frozen=True)
class Near:
    """A pair that is nearer than it may be: the distance [m] (negative: the depth), and how far out
    [m].
    """

    body_a: str
    body_b: str
    distance: float
    out: float

    @property
    def sentence(self) -> str:
        """As a table shows it."""
        where = f" after {1e3 * self.out:.0f} mm" if self.out > 0.0 else ""
        if self.distance <= 0.0:
            return f"{self.body_a} is {-1e3 * self.distance:.1f} mm inside {self.body_b}{where}"
        return f"{self.body_a} is {1e3 * self.distance:.1f} mm from {self.body_b}{where}"


@dataclass(frozen=True, eq=False)
class AccessLine:
    """The line out of a station in one configuration q (n,); reach [m]: how far it can be followed.

    near: pairs too near with what the station allows, the nearest first. mendable: contacts and a
    zone would make it free: these contacts, and a zone that holds the places (P, 3) [m] of the tcp
    in `within`.
    """

    q: FloatArray
    reach: float
    whole: bool
    near: tuple[Near, ...]
    mendable: bool
    contacts: tuple[AllowedContact, ...]
    within: FloatArray

    @property
    def free(self) -> bool:
        """Whether it can be driven as the cell is."""
        return self.whole and not self.near

    @property
    def sentence(self) -> str:
        """What is in the path."""
        if self.near:
            return self.near[0].sentence
        return "" if self.whole else f"the joint limits end it after {1e3 * self.reach:.0f} mm"


def lines_of(visit: StationVisit, approach: float) -> list[AccessLine]:
    """The line of every configuration that reaches the station, with an approach distance [m]."""
    station = replace(visit.station, approach_distance=approach)
    scene = visit.scene
    poses = line_poses(station)
    solved = scene.inverse_kinematics.solve(poses[1:]) if len(poses) > 1 else None
    nexts = [] if solved is None else [solved.of_pose(k) for k in range(len(poses) - 1)]
    return [_judged(_followed(q, nexts), len(poses), station, scene) for q in reaching(visit)]


def _followed(q: FloatArray, nexts: Sequence[FloatArray]) -> FloatArray:
    points = [q]
    for candidates in nexts:
        if not len(candidates):
            break
        jump = np.abs(candidates - points[-1]).max(axis=1)
        if jump.min() > _JUMP:
            break
        points.append(candidates[int(np.argmin(jump))])
    return np.array(points)


def _judged(points: FloatArray, count: int, station: Station, scene: PlanningScene) -> AccessLine:
    """A line (L, n): contacts count where the tcp is in the zone, and never at the outer end.

    count: points of a whole line; one that has fewer ends where the arm doesn't follow any more.
    """
    distance = scene.collision.distances(points)
    tcp = scene.chain.tcp_poses(points)[:, :3, 3]
    out = np.linalg.norm(tcp - tcp[0], axis=1)
    whole = len(points) == count
    kept = scene.thresholds(DEFAULT_SAFETY_DISTANCE, station.name)
    outer_end = count - 1 if count > 1 else -1
    last = np.arange(len(points)) == outer_end
    in_zone = tcp_inside(points, scene, station.name, DEFAULT_SAFETY_DISTANCE)
    plain = last | ~in_zone
    violated = distance <= np.where(plain[:, None], DEFAULT_SAFETY_DISTANCE, kept)
    pairs = np.flatnonzero(violated.any(axis=0))
    found = []
    for z in pairs:
        rows = np.flatnonzero(violated[:, z])
        nearest = int(rows[np.argmin(distance[rows, z])])
        pair = scene.collision.pairs[z]
        found.append(
            Near(pair.body_a, pair.body_b, float(distance[nearest, z]), float(out[nearest]))
        )

    # contacts that a station may allow: of the hand, without penetration, not at the outer end
    least = distance.min(axis=0, initial=np.inf)
    at_end = (distance[last] <= DEFAULT_SAFETY_DISTANCE).any(axis=0)
    mendable = whole
    contacts = []
    for z in pairs:
        touches = least[z] > 0.0 and not at_end[z]
        mendable = mendable and bool(touches and _is_of_the_hand(int(z), scene))
        if least[z] <= kept[z]:
            contacts.append(_contact(int(z), float(least[z]), scene))
    near_any = (distance <= DEFAULT_SAFETY_DISTANCE).any(axis=1)
    return AccessLine(
        q=points[0],
        reach=float(out[-1]),
        whole=whole,
        near=tuple(sorted(found, key=lambda each: each.distance)),
        mendable=mendable,
        contacts=tuple(contacts),
        within=tcp[near_any & ~last],
    )


def _is_of_the_hand(z: int, scene: PlanningScene) -> bool:
    """Whether a pair is one of the hand, or of what it holds, with a body."""
    capsules = (*scene.cell.robot.capsules, *(c for load in scene.loads for c in load.capsules))
    hand = {capsule.name for capsule in capsules if capsule.link >= HAND + scene.cell.robot.base}
    pair = scene.collision.pairs[z]
    return pair.kind != "SELF" and pair.body_a in hand


def _contact(z: int, distance: float, scene: PlanningScene) -> AllowedContact:
    """What allows a pair to come to a distance [m]."""
    pair = scene.collision.pairs[z]
    least = float(np.floor(_SHARE * distance / _GRID + _NOISE) * _GRID)
    return AllowedContact(pair.body_a, pair.body_b, round(max(least, 0.0), 6))


CONFIGURATIONS: Columns = {
    "station": ("station", text),
    "held": ("held", text),
    "lying": ("lying", text),
    "joints_deg": ("configuration deg", text),
    "clearance": ("clearance mm", number(1, 1e3)),
    "at_station": ("at the station", text),
    "line_out": ("line in and out", text),
}


def configurations_of(cell: Cell) -> list[Row]:
    """One row for each configuration in each situation; one that says so where none reaches the
    station.
    """
    return [row for visit in visits(cell) for row in _rows(visit)]


def _rows(visit: StationVisit) -> Iterator[Row]:
    distance = visit.station.approach_distance
    there = lines_of(visit, 0.0)
    out = lines_of(visit, distance)
    situation = {"station": visit.station.name, "held": visit.scene.load_text, "lying": visit.lying}
    if not there:
        yield situation | {
            "joints_deg": "",
            "clearance": None,
            "at_station": "not reached",
            "line_out": "",
        }
    for here, line in zip(there, out, strict=True):
        nearest = visit.scene.collision.min_distance(here.q[None]).distance[0]
        yield situation | {
            "joints_deg": " ".join(f"{round(angle):d}" for angle in np.degrees(here.q)),
            "clearance": float(nearest),
            "at_station": here.sentence or "free",
            "line_out": _said(line) if distance > 0.0 else "no approach_distance",
        }


def _said(line: AccessLine) -> str:
    return line.sentence or f"free, {1e3 * line.reach:.0f} mm"
