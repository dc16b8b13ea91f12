"""OMPL's planners as searches: each is a class of settings, all are asked through one process."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ir_msgs_py.status import StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.search.port import Ends, Found
from ir_planner.search.tree import connect
from ir_planner.search.variety import NEAREST_GOALS
from ir_planner.search.with_ompl.host import OmplParameters, OmplProblem, asked, check_installed
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

# of the work that is left goes into OMPL's checks: its path is certified, and improved
_SHARE = 0.75
_REPAIR = 4000  # edges of a tree around a blocked step


def found_by(
    name: str,
    parameters: OmplParameters,
    edges: int,
    ends: Ends,
    space: FreeSpace,
    seed: int,
) -> Found:
    """What OMPL's planner finds with `edges` checks at most; every step of its path is certified
    here: some of them smooth their paths without asking.

    Raises RequestError where OMPL isn't installed or can't be loaded, CancelledError when asked to
    stop.
    """
    check_installed(name)
    work = space.work
    checks = min(edges, int(_SHARE * work.left))
    if checks == 0 or work.exhausted:
        return Found([], "no work was left")
    goals = ends.goals[:NEAREST_GOALS]
    seconds = work.deadline - work.clock()
    problem = OmplProblem(
        space.scene, space.threshold, ends.start, goals, parameters, seed, checks, seconds
    )
    outcome = asked(problem, work)
    if outcome.unusable:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"planner_id {name!r}: OMPL is installed but can't be loaded: {outcome.error}",
        )
    if outcome.path is None:
        return Found([], outcome.error or f"OMPL found no path in {outcome.edges} checks")
    path = repaired(_path_with_ends(outcome.path, ends), space, seed)
    if path is None:
        return Found([], "OMPL's path is blocked and could not be repaired")
    return Found([path])


def _path_with_ends(path: FloatArray, ends: Ends) -> FloatArray:
    """The path (M, n) with the ends that were asked for, bit by bit, and without steps that don't
    move.
    """
    path = path.copy()
    path[0] = ends.start
    path[-1] = ends.goals[np.abs(ends.goals - path[-1]).max(axis=1).argmin()]
    moves = np.abs(np.diff(path, axis=0)).max(axis=1) > 0.0
    return np.asarray(path[np.concatenate([[True], moves])])


def repaired(path: FloatArray, space: FreeSpace, seed: int) -> FloatArray | None:
    """The path (M, n) with small trees in place of its steps that are not certified free; None
    where a tree finds nothing. Configurations that are not free are left out first.
    """
    ends_too = space.states_free(path)
    ends_too[[0, -1]] = True
    path = path[ends_too]
    free = space.edges_free(path[:-1].copy(), path[1:].copy())
    pieces = [path[:1]]
    for k, step_is_free in enumerate(free):
        if step_is_free:
            pieces.append(path[k + 1 : k + 2])
            continue
        detour = connect(path[k], path[None, k + 1], space, seed, _REPAIR).path
        if detour is None:
            return None
        pieces.append(detour[1:])
    return np.concatenate(pieces)


@dataclass(frozen=True)
class OmplSearch:
    """planner_id: name of the search; planner: OMPL's class of it; reverse: it gets the goals as
    starts.
    """

    planner_id: ClassVar[str]
    planner: ClassVar[str]
    reverse: ClassVar[bool] = False

    edges: int = setting(
        100_000_000,
        "Checks in certified edges before it is given up.",
        minimum=1,
        maximum=100_000_000,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {}

    def cells(self) -> float:
        """Size [rad] of the cells of a grid over the first joints; 0: OMPL's own."""
        return 0.0

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """One path, or none."""
        parameters = OmplParameters(self.planner, self.parameters(), self.cells(), self.reverse)
        return found_by(self.planner_id, parameters, self.edges, ends, space, seed)


