"""Ways from a work configuration to outside a machine's zone: eq. (7) first, trees where it finds none.

What comes out is shortened: shortcuts, waypoints pulled straight, and the end drawn back to where the zone
has just been left; all of it over certified edges.
"""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import StatusCode
from numpy.typing import NDArray

from ir_description import Station
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.request import Journal, Work
from ir_planner.scene import PlanningScene, path_cost, tcp_inside
from ir_planner.search import connect, fewest_corners, joint_scale
from ir_planner.service.settings import WithdrawalSettings
from ir_planner.service.withdrawal import Walk, withdraw
from ir_planner.service.work_area import WorkArea

MODIFIED_GA, TREE = "modified_ga", "tree"
METHODS = (MODIFIED_GA, TREE)
_SEARCHED = 2  # raw ways per candidate that is wanted
_DIFFERENT = 0.1  # rad: ways that end nearer to each other are one
_END_SAMPLES = 24
_CORNERS = 11  # points of a way between which shortcuts are tried
_OUTSIDE_TRIES, _OUTSIDE_GOALS = 512, 8  # configurations drawn, and how many of those outside trees aim at
_EDGE_SAMPLES = 12


@dataclass(frozen=True, eq=False)
class Way:
    """A free path (M, n) from the work configuration to outside the zone, and the method that found it."""

    method: str
    points: FloatArray


@dataclass(eq=False)
class Ways:
    """What was found; for a failure the configuration farthest out, and what was met on the way.

    zone_distance [m] of `farthest`: negative inside.
    """

    ways: list[Way]
    farthest: FloatArray
    zone_distance: float
    met: Counter[str]


@dataclass(frozen=True, eq=False)
class Exit:
    """One search problem: from `work` (n,) out of the area; free space inside (with allowed contacts) and
    outside (without), S_m.
    """

    interaction: FloatArray
    area: WorkArea
    inside: FreeSpace
    outside: FreeSpace
    safety_distance: float

    @staticmethod
    def of(
        interaction: FloatArray, scene: PlanningScene, station: Station, safety_distance: float, work: Work
    ) -> "Exit":
        """The problem of leaving a station from `work` (n,)."""
        return Exit(
            interaction,
            WorkArea.of(scene, station),
            FreeSpace.of(scene, safety_distance, work, station.name),
            FreeSpace.of(scene, safety_distance, work),
            safety_distance,
        )

    @cached_property
    def least_way(self) -> float:
        """How far [m] the tcp must go: by the approach distance where the work configuration is outside the
        zone already, as above a pallet; else leaving the zone is what counts.
        """
        outside = self.area.left(self.interaction[None], self.safety_distance)[0]
        return float(self.area.station.approach_distance) if outside else 0.0

    def is_out(self, q: FloatArray) -> NDArray[np.bool_]:
        """Which configurations (N, n) have left the zone and are free without allowed contacts."""
        out = self.area.left(q, self.safety_distance)
        if self.least_way > 0.0:
            chain = self.inside.scene.chain
            way = chain.tcp_poses(q)[:, :3, 3] - chain.tcp_poses(self.interaction[None])[:, :3, 3]
            out &= np.linalg.norm(way, axis=1) >= self.least_way
        out[out] = self.outside.states_free(q[out])
        return out

    def contacts_end(self, path: FloatArray) -> bool:
        """Whether a path (M, n) keeps S_m where its tcp is outside the zone: allowed contacts end there.

        Asked at samples, so that what the proof of the movement would refuse is seldom timed.
        """
        scene, station = self.inside.scene, self.area.station.name
        if not scene.allowed(station).any():
            return True
        share = np.linspace(0.0, 1.0, _EDGE_SAMPLES)[:, None, None]
        q = (path[:-1] + share * np.diff(path, axis=0)).reshape(-1, path.shape[1])
        beyond = ~tcp_inside(q, scene, station, self.safety_distance)
        return bool(self.outside.states_free(q[beyond]).all())


