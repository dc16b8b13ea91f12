"""The movements of a program: out of one stop, across, into the next; each is planned once."""

import numpy as np
from ir_msgs_py.report import MovementKind
from ir_msgs_py.status import Status, StatusCode

from ir_planner.program.assembly import Leg
from ir_planner.program.request import StageError
from ir_planner.program.route import Route
from ir_planner.program.station_graph import Node
from ir_planner.regional import Searches, search_regional
from ir_planner.request import Context, Journal
from ir_planner.scene import STILL
from ir_planner.service import timed_service
from ir_planner.timing import TimedMovement


class Movements:
    """Movements between configurations at the stops of a route, by the objective of `context`."""

    def __init__(self, route: Route, context: Context, searches: Searches) -> None:
        self.route, self.context, self.searches = route, context, searches
        self._across: dict[tuple[int, int, int], TimedMovement] = {}
        self.unreachable = Status(
            StatusCode.PLANNING_FAILED, "no chain of configurations connects the stations"
        )

    def across(self, place: int, first: Node, second: Node) -> TimedMovement | None:
        """The regional movement to a stop, or None; then `unreachable` says why."""
        key = (place, id(first), id(second))
        if key not in self._across:
            journal = Journal(self.context.work, self.context.journal.seed)
            context = Context(self.route.arriving(place), self.context.options, journal)
            status, found = search_regional(first.outside, second.outside, context, self.searches)
            self.context.journal.rejected.update(journal.rejected)
            if found is None:
                first_name = self.route.name(place - 1) or "the start"
                sentence = f"from {first_name} to {self.route.name(place)}: {status.message}"
                self.unreachable = Status(status.code, sentence)
                return None
            self._across[key] = found
        return self._across[key]

    def leg(self, place: int, first: Node, second: Node) -> Leg:
        """All movements that reach a stop. Raises StageError where one of them isn't found."""
        here, there = self.route.name(place - 1), self.route.name(place)
        movements: list[tuple[MovementKind, TimedMovement]] = []
        if len(first.line.points) > 1:
            movements.append((MovementKind.SERVICE_EXIT, self._service(place, first, here, entry=False)))
        if np.abs(second.outside - first.outside).max() > STILL:
            across = self.across(place, first, second)
            if across is None:
                raise StageError(self.unreachable)
            movements.append((MovementKind.REGIONAL, across))
        if len(second.line.points) > 1:
            movements.append((MovementKind.SERVICE_ENTRY, self._service(place, second, there, entry=True)))
        return Leg(here, there, self.route.arriving(place), tuple(movements))

    def _service(self, place: int, node: Node, station: str, *, entry: bool) -> TimedMovement:
        context = self.context.inside(self.route.arriving(place)).at(station)
        movement = timed_service(node.line, entry, context)
        if movement.violation is not None:
            what = f"{'entering' if entry else 'leaving'} {station}: {movement.violation.sentence}"
            raise StageError(Status(StatusCode.PLANNING_FAILED, what))
        return movement
