"""What the searches of the last planned program did, from the planner's answer that a recording holds."""

from __future__ import annotations

from ir_msgs_py.search_log import SearchLog, log_of
from ir_recorder.errors import ReadError
from ir_recorder.read.cdr import Columns
from ir_recorder.read.front import ACTION, answers, result_definition
from ir_recorder.read.planned import SERVICE
from ir_recorder.read.raw import RawChannel

MOST_STAGES = 2_000


def search_logs(channel: RawChannel | None) -> tuple[SearchLog, ...]:
    """Logs in the last answer on a planner's calls that has a program; empty where none has."""
    definition = result_definition()
    if channel is None or not definition:
        return ()
    for answer in answers(channel, (ACTION, SERVICE)):
        try:
            columns = Columns([answer], f"{ACTION.replace('/action/', '/msg/')}_Result", definition)
        except ReadError:
            continue
        if columns.texts("program_id")[0]:
            return tuple(_logs_of(columns))
    return ()


def _logs_of(columns: Columns) -> list[SearchLog]:
    logs: list[SearchLog] = []
    for k in range(MOST_STAGES):
        name = columns.texts(f"info.stages[{k}].name")[0]
        log = log_of(name, columns.texts(f"info.stages[{k}].note")[0]) if name else None
        logs += [log] if log is not None else []
    return logs
