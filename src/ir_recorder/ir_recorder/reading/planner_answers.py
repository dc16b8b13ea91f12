"""Planner's answers in a recording: steps, savings, searches and Pareto fronts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np

from ir_msgs_py import names
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.savings import ProgramPoint
from ir_msgs_py.search_log import (
    ConfigurationLog,
    CorrectionLog,
    Counts,
    SearchLog,
    Track,
    WithdrawalLog,
)
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.errors import ReadError, SchemaError
from ir_recorder.format.schemas import SEPARATOR, SchemaLibrary, fields_of, installed_prefixes
from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import RawChannel, chosen_namespace, read_raw
from ir_recorder.reading.messages import decoder_of
from ir_recorder.reading.recording import ProgramEvent, Recording
from ir_recorder.reading.search_notes import log_of
from ir_values.arrays import FloatArray
from ir_values.errors import IrError
from ir_values.files import ANYWHERE, FileRoots

# The Pareto front of a program, from the planner's answers that a recording holds; read without
# ROS.
#
# An answer is the result of the action ir_msgs/action/Plan as CDR. Its definition isn't in the
# file: it is that of the installed interfaces, without which no front is read. Fields that earlier
# versions did not have stand at its end: what comes before them is read without them.

ACTION = "ir_msgs/action/Plan"
_LATER = "searches|pareto_ids"  # fields that recordings of earlier versions don't have
_EMPTY = 64  # bytes: more than their lengths of 0
MOST_POINTS = 50  # of a front, by the request


def recorded_front(
    path: str | Path, roots: FileRoots = ANYWHERE, namespace: str | None = None
) -> tuple[ProgramPoint, ...]:
    """The last front that a planner answered with, by cycle time; empty where there is none.
    ReadError as `read_recording`.
    """
    raw = read_raw(path, roots)
    prefix = chosen_namespace(raw, namespace)[0].rstrip("/")
    channel = raw.channel(f"{prefix}/{names.PLANNER}/{names.CALLS}")
    definition = result_definition()
    if channel is None or channel.message_encoding != "cdr" or not definition:
        return ()
    for answer in answers(channel):
        points = front_of(answer, definition)
        if points:
            return points
    return ()


def answers(channel: RawChannel, kinds: tuple[str, ...] = (ACTION,)) -> Iterator[bytes]:
    """Results and answers of these types, the last one first; what can't be decoded is left out."""
    try:
        decode = decoder_of(channel)
    except Exception:  # a damaged schema makes the parser raise nearly anything
        return
    for data in reversed(channel.messages):
        try:
            call = decode(data) if decode else None
            kind, answer = (call.type, bytes(call.response)) if call is not None else ("", b"")
        except Exception:  # damaged bytes: the decoder raises nearly anything
            continue
        if kind in kinds and answer:
            yield answer


def front_of(answer: bytes, definition: str) -> tuple[ProgramPoint, ...]:
    """The front in one result, CDR with its definition; empty where it has none or makes no
    sense.
    """
    try:
        columns = Columns([answer], f"{ACTION.replace('/action/', '/msg/')}_Result", definition)
    except ReadError:
        return ()
    points = []
    for k in range(MOST_POINTS):
        seconds, energy = (
            float(columns.numbers(f"front[{k}].{name}")[0]) for name in ("cycle_time", "energy")
        )
        if not np.isfinite([seconds, energy]).all():
            break
        points.append(ProgramPoint(seconds, energy, columns.texts(f"front[{k}].program_id")[0]))
    return tuple(points)


def result_definition(*, later: bool = False) -> str:
    """Text of the result's type as `answer_definition` gives it."""
    return answer_definition(ACTION, later=later)


