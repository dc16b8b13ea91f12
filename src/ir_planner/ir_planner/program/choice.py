"""The chain that a request chose, its steps with given movements, and the wait that fills a
cycle.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from ir_msgs_py.report import PlannedMovement
from ir_planner.program.assembly import (
    Complete,
    MakePause,
    assembled,
    energies_only,
    in_full,
    legs_of,
)
from ir_planner.program.chain import parts_of
from ir_planner.program.charge import Charge
from ir_planner.program.ladder import Ladder
from ir_planner.program.movements import Failure, Movements
from ir_planner.program.pauses import AUTO, Pause, pause_by_itself, planned_pause
from ir_planner.program.reliance import Reliance
from ir_planner.program.request import ProgramRequest, Progress, StageError
from ir_planner.program.station_graph import Chain, Part
from ir_planner.timing import Movement

_NO_WAIT = 1e-3  # s: durations are whole nanoseconds, stretched by millionths
Steps = tuple[PlannedMovement, ...]
Found = Mapping[Part, Movement]


@dataclass(frozen=True, eq=False)
class Choice:
    """A chain of configurations for a request, and its movements at the values of a second."""

    request: ProgramRequest
    ladder: Ladder
    chain: Chain

    @cached_property
    def _reliance(self) -> Reliance:
        return Reliance(self.request.options.safety_distance)

    @property
    def movements(self) -> Movements:
        """The movements of the request's own objective."""
        return self.ladder.own

    @property
    def parts(self) -> list[Part]:
        """The parts of the chain that move, in order."""
        return [part for hop in parts_of(self.chain, self.movements) for part in hop]

    def along(self, chain: Chain) -> "Choice":
        """The same with another chain."""
        return replace(self, chain=chain)

    def found(self, progress: Progress) -> dict[Part, Movement]:
        """The movements of all parts. Raises StageError where one of them isn't found."""
        movements = self.movements
        result = dict[Part, Movement]()
        journal = movements.context.journal
        with journal.stage("movements") as notes:
            for hop, parts in enumerate(parts_of(self.chain, movements)):
                progress("movements", hop, len(movements.route), self.chain.cost)
                for part, found in zip(
                    parts, movements.plan(parts, self.ladder.improvement), strict=True
                ):
                    if isinstance(found, Failure):
                        raise StageError(found.status)
                    result[part] = found
            notes.append(f"{len(result)} movements")
        own_laws = any(movement.timing == "asynchronous" for movement in result.values())
        journal.timing = "asynchronous" if own_laws else "synchronous"
        return result

    def steps(self, found: Found, *, until: float = 0.0, by_itself: bool = False) -> Steps:
        """The steps of the program with these movements, and a wait at its end that lasts until
        `until` s.
        by_itself: pauses as the controller spends them when nobody asks for a mode.
        """
        return self._steps(found, until, self._pause(by_itself), in_full(self._reliance))

    def energies(self, found: Found, *, until: float = 0.0) -> Steps:
        """The same steps with what they last and cost alone, in a fraction of the time: to
        compare.
        """
        return self._steps(found, until, self._pause(by_itself=False), energies_only)

    def _steps(self, found: Found, until: float, pause: MakePause, complete: Complete) -> Steps:
        route = self.movements.route
        charge = Charge(self.request.settings.transitions)
        legs = legs_of(route, parts_of(self.chain, self.movements), found)
        steps = assembled(
            route.steps, legs, route.scenes, self.request.start, pause, charge, complete
        )
        left = until - duration_of(steps)
        if left <= _NO_WAIT:
            return steps
        wait = self._end(left)
        return (*steps, charge.stood(pause(wait), wait))

    def standing(self, found: Found) -> float:
        """Seconds of the pauses in the program."""
        return sum(step.duration for step in self.energies(found) if step.is_pause)

    def waiting(self, seconds: float) -> float:
        """Joules of a wait at the end, in the mode of least energy."""
        return self._pause(by_itself=False)(self._end(seconds)).report.energy

    def _end(self, seconds: float) -> Pause:
        route = self.movements.route
        end = route.scenes.after(route.steps[-1])
        q = self.movements.layers[-1][self.chain.chosen[-1]].interaction
        return Pause(route.name(len(route) - 1), seconds, AUTO, q, end)

    def _pause(self, by_itself: bool) -> MakePause:
        times = self.request.settings.transitions
        if by_itself:
            return lambda pause: pause_by_itself(pause, times)
        return lambda pause: planned_pause(pause, times)


def duration_of(steps: Sequence[PlannedMovement]) -> float:
    """How long steps take [s]."""
    return sum(step.duration for step in steps)
