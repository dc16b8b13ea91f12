"""What happens around the robot, as events: the states of machines, and what the robot touches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from ir_recorder.read.decoded import contact_sentence
from ir_recorder.read.recording import TextEvent


def machine_states(messages: Iterable[tuple[float, Any]]) -> Iterator[TextEvent]:
    """The state of each machine; "closed>open" while it changes."""
    for time, message in messages:
        for name, state, ahead in zip(
            message.equipment, message.states, message.next, strict=False
        ):
            yield TextEvent(time, str(name), f"{state}>{ahead}" if ahead else str(state))


def contacts(messages: Iterable[tuple[float, Any]]) -> Iterator[TextEvent]:
    """What was touched, by the body that stands there."""
    for time, message in messages:
        yield TextEvent(time, str(message.pair.body_b), contact_sentence(message))