def ways_out(
    problem: Exit,
    settings: WithdrawalSettings,
    wanted: int,
    method: str,
    journal: Journal,
) -> Ways:
    """Up to `wanted` different shortened ways, cheapest by W first.

    method: one of METHODS, or "": the tree only where eq. (7) finds none.
    """
    interaction = problem.interaction
    seed = np.random.SeedSequence([journal.seed % 2**63, 7])
    depth = float(problem.area.zone_distance(interaction[None])[0])
    found = Ways([], interaction, depth, Counter())
    if method in ("", MODIFIED_GA):
        with journal.stage("modified GA") as notes:
            walk = withdraw(
                interaction,
                problem.area,
                problem.inside,
                problem.is_out,
                settings,
                np.random.default_rng(seed),
                _SEARCHED * wanted,
            )
            notes.append(_told(walk))
        found.farthest, found.met = walk.best, walk.rejected
        found.zone_distance = float(problem.area.zone_distance(walk.best[None])[0])
        journal.rejected.update(+walk.rejected)
        found.ways = [Way(MODIFIED_GA, path) for path in walk.paths]
    if not found.ways and method in ("", TREE):
        with journal.stage("tree") as notes:
            path = tree_out(problem, np.random.default_rng(seed.spawn(1)[0]))
            notes.append("no way" if path is None else f"{len(path)} points")
        found.ways = [] if path is None else [Way(TREE, path)]
    if found.ways:
        with journal.stage("shorten") as notes:
            found.ways = _cheapest(found.ways, problem, wanted)
            notes.append(f"{len(found.ways)} different ways")
    return found


def _told(walk: Walk) -> str:
    return f"{len(walk.paths)} ways, {walk.generations} generations, {walk.candidates} candidates"


def tree_out(problem: Exit, rng: np.random.Generator) -> FloatArray | None:
    """A way by two trees, from the work configuration and from outside; None when the budget ended before."""
    goals = _outside(problem, rng)
    if len(goals) == 0:
        return None
    path = connect(problem.interaction, goals, problem.inside, int(rng.integers(2**63))).path
    return None if path is None else _until_out(path, problem)


def _outside(problem: Exit, rng: np.random.Generator) -> FloatArray:
    """Free configurations (G, n) outside: park and machine home where they are, and the nearest of those
    drawn.
    """
    cell, space = problem.inside.scene.cell, problem.inside
    postures = np.array([cell.park, cell.machine_home])
    drawn = rng.uniform(space.low, space.high, (_OUTSIDE_TRIES, len(postures[0])))
    drawn = drawn[problem.is_out(drawn)]
    away = np.linalg.norm((drawn - problem.interaction) * joint_scale(space), axis=1)
    nearest = drawn[np.argsort(away, kind="stable")[:_OUTSIDE_GOALS]]
    return np.concatenate([postures[problem.is_out(postures)], nearest])


def _until_out(path: FloatArray, problem: Exit) -> FloatArray:
    """The path up to the first of its points that is outside."""
    last = int(np.argmax(problem.is_out(path[1:]))) + 1
    return path[: last + 1]


def _cheapest(ways: list[Way], problem: Exit, wanted: int) -> list[Way]:
    """The ways shortened, cheapest by W first, those that end at the same place once."""
    space, weights = problem.inside, problem.inside.scene.weights

    def cost(way: Way) -> float:
        return path_cost(weights, way.points)

    shortened = []
    for way in sorted(ways, key=cost)[: _SEARCHED * wanted]:
        path = _end_drawn_back(fewest_corners(way.points, space, weights, _CORNERS), problem)
        shortened.append(Way(way.method, path if problem.contacts_end(path) else way.points))
    chosen: list[Way] = []
    for way in sorted(shortened, key=cost):
        if len(chosen) < wanted and all(_apart(way.points, other.points) for other in chosen):
            chosen.append(way)
    return chosen


def _apart(a: FloatArray, b: FloatArray) -> bool:
    """Whether two ways from the same place end apart."""
    return bool(np.abs(a[-1] - b[-1]).max() > _DIFFERENT)


def _end_drawn_back(path: FloatArray, problem: Exit) -> FloatArray:
    """The path, its last step cut where the zone has just been left for good."""
    share = np.linspace(0.0, 1.0, _END_SAMPLES + 1)[1:, None]
    along = path[-2] + share * (path[-1] - path[-2])
    out = problem.is_out(along)
    still = np.flatnonzero(~out)
    first = int(still[-1]) + 1 if len(still) else 0
    return np.concatenate([path[:-1], along[first : first + 1]])


def known_method(method: str) -> str:
    """The method of a request; an unknown one lists the known."""
    if method not in ("", *METHODS):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"planner_id {method[:60]!a} is unknown for service movements: "
            f'known are "", {", ".join(METHODS)}',
        )
    return method
