"""The common program: what a commissioned robot would do at the same stations, to hold savings
against.

Baseline movements (straight joint segments as synchronous S-curves at full speed) through the same
stations, at each stop the configuration that is nearest to the one before by W, turns included; the
same service lines, as fast as they can; the same pauses, left to the controller's own timers. Where
a segment is not free, the movement runs along the planner's path in straight steps with blended
corners; `around` counts these.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ir_planner.errors import TimingError
from ir_planner.program.choice import Choice, Steps
from ir_planner.program.ladder import FASTEST
from ir_planner.program.movements import Failure, Movements
from ir_planner.program.parallel import mapped
from ir_planner.program.request import StageError
from ir_planner.program.station_graph import ACROSS, Chain, Part
from ir_planner.scene import movement_cost
from ir_planner.timing import Movement, baseline, straight_steps

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class CommonProgram:
    """Its chain with the movements of all parts; `around` of its `across` regional movements run
    around bodies.
    """

    choice: Choice
    found: Mapping[Part, Movement]
    around: int

    @property
    def across(self) -> int:
        """How many regional movements it has."""
        return sum(part.kind == ACROSS for part in self.found)

    def steps(self, until: float = 0.0) -> Steps:
        """Movements and pauses in order, and a wait at the end that lasts until `until` s."""
        return self.choice.steps(self.found, until=until, by_itself=True)


def common_program(choice: Choice) -> CommonProgram:
    """The common program of a request, which moves as fast as it can; it needs the request's layers
    only.

    Raises StageError where it has a movement that isn't found.
    """
    fastest = choice.ladder.at(FASTEST)
    improvement = choice.ladder.improvement
    nearest = choice.along(nearest_chain(fastest))
    parts = nearest.parts
    across = [part for part in parts if part.kind == ACROSS]
    lines = [part for part in parts if part.kind != ACROSS]
    chosen = dict(zip(lines, _all_found(lines, fastest, improvement), strict=True))
    plain = dict(
        zip(across, _side_by_side(lambda part: _plain(part, fastest), across, fastest), strict=True)
    )
    around = [part for part, movement in plain.items() if movement is None]
    chosen |= {part: movement for part, movement in plain.items() if movement is not None}
    own = Movements(fastest.route, fastest.layers, fastest.context, fastest.searches)
    paths = _all_found(around, own, 0)
    chosen |= zip(around, _side_by_side(_in_straight_steps, paths, fastest), strict=True)
    return CommonProgram(nearest, {part: chosen[part] for part in parts}, len(around))


def nearest_chain(movements: Movements) -> Chain:
    """At each stop the configuration nearest to the one before by W."""
    chosen = [0]
    total = 0.0
    for hop in range(len(movements.route)):
        weights = movements.route.arriving(hop).weights
        here = movements.layers[hop][chosen[-1]].departure
        there = np.array([node.arrival for node in movements.layers[hop + 1]])
        costs = movement_cost(weights, here, there)
        chosen.append(int(np.argmin(costs)))
        total += float(costs.min())
    return Chain(chosen, total, total, total)


def _plain(part: Part, movements: Movements) -> Movement | None:
    """The baseline movement of a part across, None where it isn't certified."""
    first, second = movements.ends(part)
    found = baseline(first, second, movements.context.inside(movements.route.arriving(part.hop)))
    return found if found is not None and found.certified else None


def _all_found(parts: list[Part], movements: Movements, improvement: int) -> list[Movement]:
    """The movements of parts. Raises StageError for the first that isn't found."""
    found = list[Movement]()
    for each in movements.plan(parts, improvement):
        if isinstance(each, Failure):
            raise StageError(each.status)
        found.append(each)
    return found


def _in_straight_steps(found: Movement) -> Movement:
    """The movement along the planner's path; that itself where the other isn't certified."""
    try:
        along = straight_steps(found.path, found.context)
    except TimingError:
        return found
    return along if along.certified else found


def _side_by_side(
    task: Callable[[Item], Result], items: Sequence[Item], movements: Movements
) -> list[Result]:
    """What a task that needs no work makes of every item."""
    return mapped(lambda item, _: task(item), items, movements.context, 0, [0] * len(items))
