"""Paths of several homotopy classes, found by several searches, each optimised to the cheapest
movement near it.

Each new free path is shortened and gets a coarse solution: a short descent on a coarse spline
estimates what it may come to, and paths whose coarse solutions are alike count once. Guesses, which
need not be free, descend too: a few evaluations show which of them are worth as many as a free path
gets. The cheapest coarse solutions are refined, which is where the clearance is proved; the best
refined movement is the answer, and more work makes it better.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ir_kernels.spline import SplineStarts
from ir_planner.checks import FreeSpace
from ir_planner.curves import UniformSpline, along_path
from ir_planner.errors import TimingError
from ir_planner.optimize.refinement import (
    EDGES_PER_INTERVAL,
    EXACT,
    FEWEST,
    MOST,
    QUICK,
    SHARE_OF_WORK,
    SLOWER,
    SPACING,
    THOROUGH,
    Effort,
    Refinement,
    Solution,
)
from ir_planner.search import COARSE, apart, fewest_corners, first_different
from ir_planner.timing import Movement, straight_steps
from ir_values.arrays import FloatArray

# Estimates, in a few per cent of the work of the certified answer: a first look at all paths says
# which is the cheapest, and that one descends further on a spline with twice the knots. Their cost
# includes penalties; nothing is proved.

FIRST_LOOK = 12  # evaluations from every path
ALONE = 30  # from a path that has no rivals
_FURTHER = replace(THOROUGH.stages[1], evaluations=140)


def first_looks(
    paths: list[FloatArray], refinement: Refinement, evaluations: int
) -> list[Solution]:
    """Coarse solutions near paths (M, n), which need not be free; in one call where all have one
    cost.
    """
    work = refinement.context.work
    options = refinement.context.options
    most = len(paths) * evaluations * MOST * EDGES_PER_INTERVAL
    begin = refinement.begun(along_path(paths[0], FEWEST, 1.0), evaluations) if paths else None
    alike = begin is not None and len(begin.kept) == 1 and options.objective != "movement_cost"
    alike = alike and refinement.context.motion is None
    if begin is None or not alike or most > SHARE_OF_WORK * work.left:
        return [refinement.coarse(path, evaluations) for path in paths]
    work.check()
    found = refinement.cost(begin, paths[0]).descend_along(
        paths,
        SplineStarts(SPACING, SLOWER, FEWEST, MOST, options.duration),
        evaluations=evaluations,
        tolerance=begin.stage.tolerance,
    )
    splines = [UniformSpline(each.control, each.interval) for each in found]
    for each, spline in zip(found, splines, strict=True):
        work.spend(int(np.ceil(each.evaluations * spline.intervals * EDGES_PER_INTERVAL)))
    return [begin.ended(spline, each.value) for spline, each in zip(splines, found, strict=True)]


def estimate(paths: list[FloatArray], refinement: Refinement) -> Solution:
    """The coarse solution that is cheapest, from paths (M, n), at least one, which need not be
    free.
    """
    looks = first_looks(paths, refinement, FIRST_LOOK if len(paths) > 1 else ALONE)
    k = min(range(len(looks)), key=lambda k: looks[k].cost)
    return refinement.staged(looks[k], _FURTHER, paths[k])


_BETTER = 0.99  # share of the cost below which an alike path replaces another
_FOLLOWED = 7  # guesses that are followed after the first look
_OUT_OF_REACH = 1.25  # times the cost of the best: coarse solutions above are not refined
Look = tuple[Solution, FloatArray]  # a coarse solution, and the guess (M, n) that it came from


class _Shares(NamedTuple):
    """Evaluations from every guess, then from those that are followed; how many of these get as
    many as a free path.
    """

    first: int
    following: int
    promising: int


# A guess that begins deep in a body shows late what it may come to. At a duration that is short or
# requested classes are nearer to each other, and where a best is known that a guess has to be near,
# one look decides.
_PATIENT = _Shares(24, 13, 2)
_BRIEF = _Shares(12, 25, 3)


@dataclass(eq=False)
class Candidate:
    """A path (M, n) found by `method`, its coarse solution, and how much it was refined: 1 quickly,
    2 thoroughly.
    """

    method: str
    path: FloatArray
    solution: Solution
    refined: int = 0


class Portfolio:
    """The paths of one request, and the movements that came of them: the best first."""

    def __init__(self, space: FreeSpace, refinement: Refinement) -> None:
        self.space = space
        self.refinement = refinement
        self.context = refinement.context
        self.journal = refinement.context.journal
        self.candidates: list[Candidate] = []
        self.found: list[tuple[str, Movement]] = []

    def add(self, method: str, paths: list[FloatArray]) -> int:
        """Optimise paths (M, n), M >= 2, coarsely; the number of them that are new."""
        new = 0
        weights = self.space.scene.weights
        for free in paths:
            path = fewest_corners(free, self.space, weights) if len(free) > 2 else free
            new += self._take(Candidate(method, path, self.refinement.coarse(path)))
        return new

    def offer(self, method: str, path: FloatArray, solution: Solution) -> bool:
        """Take a coarse solution near a path (M, n) from elsewhere; whether it is new."""
        return self._take(Candidate(method, path, solution))

    def _take(self, candidate: Candidate) -> bool:
        """Keep a candidate unless one that is alike costs no more."""
        alike = [
            other for other in self.candidates if _are_alike(other.solution, candidate.solution)
        ]
        if any(candidate.solution.cost >= _BETTER * other.solution.cost for other in alike):
            return False
        self.candidates = [c for c in self.candidates if c not in alike or c.refined]
        self.candidates.append(candidate)
        self.candidates.sort(key=lambda candidate: candidate.solution.cost)
        return True

    def descend(self, method: str, guesses: list[FloatArray], worth: float = np.inf) -> int:
        """Optimise guesses (M, n), which need not be free: all of them a little; then the cheapest
        that differ, if they cost less than `worth` times the best candidate; and the cheapest of
        these as far as free paths are. The number of them that are new.
        """
        most = worth * self.candidates[0].solution.cost if self.candidates else np.inf
        options = self.context.options
        hurried = np.isfinite(most) or options.duration > 0.0 or options.objective == "time"
        shares = _BRIEF if hurried else _PATIENT
        seen = zip(first_looks(guesses, self.refinement, shares.first), guesses, strict=True)
        looks = sorted(
            (look for look in seen if look[0].cost < most), key=lambda look: look[0].cost
        )
        followed = first_different(looks, _FOLLOWED, COARSE, lambda look: look[0].places)
        left = QUICK.coarse
        if len(followed) > shares.promising:
            followed = sorted(
                self._further(followed, shares.following), key=lambda look: look[0].cost
            )
            left -= shares.following
        followed[: shares.promising] = self._further(followed[: shares.promising], left)
        found = [
            Candidate(method, solution.spline.knots()[0], solution) for solution, _ in followed
        ]
        return sum(self._take(candidate) for candidate in found)

    def _further(self, looks: list[Look], evaluations: int) -> list[Look]:
        """The looks after one more descent each."""
        coarse = self.refinement.coarse_from
        return [(coarse(solution.spline, guess, evaluations), guess) for solution, guess in looks]

    def adopt(self, other: "Portfolio") -> int:
        """Optimise the candidates of another objective at the requested duration; how many are
        new.
        """
        duration = self.context.options.duration
        new = 0
        for candidate in other.candidates:
            start = candidate.solution.spline.lasting(duration)
            solution = self.refinement.coarse_from(start, candidate.path, QUICK.coarse)
            new += self._take(Candidate(candidate.method, candidate.path, solution))
        return new

    def refine_best(self, count: int, effort: Effort = QUICK) -> int:
        """Refine up to `count` of the cheapest coarse solutions that were not; how many were
        certified.
        """
        done = 0
        wanted = [c for c in self.candidates if c.refined == 0]
        for candidate in wanted[:count]:
            if (
                self.found
                and candidate.solution.cost > _OUT_OF_REACH * self.candidates[0].solution.cost
            ):
                break
            done += self._refine(candidate, effort)
        return done

    def refine_anew(self, method: str, path: FloatArray) -> bool:
        """Refine a path (M, n) thoroughly, though its coarse solution was like a cheaper one."""
        solution = self.refinement.coarse(path, THOROUGH.coarse)
        return self._refine(Candidate(method, path, solution), THOROUGH)

    def refine_exactly(self) -> bool:
        """Refine the path of the best movement as far as descents go."""
        method, best = self.found[0]
        solution = self.refinement.coarse(best.path, EXACT.coarse)
        return self._refine(Candidate(method, best.path, solution), EXACT)

    def deepen(self) -> bool:
        """Optimise the path of the best movement thoroughly; False where that was done."""
        for candidate in self.candidates:
            if candidate.refined == 1:
                spline = candidate.solution.spline
                candidate.solution = self.refinement.coarse_from(
                    spline, candidate.path, THOROUGH.coarse
                )
                self._refine(candidate, THOROUGH)
                return True
        return False

    def _refine(self, candidate: Candidate, effort: Effort) -> bool:
        candidate.refined += 1 if effort is QUICK else 2
        movement = self.refinement.refined(candidate.solution, candidate.path, effort)
        if movement is None:
            self.journal.reject("not certified after refinement")
            return False
        self.found.append((candidate.method, movement))
        if len(self.found) > 1:  # one alone is compared with nothing
            self.found.sort(key=lambda entry: entry[1].coarse_cost)
        return True

    def best(self) -> tuple[str, Movement] | None:
        """The best movement with its method, certified as it is sent."""
        for method, movement in self.found:
            violation = movement.prove().violation
            if violation is None:
                return method, movement
            self.journal.reject(f"not proved: {violation.what}")
        return None

    def in_straight_steps(self, paths: list[tuple[str, FloatArray]]) -> tuple[str, Movement] | None:
        """Straight steps (M, n) with blended corners: for asynchronous joints, and where no descent
        was certified.
        """
        best: tuple[str, Movement] | None = None
        for method, path in paths:
            try:
                movement = straight_steps(path, self.context)
            except TimingError as error:
                self.journal.reject(f"torque: {error}")
                self.journal.too_heavy += error.too_heavy
                continue
            violation = movement.prove().violation
            if violation is not None:
                self.journal.reject(f"not proved: {violation.what}")
            elif best is None or movement.cost < best[1].cost:
                best = method, movement
        return best


def _are_alike(a: Solution, b: Solution) -> bool:
    """Whether two coarse solutions pass the same configurations."""
    return apart(a.places, b.places) < COARSE
