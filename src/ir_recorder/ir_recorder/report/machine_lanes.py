"""States of machines, moving ones too, and contacts, as rows of spans beside the power modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ir_recorder.read.recording import Recording, TextEvent
from ir_recorder.report.series import Json

_SHOWN = 0.5  # s that a contact is wide: an instant would not be seen


def machine_lanes(recording: Recording) -> Iterator[dict[str, Json]]:
    """A lane for each machine whose state changed, and one for the contacts where there were
    any.
    """
    for name in dict.fromkeys(event.name for event in recording.machines):
        events = [event for event in recording.machines if event.name == name]
        if len({event.text for event in events}) > 1:
            yield {"label": name, "spans": list(_spans(events, recording.duration))}
    if recording.contacts:
        spans: list[Json] = [
            [at.time, at.time + _SHOWN, at.text, "contact"] for at in recording.contacts
        ]
        yield {"label": "contact", "spans": spans}


def _spans(events: Sequence[TextEvent], end: float) -> Iterator[list[Json]]:
    """From one change to the next; styles alternate with the states, and movement has its own."""
    styles: dict[str, str] = {}
    start = max(events[0].time, 0.0)
    current = events[0].text
    for time, text in [*((event.time, event.text) for event in events[1:]), (end, "")]:
        if text == current:
            continue
        before, _, ahead = current.partition(">")
        style = styles.setdefault(before, "none" if not styles else "load")
        words = f"{before} to {ahead}" if ahead else before
        yield [start, time, words, "moving" if ahead else style]
        start = max(time, 0.0)
        current = text
