"""A request for a program and its answer, and the searches that its cell names."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from ir_description import Cell, PowerData, ProgramStep
from ir_description.cell import BLEND_MAX
from ir_description.cell_review import CellFinding
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import AS_THE_CELL_SAYS, PlanOptions
from ir_msgs_py.report import PlannedMovement, PlanningInfo, TrajectoryReport
from ir_msgs_py.savings import ProgramSavings
from ir_msgs_py.status import Status, StatusCode
from ir_planner.errors import RequestError
from ir_planner.presentation import plot_steps, result_text
from ir_planner.program.steps import Doors
from ir_planner.regional import Searches
from ir_planner.request import bounded, chosen
from ir_planner.search import not_installed
from ir_planner.service import EXIT_SEARCHES
from ir_planner.settings import PlannerSettings
from ir_values.arrays import FloatArray

# What a program is asked as, and what its answer is.

FRONT_MAX = 50
NOT_ASKED = ProgramSavings(sentence="savings were not asked for")
Progress = Callable[[str, int, int, float], None]  # phase, done, total, cost of the best chain


@dataclass(frozen=True, eq=False)
class ProgramPlan:
    """The answer: movements and pauses in order; empty unless the status is SUCCESS.

    gap [%]: how far above the best chain of configurations it can be at most. savings: with
    `compared`, the program that they are of, and `common`, the program that it is held against.
    front: programs by cycle time.
    """

    status: Status
    info: PlanningInfo
    program_id: str = ""
    movements: tuple[PlannedMovement, ...] = ()
    report: TrajectoryReport = field(default_factory=TrajectoryReport)
    gap: float = 0.0
    savings: ProgramSavings = NOT_ASKED
    compared: "ProgramPlan | None" = None
    common: "ProgramPlan | None" = None
    front: tuple["ProgramPlan", ...] = ()

    def __repr__(self) -> str:
        steps = f"{len(self.movements)} steps"
        return result_text("ProgramPlan", self.status, self.report, self.program_id, steps)

    def plot(self) -> Any:
        """The steps over time, as high as their mean power; a matplotlib figure."""
        return plot_steps(self.movements, repr(self))


@dataclass(frozen=True, eq=False)
class ProgramRequest:
    """What to plan: the cell, its stations to visit (empty: its program), from `start` (n,), in
    `cycle_time` s (0: free). savings: hold it against the common program; front_points: programs
    from the shortest cycle time to twice the free one. doors: machines that are not as the cell has
    them at the start. blend [m]: how near stops and ends of lines are passed where nothing happens,
    below 0: as the cell says.
    """

    cell: Cell
    power: PowerData
    stations: tuple[str, ...]
    start: FloatArray
    options: PlanOptions
    cycle_time: float = 0.0
    settings: PlannerSettings = field(default_factory=PlannerSettings)
    savings: bool = False
    front_points: int = 0
    doors: Doors = ()
    blend: float = AS_THE_CELL_SAYS

    def check(self) -> None:
        """Raise RequestError for options that a program doesn't take."""
        bounded(self.front_points, 0, FRONT_MAX, "front_points")
        if self.blend != AS_THE_CELL_SAYS:
            bounded(self.blend, 0.0, BLEND_MAX, "blend", "m")
        load = self.options.load
        duration = self.options.duration
        if load not in ("", NO_LOAD):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"load is {load[:80]!a}: in a program the steps say what is attached, leave it "
                "empty",
            )
        if duration > 0.0:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"duration is {duration:g} s: a program has a cycle_time instead, leave it 0 s",
            )


def nobody(phase: str, done: int, total: int, cost: float) -> None:
    """Progress that nobody asks for."""


class StageError(Exception):
    """A stage of the program found nothing; carries the status of the answer."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.message)
        self.status = status


# Searches that a cell asks for at its stations and steps, and nobody has, or not without OMPL.


def unknown_searches(
    cell: Cell, steps: Sequence[ProgramStep], searches: Searches
) -> Iterator[CellFinding]:
    """Steps, and stations that they visit, with the name of a search that is not known or not
    installed.
    """
    for k, step in enumerate(steps, start=1):
        yield from _unknown(f"step {k}", step.planner, searches, "planner")
        if step.planner in searches and (how := not_installed(searches[step.planner])):
            yield CellFinding("error", f"step {k}", f"planner {step.planner!r}: {how}")
    visited = {step.target for step in steps}
    for station in cell.stations:
        if station.name in visited:
            yield from _unknown(
                station.name, station.search.withdrawal, EXIT_SEARCHES, "withdrawal"
            )
            if why := EXIT_SEARCHES.why_not(station.search.withdrawal):
                yield CellFinding("error", station.name, f"withdrawal: {why}")


def check_searches(cell: Cell, steps: Sequence[ProgramStep], searches: Searches) -> None:
    """Raise RequestError for a step or a station that asks for a search nobody has."""
    for finding in unknown_searches(cell, steps, searches):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS, f"{finding.subject}: {finding.sentence}"
        )


def _unknown(subject: str, value: str, known: Iterable[str], name: str) -> Iterator[CellFinding]:
    try:
        chosen(value, ("", *known), name)
    except RequestError as error:
        yield CellFinding("error", subject, error.status.message)