@cache
def answer_definition(kind: str, *, later: bool) -> str:
    """Text of an action's result or a service's response and of all it is built from, with or
    without the fields that earlier versions did not have; "" where the interfaces aren't installed.
    """
    package, folder, name = kind.split("/")
    files = [
        prefix / "share" / package / folder / f"{name}.{folder}" for prefix in installed_prefixes()
    ]
    text = next((file.read_text(encoding="utf-8") for file in files if file.is_file()), "")
    parts = re.split(r"^---\s*$", text, flags=re.MULTILINE)
    if len(parts) < 2:
        return ""
    own_text = parts[1]
    if not later:
        own_text = re.sub(rf"^\S+ (?:{_LATER})\b.*\n", "", own_text, flags=re.MULTILINE)
    library = SchemaLibrary()
    sections = dict[str, str]()
    try:
        for field in fields_of(own_text, package):
            if not field.primitive:
                own, inner = field.type.split("/")
                head, *others = library.schema(f"{own}/msg/{inner}").text.split(
                    f"{SEPARATOR}\nMSG: "
                )
                sections[field.type] = head
                for other in others:
                    title, _, body = other.partition("\n")
                    sections[title] = body
    except SchemaError:
        return ""
    return own_text + "".join(
        f"{SEPARATOR}\nMSG: {title}\n{body}\n" for title, body in sections.items()
    )


def completed(answer: bytes, kind: str) -> bytes:
    """The CDR of an answer that an earlier version recorded, with empty values for the fields that
    it did not have. Raises ReadError.
    """
    title = kind.replace("/action/", "/msg/").replace("/srv/", "/msg/")
    columns = Columns([answer], f"{title}_Answer", answer_definition(kind, later=False))
    return answer[: columns.ends()[0]] + bytes(_EMPTY)


# The steps of the last program that was planned, from the planner's answer that a recording holds.
#
# The answers of ir_msgs/action/Plan and ir_msgs/srv/PlanProgram have the same fields.

SERVICE = "ir_msgs/srv/PlanProgram"
MOST_STEPS = 1_000


Interval = tuple[float, float]


def planned_program(
    channel: RawChannel | None,
) -> tuple[tuple[PlannedMovement, ...], Interval | None, bool]:
    """Steps of the last answer on a planner's calls that has some, without points, the 90 %
    interval of their energy [J], which is not that of the steps' sum, and whether the answer is
    certified; empty where none has.
    """
    definition = result_definition()
    if channel is None or channel.message_encoding != "cdr" or not definition:
        return (), None, False
    for answer in answers(channel, (ACTION, SERVICE)):
        try:
            name = f"{ACTION.replace('/action/', '/msg/')}_Result"
            columns = Columns([answer], name, definition)
        except ReadError:
            continue
        if steps := _steps_of(columns):
            low, high = (
                float(columns.numbers(f"report.energy_{end}")[0]) for end in ("low", "high")
            )
            certified = float(columns.numbers("report.certified")[0]) == 1.0
            return steps, (low, high) if high > low else None, certified
    return (), None, False


def with_trajectories(
    steps: Sequence[PlannedMovement], known: Sequence[JointTrajectory]
) -> tuple[PlannedMovement, ...]:
    """The steps with the trajectories that were published of them, in their order; as they are
    where those aren't one of each movement, as long as it.
    """
    moving = [step for step in steps if not step.is_pause]
    alike = len(moving) == len(known) and all(
        abs(step.duration - one.duration) < _ALIKE for step, one in zip(moving, known, strict=True)
    )
    if not alike:
        return tuple(steps)
    left = iter(known)
    return tuple(step if step.is_pause else replace(step, trajectory=next(left)) for step in steps)


_ALIKE = 1e-6  # s


def _steps_of(columns: Columns) -> tuple[PlannedMovement, ...]:
    steps: list[PlannedMovement] = []
    for k in range(MOST_STEPS):
        seconds = float(columns.numbers(f"movements[{k}].duration")[0])
        if not math.isfinite(seconds):
            break
        try:
            steps.append(_step(columns, f"movements[{k}]", seconds))
        except IrError:
            return ()
    return tuple(steps)


def _step(columns: Columns, place: str, seconds: float) -> PlannedMovement:
    def text(name: str) -> str:
        return columns.texts(f"{place}.{name}")[0]

    def number(name: str) -> float:
        return float(columns.numbers(f"{place}.report.{name}")[0])

    return PlannedMovement(
        kind=text("kind"),
        from_station=text("from_station"),
        to_station=text("to_station"),
        power_mode=text("power_mode"),
        load=text("load"),
        duration=seconds,
        report=TrajectoryReport(
            duration=seconds,
            energy=number("energy"),
            energy_low=number("energy_low"),
            energy_high=number("energy_high"),
            peak_power=number("peak_power"),
            min_clearance=number("min_clearance"),
            certified=number("certified") == 1.0,
            safety_distance=number("safety_distance"),
        ),
    )


