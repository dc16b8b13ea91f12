"""The Pareto front of a program, from the planner's answers that a recording holds; read without
ROS.

An answer is the result of the action ir_msgs/action/Plan as CDR. Its definition isn't in the file:
it is that of the installed interfaces, without which no front is read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from ir_msgs_py import names
from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_msgs_py.savings import ProgramPoint
from ir_recorder.errors import ReadError, SchemaError
from ir_recorder.format.definition import SEPARATOR, fields_of
from ir_recorder.format.schemas import SchemaLibrary, installed_prefixes
from ir_recorder.read.cdr import Columns
from ir_recorder.read.cells import chosen_namespace
from ir_recorder.read.decoded import decoder_of
from ir_recorder.read.raw import RawChannel, read_raw

ACTION = "ir_msgs/action/Plan"
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


@cache
def result_definition() -> str:
    """Text of the result's type and of all it is built from; "" where the interfaces aren't
    installed.
    """
    package, _, name = ACTION.split("/")
    files = [
        prefix / "share" / package / "action" / f"{name}.action" for prefix in installed_prefixes()
    ]
    text = next((file.read_text(encoding="utf-8") for file in files if file.is_file()), "")
    parts = re.split(r"^---\s*$", text, flags=re.MULTILINE)
    if len(parts) != 3:
        return ""
    library = SchemaLibrary()
    sections = dict[str, str]()
    try:
        for field in fields_of(parts[1], package):
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
    return parts[1] + "".join(
        f"{SEPARATOR}\nMSG: {title}\n{body}\n" for title, body in sections.items()
    )
