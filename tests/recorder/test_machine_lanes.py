"""States of machines and contacts in a recording, and as lanes of the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs.msg import Contact, MachineStates
from ir_recorder import read_recording
from ir_recorder.reading.reader import contacts, machine_states
from ir_recorder.reading.recording import Recording, TextEvent
from ir_recorder.report.series import machine_lanes

moments = st.lists(
    st.tuples(
        st.floats(0.01, 2.0), st.sampled_from(["open", "open>closed", "closed", "closed>open"])
    ),
    min_size=1,
    max_size=12,
)


@pytest.fixture(scope="module")
def recording(demo_file: Path) -> Recording:
    return replace(read_recording(demo_file), duration=60.0)


def lanes(recording: Recording, events: Any = (), touched: Any = ()) -> dict[str, Any]:
    changed = replace(recording, machines=tuple(events), contacts=tuple(touched))
    return {lane["label"]: lane["spans"] for lane in machine_lanes(changed)}


def test_messages_become_events() -> None:
    states = MachineStates(
        equipment=["lathe", "press"], states=["open", ""], next=["closed", ""], remaining=[0.5, 0.0]
    )
    assert list(machine_states([(2.0, states)])) == [
        TextEvent(2.0, "lathe", "open>closed"),
        TextEvent(2.0, "press", ""),
    ]
    contact = Contact(speed=0.5)
    contact.pair.body_a = "link_6"
    contact.pair.body_b = "lathe_door"
    (event,) = contacts([(3.0, contact)])
    assert (event.time, event.name) == (3.0, "lathe_door")
    assert "lathe_door" in event.text


@given(moments)
def test_the_state_at_every_instant_is_the_last_that_was_heard(
    recording: Recording, steps: Any
) -> None:
    times = np.cumsum([gap for gap, _ in steps]).tolist()
    events = [
        TextEvent(time, "lathe", state) for time, (_, state) in zip(times, steps, strict=True)
    ]
    spans = lanes(recording, events).get("lathe")
    if len({event.text for event in events}) == 1:
        assert spans is None  # nothing moved
        return
    for at in np.linspace(times[0], 59.9, 50):
        heard = [event.text for event in events if event.time <= at][-1]
        shown = [(words, style) for start, end, words, style in spans if start <= at < end]
        assert [words for words, _ in shown] == [heard.replace(">", " to ")]
        assert (shown[0][1] == "moving") == (">" in heard)


def test_contacts_are_shown_where_they_were(recording: Recording) -> None:
    assert "contact" not in lanes(recording)
    ((start, end, words, _),) = lanes(
        recording, touched=[TextEvent(4.0, "press", "hand touched press")]
    )["contact"]
    assert start == 4.0 < end
    assert words == "hand touched press"
