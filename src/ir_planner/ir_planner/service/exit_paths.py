"""Exit paths from an interaction configuration to outside a machine's zone: eq. (7) first, trees
where it finds none.

What comes out is shortened: shortcuts, waypoints pulled straight, and the end retracted to where
the zone has just been left; all of it over certified edges.
"""

from collections import ChainMap, Counter
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np

from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.request import Journal, Work
from ir_planner.scene import path_cost
from ir_planner.search import EXIT, connect, fewest_corners, first_different
from ir_planner.service.exit import Exit, ExitSearch, ExitsFound
from ir_planner.service.stochastic_withdrawal import ModifiedGa
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError
from ir_values.extensions import Registry
from ir_values.settings import check_settings, describe, setting

# Exit paths by two trees: one grows from the interaction configuration, the other from
# configurations outside.


@dataclass(frozen=True)
class ExitTree:
    """Bidirectional trees to configurations outside the zone: finds narrow exits, given work."""

    drawn: int = setting(512, "Random configurations drawn outside.", minimum=1, maximum=100_000)
    goals: int = setting(
        8, "How many of those outside, the nearest, the trees aim at.", minimum=1, maximum=1000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def title(self) -> str:
        """The name of its stage in answers."""
        return "tree"

    def find(
        self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work
    ) -> ExitsFound:
        """Grow until the trees meet: one path, or none when the work ended before."""
        rng = np.random.default_rng(seed.spawn(1)[0])
        goals = self._outside(problem, rng)
        path = None
        if len(goals):
            path = connect(
                problem.interaction, goals, problem.inside, int(rng.integers(2**63))
            ).path
        if path is None:
            return ExitsFound([], problem.interaction, "no path")
        return ExitsFound([_until_out(path, problem)], path[-1], f"{len(path)} points")

    def _outside(self, problem: Exit, rng: np.random.Generator) -> FloatArray:
        """Free configurations (G, n) outside: park and machine home where they are, and the nearest
        of those drawn.
        """
        cell = problem.inside.scene.cell
        space = problem.inside
        postures = np.array([cell.park, cell.machine_home])
        drawn = rng.uniform(space.low, space.high, (self.drawn, len(postures[0])))
        drawn = drawn[problem.is_out(drawn)]
        away = np.linalg.norm((drawn - problem.interaction) * space.scale, axis=1)
        nearest = drawn[np.argsort(away, kind="stable")[: self.goals]]
        return np.concatenate([postures[problem.is_out(postures)], nearest])


def _until_out(path: FloatArray, problem: Exit) -> FloatArray:
    """The path up to the first of its points that is outside."""
    last = int(np.argmax(problem.is_out(path[1:]))) + 1
    return path[: last + 1]


@dataclass(frozen=True)
class UnusableWithdrawal:
    """Stands in for a search whose package can't be used: it refuses with the reason."""

    why: str = setting("", "Why the installed package can't be used.", read_only=True)
    title: ClassVar[str] = "unusable"

    def find(
        self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work
    ) -> ExitsFound:
        """Raises RequestError."""
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, f"planner_id: {self.why}")


def made_exit_search(name: str, value: Any) -> ExitSearch:
    """The search of an entry point: a frozen dataclass, or a search with other settings. Raises
    InvalidValueError.
    """
    search = value() if isinstance(value, type) else value
    if not (is_dataclass(search) and callable(getattr(search, "find", None))):
        raise InvalidValueError("must be a frozen dataclass with a method find")
    if not isinstance(getattr(search, "title", None), str):
        raise InvalidValueError("has no title: the name of its stage in answers")
    describe(type(search))
    return cast(ExitSearch, search)


EXIT_SEARCHES: Registry[ExitSearch] = Registry(
    "ir_planner.exit_searches",
    {"modified_ga": ModifiedGa(), "tree": ExitTree()},
    made_exit_search,
    stand_in=UnusableWithdrawal,
)
# raw paths per candidate that is wanted: shortened, some of them end at the same place
_SEARCHED = 2
_STREAM = 7  # of the request's seed, so that other stages draw other numbers
_END_SAMPLES = 24  # of the last step, where the zone is left: about a centimetre apart
# points of a path between which shortcuts are tried: their number grows with the square
_CORNERS = 11


