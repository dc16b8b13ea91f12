"""What the plans behind a recorded run save, and what their searches did, from the planner's
answers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from ir_msgs_py.search_log import CorrectionLog, SearchLog, log_of
from ir_recorder.errors import ReadError
from ir_recorder.read.cdr import Columns
from ir_recorder.read.front import ACTION, MOST_POINTS, answers, result_definition
from ir_recorder.read.planned import MOST_STEPS, SERVICE
from ir_recorder.read.raw import RawChannel
from ir_recorder.read.recording import ProgramEvent, Recording

MOST_STAGES = 2_000


def with_plans(found: Recording, channel: RawChannel | None) -> Recording:
    """The recording with searches and savings of its plans, by the planner's calls; all savings
    where no plan is known.
    """
    plans = _driven_plans(channel, found.events)
    logs = tuple(
        log if plan.own else _not_driven(log) for plan in plans for log in _logs_of(plan.answer)
    )
    ids = {plan.answer.texts("savings.program_id")[0] for plan in plans}
    savings = tuple(
        event for event in found.savings if not plans or event.savings.program_id in ids
    )
    return replace(found, searches=logs, savings=savings)


@dataclass(frozen=True, eq=False)
class _Driven:
    """A planner's answer; own: its program itself was driven, not one of its front or its
    savings.
    """

    answer: Columns
    own: bool


def _driven_plans(
    channel: RawChannel | None, events: Sequence[ProgramEvent]
) -> tuple[_Driven, ...]:
    """Of the programs that were driven, in the order in which they were, each by the last answer on
    a planner's calls that has it; of the last planned program where none was driven.

    A program that was planned before the recording, or by nobody in it, has none.
    """
    definition = result_definition()
    if channel is None or not definition:
        return ()
    recorded = list(answers(channel, (ACTION, SERVICE)))
    driven: dict[str, set[str]] = {}
    for event in events:
        driven.setdefault(event.program_id, set()).add(event.movement.trajectory_id)
    if not driven:
        return tuple(_Driven(plan, True) for plan in islice(_plans(recorded, definition), 1))
    found: list[_Driven] = []
    for program, trajectories in driven.items():
        ids = (
            {program} if program else trajectories - {""}
        )  # steps that a client handed over have no name
        named = [
            answer for answer in recorded if ids and all(each.encode() in answer for each in ids)
        ]
        plans = [plan for plan in _plans(named, definition) if ids <= _ids(plan)]
        own = [plan for plan in plans if program in ("", plan.texts("program_id")[0])]
        found += [_Driven(plan, bool(own)) for plan in (own or plans)[:1]]
    return tuple(found)


def _plans(recorded: Iterable[bytes], definition: str) -> Iterator[Columns]:
    """Answers that have a program."""
    for answer in recorded:
        try:
            columns = Columns([answer], f"{ACTION.replace('/action/', '/msg/')}_Result", definition)
        except ReadError:
            continue
        if columns.texts("program_id")[0]:
            yield columns


def _ids(plan: Columns) -> set[str]:
    """Of the programs and trajectories in an answer."""
    points = (f"front[{k}].program_id" for k in range(MOST_POINTS))
    steps = (f"movements[{k}].trajectory_id" for k in range(MOST_STEPS))
    return {plan.texts(name)[0] for name in ("program_id", "savings.program_id", *points, *steps)}


def _logs_of(columns: Columns) -> tuple[SearchLog, ...]:
    def of_stage(k: int, field: str) -> str:
        return columns.texts(f"info.stages[{k}].{field}")[0]

    found = (log_of(of_stage(k, "name"), of_stage(k, "note")) for k in range(MOST_STAGES))
    return tuple(log for log in found if log is not None)


def _not_driven(log: SearchLog) -> SearchLog:
    """The log without the movement of another program."""
    return replace(log, driven=np.zeros((0, 3))) if isinstance(log, CorrectionLog) else log
