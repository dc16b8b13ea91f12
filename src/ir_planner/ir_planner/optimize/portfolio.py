"""Ways round, found by several searches side by side, each gone down to the cheapest movement near it.

A way is a free path of straight steps. Each new one is shortened and drafted: a short descent on a coarse
spline tells what it may come to, and ways that have come to the same place count once. The cheapest drafts
are finished, which is where the clearance is proved; the best finished movement is the answer, and more work
makes it better.
"""

from dataclasses import dataclass

import numpy as np
from ir_msgs_py.arrays import FloatArray

from ir_planner.checks import FreeSpace, evaluate_trajectory
from ir_planner.curves import at_shares
from ir_planner.errors import TimingError
from ir_planner.optimize.refinement import QUICK, THOROUGH, Draft, Effort, Refined, Refinement
from ir_planner.request import Journal
from ir_planner.search import fewest_corners
from ir_planner.timing import TimedMovement, objective_value, timed_movement

_SAME = 0.12  # rad: drafts that are nearer to each other along their way are one way round
_PLACES = np.linspace(0.1, 0.9, 9)
_HOPELESS = 1.25  # drafts that cost this much more than the best are not finished


@dataclass(eq=False)
class Candidate:
    """A way (M, n) found by `method`, its draft, and how often it was finished."""

    method: str
    path: FloatArray
    draft: Draft
    finished: int = 0


class Portfolio:
    """The ways of one request, and the movements that came of them: the best first."""

    def __init__(self, space: FreeSpace, refinement: Refinement, journal: Journal) -> None:
        self.space, self.refinement, self.journal = space, refinement, journal
        self.candidates: list[Candidate] = []
        self.found: list[tuple[str, Refined]] = []

    def add(self, method: str, ways: list[FloatArray]) -> int:
        """Draft ways (M, n), M >= 2; the number of them that are new."""
        new = 0
        weights = self.space.scene.weights
        for way in ways:
            path = fewest_corners(way, self.space, weights) if len(way) > 2 else way
            candidate = Candidate(method, path, self.refinement.drafted(path))
            same = [other for other in self.candidates if _alike(other.draft, candidate.draft)]
            if all(candidate.draft.cost < 0.99 * other.draft.cost for other in same):
                self.candidates = [other for other in self.candidates if other not in same or other.finished]
                self.candidates.append(candidate)
                new += 1
        self.candidates.sort(key=lambda candidate: candidate.draft.cost)
        return new

    def finish_best(self, count: int, effort: Effort = QUICK) -> int:
        """Finish up to `count` of the cheapest drafts that were not; the number of certified movements."""
        done = 0
        wanted = [c for c in self.candidates if c.finished == 0]
        for candidate in wanted[:count]:
            if self.found and candidate.draft.cost > _HOPELESS * self.candidates[0].draft.cost:
                break
            done += self._finish(candidate, effort)
        return done

    def deepen(self) -> bool:
        """Go on with the way of the best movement, thoroughly; False where that was done."""
        for candidate in self.candidates:
            if candidate.finished == 1:
                candidate.draft = self.refinement.drafted(candidate.path, THOROUGH.coarse)
                self._finish(candidate, THOROUGH)
                return True
        return False

    def _finish(self, candidate: Candidate, effort: Effort) -> bool:
        candidate.finished += 1
        movement = self.refinement.finished(candidate.draft, candidate.path, effort)
        if movement is None:
            self.journal.reject("not certified after refinement")
            return False
        self.found.append((candidate.method, movement))
        self.found.sort(key=lambda entry: entry[1].value)
        return True

    def best(self) -> tuple[str, TimedMovement] | None:
        """The best movement with its method, verified as it is sent and measured."""
        scene, options = self.space.scene, self.refinement.options
        for method, refined in self.found:
            evaluation = evaluate_trajectory(refined.trajectory, scene, options.safety_distance)
            movement = TimedMovement(refined.path, refined.trajectory, evaluation)
            if movement.violation is None:
                return method, movement
            self.journal.reject(f"not proved: {movement.violation.what}")
        return None

    def timed_by_laws(self, ways: list[tuple[str, FloatArray]]) -> tuple[str, TimedMovement] | None:
        """Straight steps with blended corners: for asynchronous joints, and where no descent was
        certified.
        """
        scene, options = self.space.scene, self.refinement.options
        best: tuple[str, TimedMovement] | None = None
        for method, path in ways:
            try:
                movement = timed_movement(path, scene, options, self.journal.work)
            except TimingError as error:
                self.journal.reject(f"torque: {error}")
                continue
            if movement.violation is not None:
                self.journal.reject(f"not proved: {movement.violation.what}")
            elif best is None or self._value(movement) < self._value(best[1]):
                best = method, movement
        return best

    def _value(self, movement: TimedMovement) -> float:
        options = self.refinement.options
        return objective_value(movement.evaluation.report, options.objective, options.time_value)


def _alike(a: Draft, b: Draft) -> bool:
    return bool(np.abs(_places(a) - _places(b)).max() < _SAME)


def _places(draft: Draft) -> FloatArray:
    """Configurations (9, n) along a draft, at even shares of its length."""
    return at_shares(draft.spline.control, _PLACES)
