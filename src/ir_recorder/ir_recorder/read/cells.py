"""Which cell of a recording is read: a file may hold several, each in a namespace of its own."""

from __future__ import annotations

from ir_msgs_py import names
from ir_msgs_py.checks import one_line
from ir_recorder.errors import ReadError
from ir_recorder.read.raw import RawRecording

_SHOWN = 8  # namespaces in a sentence


def namespaces_of(raw: RawRecording) -> list[str]:
    """Namespaces of the cells: what stands before the mains meter's topic, else before
    /joint_states.
    """
    for name in (names.POWER_STATE, names.JOINT_STATES):
        topics = [channel.topic for channel in raw.channels if channel.topic.endswith(f"/{name}")]
        if topics:
            return list(dict.fromkeys(topic.removesuffix(f"/{name}") or "/" for topic in topics))
    return []


def chosen_namespace(raw: RawRecording, wanted: str | None) -> tuple[str, str]:
    """The namespace to read, and a sentence where the file holds others too; ReadError for one it
    lacks.
    """
    found = namespaces_of(raw)
    shown = one_line(", ".join(found[:_SHOWN]) or "none", 400)
    if wanted is None:
        sentence = (
            f"the first of the recording's cells is read ({shown}); --namespace chooses another"
        )
        return (found[0] if found else "/"), (sentence if len(found) > 1 else "")
    absolute = f"/{wanted.strip('/')}"
    if absolute not in found:
        raise ReadError(f"no cell {absolute[:200]!r} in the recording; there is: {shown}")
    return absolute, ""
