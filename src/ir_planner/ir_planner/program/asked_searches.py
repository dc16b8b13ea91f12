"""Searches that a cell asks for at its stations and steps, and nobody has, or not without OMPL."""

from collections.abc import Iterable, Iterator, Sequence

from ir_description import Cell, Finding, ProgramStep
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.regional import Searches
from ir_planner.request import chosen
from ir_planner.search import not_installed
from ir_planner.service import EXIT_SEARCHES


def unknown_searches(
    cell: Cell, steps: Sequence[ProgramStep], searches: Searches
) -> Iterator[Finding]:
    """Steps, and stations that they visit, with the name of a search that is not known or not
    installed.
    """
    for k, step in enumerate(steps, start=1):
        yield from _unknown(f"step {k}", step.planner, searches, "planner")
        if step.planner in searches and (how := not_installed(searches[step.planner])):
            yield Finding("error", f"step {k}", f"planner {step.planner!r}: {how}")
    visited = {step.target for step in steps}
    for station in cell.stations:
        if station.name in visited:
            yield from _unknown(
                station.name, station.search.withdrawal, EXIT_SEARCHES, "withdrawal"
            )


def check_searches(cell: Cell, steps: Sequence[ProgramStep], searches: Searches) -> None:
    """Raise RequestError for a step or a station that asks for a search nobody has."""
    for finding in unknown_searches(cell, steps, searches):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS, f"{finding.subject}: {finding.sentence}"
        )


def _unknown(subject: str, value: str, known: Iterable[str], name: str) -> Iterator[Finding]:
    try:
        chosen(value, ("", *known), name)
    except RequestError as error:
        yield Finding("error", subject, error.status.message)