@dataclass(frozen=True)
class OverCells(OmplSearch):
    """Trees that grow where a grid over the first three joints is least explored."""

    range: float = setting(
        0.5, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    border_fraction: float = setting(
        0.9, "Share of the motions that start in cells at the border.", minimum=0.01, maximum=1.0
    )
    cell: float = setting(
        0.3,
        "Size of the cells over the first three joints; 0: OMPL's own projection.",
        unit="rad",
        minimum=0.0,
        maximum=10.0,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range, "BorderFraction": self.border_fraction}

    def cells(self) -> float:
        """Size [rad] of the cells."""
        return self.cell


# Sucan and Kavraki, "Kinodynamic motion planning by interior-exterior cell exploration", 2008.


@dataclass(frozen=True)
class Kpiece(OverCells):
    """One tree that grows where a grid over the first joints is least explored (KPIECE)."""

    planner_id: ClassVar[str] = "kpiece"
    planner: ClassVar[str] = "KPIECE1"

    goal_bias: float = setting(
        0.05, "Share of the motions that aim at a goal.", minimum=0.0, maximum=1.0
    )
    failed_score: float = setting(
        0.5,
        "What the score of a cell is multiplied by where a motion failed.",
        minimum=0.01,
        maximum=1.0,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {
            **super().parameters(),
            "GoalBias": self.goal_bias,
            "FailedExpansionCellScoreFactor": self.failed_score,
        }


# OMPL's bidirectional variant of KPIECE.


@dataclass(frozen=True)
class Bkpiece(OverCells):
    """Two trees of KPIECE, from the start and from the goals (BKPIECE)."""

    planner_id: ClassVar[str] = "bkpiece"
    planner: ClassVar[str] = "BKPIECE1"

    failed_score: float = setting(
        0.5,
        "What the score of a cell is multiplied by where a motion failed.",
        minimum=0.01,
        maximum=1.0,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {**super().parameters(), "FailedExpansionCellScoreFactor": self.failed_score}


# OMPL's BKPIECE with the lazy checks of SBL.


@dataclass(frozen=True)
class Lbkpiece(OverCells):
    """Two trees of KPIECE whose motions are checked when they join both (LBKPIECE)."""

    planner_id: ClassVar[str] = "lbkpiece"
    planner: ClassVar[str] = "LBKPIECE1"


# Kavraki et al., "Probabilistic roadmaps for path planning in high-dimensional configuration
# spaces", 1996.
#
# OMPL's planner grows and enlarges its roadmap by turns of so many milliseconds, and looks for a
# solution in a thread beside that: the same seed may give another path. That thread also adds all
# goals but the first. Each needs Python for its checks, and then both wait for each other for ever;
# so the goals are its starts, and the start its one goal.


@dataclass(frozen=True)
class Prm(OmplSearch):
    """A roadmap of random configurations and their neighbours (PRM); its bytes may differ from run
    to run.
    """

    planner_id: ClassVar[str] = "prm"
    planner: ClassVar[str] = "PRM"
    repeatable: ClassVar[bool] = False
    reverse: ClassVar[bool] = True

    neighbours: int = setting(
        10, "Configurations that a new one is connected to.", minimum=1, maximum=1000
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"MaxNearestNeighbors": self.neighbours}


# LaValle and Kuffner, "Randomized kinodynamic planning", 2001.


@dataclass(frozen=True)
class Rrt(OmplSearch):
    """One tree that grows towards random configurations (RRT)."""

    planner_id: ClassVar[str] = "rrt"
    planner: ClassVar[str] = "RRT"

    range: float = setting(
        2.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    goal_bias: float = setting(
        0.05, "Share of the motions that aim at a goal.", minimum=0.0, maximum=1.0
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range, "GoalBias": self.goal_bias}


# Kuffner and LaValle, "RRT-Connect: an efficient approach to single-query path planning", 2000.


@dataclass(frozen=True)
class RrtConnect(OmplSearch):
    """Two trees that grow towards random configurations and each other (RRT-Connect)."""

    planner_id: ClassVar[str] = "rrt_connect"
    planner: ClassVar[str] = "RRTConnect"

    range: float = setting(
        1.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range}


# Wilson et al., "AORRTC: almost-surely asymptotically optimal planning with RRT-Connect", 2025.


@dataclass(frozen=True)
class Aorrtc(OmplSearch):
    """RRT-Connect again and again for paths that must be shorter (AORRTC)."""

    planner_id: ClassVar[str] = "aorrtc"
    planner: ClassVar[str] = "AORRTC"

    range: float = setting(
        1.0, "Longest motion that is added at once.", unit="rad", minimum=0.01, maximum=50.0
    )
    edges: int = setting(
        5_000,
        "Checks in certified edges that it goes on for: it never ends before.",
        minimum=1,
        maximum=100_000_000,
    )

    def parameters(self) -> dict[str, float]:
        """OMPL's parameters by the names of their set... methods."""
        return {"Range": self.range}