# What the plans behind a recorded run save, and what their searches did, from the planner's
# answers.

MOST_STAGES = 2_000
_FARTHEST = 1e3  # m: a position beyond is none
_MOST_NUMBERS = 20_000  # of one track


def with_plans(found: Recording, channel: RawChannel | None) -> Recording:
    """The recording with searches and savings of its plans, by the planner's calls; all savings
    where no plan is known.
    """
    plans = _driven_plans(channel, found.events)
    logs = tuple(log if plan.own else _not_driven(log) for plan in plans for log in _logs_of(plan))
    ids = {plan.answer.texts("savings.program_id")[0] for plan in plans}
    savings = tuple(
        event for event in found.savings if not plans or event.savings.program_id in ids
    )
    return replace(found, searches=logs, savings=savings)


@dataclass(frozen=True, eq=False)
class _Driven:
    """A planner's answer and its bytes; own: its program itself was driven, not one of its front or
    its savings.
    """

    answer: Columns
    data: bytes
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
        last = islice(_plans(recorded, definition), 1)
        return tuple(_Driven(plan, data, True) for plan, data in last)
    found: list[_Driven] = []
    answers_of = _answers_by_id(recorded, driven, definition)
    for program, trajectories in driven.items():
        # steps that a client handed over have no name
        ids = {program} if program else trajectories - {""}
        named = answers_of.get(min(ids), []) if ids else []
        plans = [each for each in named if ids <= each.ids]
        own = [each for each in plans if program in ("", each.program)]
        for each in (own or plans)[:1]:
            plan, data = next(_plans([each.data], definition))
            found.append(_Driven(plan, data, bool(own)))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Named:
    """An answer with a program, and the ids that it names."""

    data: bytes
    program: str
    ids: frozenset[str]


def _answers_by_id(
    recorded: Iterable[bytes], driven: Mapping[str, set[str]], definition: str
) -> dict[str, list[_Named]]:
    """Answers by each id of a driven program or trajectory that they name, in their order.

    Each answer is read once: a file may name a hundred thousand programs.
    """
    wanted = {*driven, *(each for own in driven.values() for each in own)} - {""}
    written = {each.encode() for each in wanted}
    found: dict[str, list[_Named]] = {}
    for answer in recorded:
        if answer[1:2] != b"\0" and written.isdisjoint(answer.split(b"\0")):
            continue  # in little-endian CDR a text stands between zeros
        for plan, data in _plans([answer], definition):
            ids = frozenset(_ids(plan))
            named = _Named(data, plan.texts("program_id")[0], ids)
            for each in ids & wanted:
                found.setdefault(each, []).append(named)
    return found


def _plans(recorded: Iterable[bytes], definition: str) -> Iterator[tuple[Columns, bytes]]:
    """Answers that have a program, and their bytes."""
    for answer in recorded:
        try:
            columns = Columns([answer], f"{ACTION.replace('/action/', '/msg/')}_Result", definition)
        except ReadError:
            continue
        if columns.texts("program_id")[0]:
            yield columns, answer


def _ids(plan: Columns) -> set[str]:
    """Of the programs and trajectories in an answer."""
    points = (f"front[{k}].program_id" for k in range(MOST_POINTS))
    steps = (f"movements[{k}].trajectory_id" for k in range(MOST_STEPS))
    return {plan.texts(name)[0] for name in ("program_id", "savings.program_id", *points, *steps)}


def _logs_of(plan: _Driven) -> tuple[SearchLog, ...]:
    """Logs of the searches behind an answer: in their field, or as notes of an earlier version."""

    def of_stage(k: int, field: str) -> str:
        return plan.answer.texts(f"info.stages[{k}].{field}")[0]

    noted = (log_of(of_stage(k, "name"), of_stage(k, "note")) for k in range(MOST_STAGES))
    found = tuple(log for log in noted if log is not None)
    if found:
        return found
    kind = f"{ACTION.replace('/action/', '/msg/')}_Result"
    try:
        columns = Columns([plan.data], kind, result_definition(later=True))
        return tuple(_SearchFields(columns).logs())
    except (ReadError, ValueError):  # an earlier version's, which ends before the field
        return ()


