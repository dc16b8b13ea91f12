"""Contacts and states of machines survive the round trip through messages."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.announcements import Contact, MachineState
from ir_msgs_py.report import DistancePair
from ir_msgs_py.ros.plan_conversions import (
    contact_from_msg,
    contact_to_msg,
    machine_states_from_msg,
    machine_states_to_msg,
)
from ir_values.errors import InvalidValueError

PAIR = DistancePair("environment", "t_bar", "table", -0.01, np.zeros(3), np.ones(3))
positive = st.floats(0.0, 1e6)
words = st.text("abc_", max_size=8)


@given(st.tuples(*[positive] * 5), words)
def test_a_contact_is_the_same_after_a_message(numbers: tuple[float, ...], name: str) -> None:
    depth, speed, force, after, path_time = numbers
    contact = Contact(
        pair=PAIR,
        depth=depth,
        speed=speed,
        force=force,
        stopped_after=after,
        stamp_ns=5,
        trajectory_id=name,
        path_time=path_time,
    )
    again = contact_from_msg(contact_to_msg(contact))
    assert again.sentence == contact.sentence
    assert (again.depth, again.speed, again.force) == (depth, speed, force)
    assert (again.stopped_after, again.path_time, again.stamp_ns) == (after, path_time, 5)


@given(st.lists(st.builds(MachineState, words, words, words, positive), max_size=5))
def test_states_are_the_same_after_a_message(states: list[MachineState]) -> None:
    assert list(machine_states_from_msg(machine_states_to_msg(states))) == states


def test_what_makes_no_sense_is_refused() -> None:
    message = machine_states_to_msg([MachineState("lathe", "door_open")])
    message.next = []
    with pytest.raises(InvalidValueError, match="1, 1, 0, 1 entries"):
        machine_states_from_msg(message)
    with pytest.raises(InvalidValueError, match="depth"):
        Contact(pair=PAIR, depth=-1.0, speed=0.0, force=0.0, stopped_after=0.0)