@dataclass(frozen=True, eq=False)
class ExitPath:
    """A free path (M, n) from the interaction configuration to outside the zone, the method that
    found it, and all that the method did.
    """

    method: str
    points: FloatArray
    search: ExitsFound


@dataclass(frozen=True, eq=False)
class Withdrawal:
    """What was found; for a failure the configuration farthest out, and how many candidates each
    pair of bodies obstructed.

    zone_distance [m] of `farthest`: negative inside.
    """

    paths: list[ExitPath]
    farthest: FloatArray
    zone_distance: float
    obstructed: Counter[str]


def exit_searches(modified_ga: ModifiedGa) -> Mapping[str, ExitSearch]:
    """The registered searches, the modified GA with these settings."""
    return ChainMap({"modified_ga": modified_ga}, EXIT_SEARCHES)


def withdrawal(
    problem: Exit, wanted: int, method: str, searches: Mapping[str, ExitSearch], journal: Journal
) -> Withdrawal:
    """Up to `wanted` different shortened exit paths, cheapest by W first.

    method: a key of `searches`, or "": those of the project in turn until one finds any.
    """
    seed = np.random.SeedSequence([journal.seed % 2**63, _STREAM])
    farthest = problem.interaction
    obstructed = Counter[str]()
    depth = float(problem.area.zone_distance(farthest[None])[0])
    paths: list[ExitPath] = []
    default = [name for name in searches if not EXIT_SEARCHES.origin(name)]
    for name in [method] if method else default:
        search = searches[name]
        with journal.stage(search.title) as notes:
            notes.extend(filter(None, [EXIT_SEARCHES.origin(name)]))
            found = search.find(problem, _SEARCHED * wanted, seed, journal.work)
            notes.append(found.note)
        journal.rejected.update(+found.rejected)
        obstructed.update(found.obstructed)
        distance = float(problem.area.zone_distance(found.farthest[None])[0])
        if distance > depth:
            farthest = found.farthest
            depth = distance
        paths = [ExitPath(name, path, found) for path in found.paths]
        if paths:
            break
    if paths:
        with journal.stage("shorten") as notes:
            paths = _cheapest(paths, problem, wanted)
            notes.append(f"{len(paths)} different paths")
    return Withdrawal(paths, farthest, depth, obstructed)


def _cheapest(paths: list[ExitPath], problem: Exit, wanted: int) -> list[ExitPath]:
    """The paths shortened, cheapest by W first, those that end at the same place once."""
    space = problem.inside
    weights = problem.inside.scene.weights

    def cost(path: ExitPath) -> float:
        return path_cost(weights, path.points)

    shortened = []
    for path in sorted(paths, key=cost)[: _SEARCHED * wanted]:
        points = _end_retracted(fewest_corners(path.points, space, weights, _CORNERS), problem)
        shortened.append(replace(path, points=points) if problem.contacts_end(points) else path)
    return first_different(sorted(shortened, key=cost), wanted, EXIT, lambda path: path.points[-1])


def _end_retracted(path: FloatArray, problem: Exit) -> FloatArray:
    """The path, its last step cut where the zone has just been left for good."""
    share = np.linspace(0.0, 1.0, _END_SAMPLES + 1)[1:, None]
    along = path[-2] + share * (path[-1] - path[-2])
    out = problem.is_out(along)
    still = np.flatnonzero(~out)
    first = int(still[-1]) + 1 if len(still) else 0
    return np.concatenate([path[:-1], along[first : first + 1]])


def known_method(method: str) -> str:
    """The method of a request; an unknown one lists the known. Raises RequestError for that."""
    if method not in ("", *EXIT_SEARCHES):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"planner_id {method[:60]!a} is unknown for service movements: "
            f'known are "", {", ".join(EXIT_SEARCHES)}',
        )
    return method