class _SearchFields:
    """Reads the logs in the field `searches` of an answer. Raises ValueError where one makes no
    sense.
    """

    def __init__(self, columns: Columns) -> None:
        self._columns = columns

    def logs(self) -> Iterator[SearchLog]:
        """Withdrawals, configurations, corrections."""
        for place in self._places("searches.withdrawals", "station"):
            yield self._withdrawal(place)
        for place in self._places("searches.configurations", "station"):
            yield self._configurations(place)
        for place in self._places("searches.corrections", "start"):
            yield self._correction(place)

    def _withdrawal(self, place: str) -> WithdrawalLog:
        kept = self._points(f"{place}.kept")
        parents = self._values(f"{place}.parents").astype(np.int64)
        if parents.shape != (len(kept),) or (parents > np.arange(len(kept))).any():
            raise ValueError(f"{place} has no tree")
        return WithdrawalLog(
            self._text(f"{place}.station"),
            self._text(f"{place}.load"),
            self._text(f"{place}.method"),
            self._whole(f"{place}.generations"),
            self._whole(f"{place}.candidates"),
            self._counts(place),
            self._pair(f"{place}.distance"),
            kept,
            parents,
            self._points(f"{place}.dropped"),
            self._points(f"{place}.path"),
            bool(self._whole(f"{place}.asked")),
            self._text(f"{place}.blocked"),
        )

    def _configurations(self, place: str) -> ConfigurationLog:
        tracks = tuple(
            Track(self._text(f"{track}.outcome"), self._points(f"{track}.points"))
            for track in self._places(f"{place}.tracks", "outcome")
        )
        return ConfigurationLog(
            self._text(f"{place}.station"),
            self._whole(f"{place}.starts"),
            self._whole(f"{place}.accepted"),
            self._whole(f"{place}.distinct"),
            self._counts(place),
            tracks,
        )

    def _correction(self, place: str) -> CorrectionLog:
        counts = self._values(f"{place}.fitness_counts").astype(np.int64)
        fitness = np.split(self._values(f"{place}.fitness"), np.cumsum(counts)[:-1])
        return CorrectionLog(
            self._text(f"{place}.start"),
            self._text(f"{place}.goal"),
            self._whole(f"{place}.generations"),
            tuple(tuple(each.tolist()) for each in fitness if len(counts)),
            self._pair(f"{place}.costs"),
            self._points(f"{place}.straight"),
            tuple(
                self._points(f"{each}.points")
                for each in self._places(f"{place}.stretches", "outcome")
            ),
            self._points(f"{place}.path"),
            self._text(f"{place}.met"),
            self._points(f"{place}.driven"),
        )

    def _places(self, path: str, text: str) -> list[str]:
        """Paths of the elements of a list, by a text that each has."""
        count = 0
        while self._columns.lengths(f"{path}[{count}].{text}") != {0}:
            count += 1
        return [f"{path}[{k}]" for k in range(count)]

    def _text(self, path: str) -> str:
        return self._columns.texts(path)[0]

    def _whole(self, path: str) -> int:
        return int(self._columns.integers(path)[0])

    def _values(self, path: str) -> FloatArray:
        (count,) = self._columns.lengths(path)
        values: FloatArray = self._columns.numbers(path, count)[0]
        if not np.isfinite(values).all():
            raise ValueError(f"{path} is not finite")
        return values

    def _points(self, path: str) -> FloatArray:
        points = self._values(path).reshape(-1, 3)
        if points.size > _MOST_NUMBERS or (np.abs(points) > _FARTHEST).any():
            raise ValueError(f"{path} is no track of a tool")
        return points

    def _pair(self, path: str) -> tuple[float, float]:
        first, second = self._values(path).tolist()
        return first, second

    def _counts(self, place: str) -> Counts:
        return tuple(
            (self._text(f"{each}.reason"), self._whole(f"{each}.count"))
            for each in self._places(f"{place}.rejected", "reason")
        )


def _not_driven(log: SearchLog) -> SearchLog:
    """The log without the movement of another program."""
    return replace(log, driven=np.zeros((0, 3))) if isinstance(log, CorrectionLog) else log
