"""Contacts and states of machines, to and from messages."""

from __future__ import annotations

from collections.abc import Sequence

from ir_msgs.msg import Contact as ContactMsg
from ir_msgs.msg import MachineStates as MachineStatesMsg
from ir_msgs_py.contact import Contact, MachineState
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.ros.convert_basics import time_from_msg, time_to_msg
from ir_msgs_py.ros.convert_report import distance_pair_from_msg, distance_pair_to_msg

_NUMBERS = ("depth", "speed", "force", "stopped_after", "path_time")


def contact_to_msg(contact: Contact) -> ContactMsg:
    """A contact."""
    message = ContactMsg(
        pair=distance_pair_to_msg(contact.pair),
        trajectory_id=contact.trajectory_id,
        **{name: float(getattr(contact, name)) for name in _NUMBERS},
    )
    message.header.stamp = time_to_msg(contact.stamp_ns)
    return message


def contact_from_msg(msg: ContactMsg) -> Contact:
    """A contact. Raises InvalidValueError without a pair."""
    pair = distance_pair_from_msg(msg.pair)
    if pair is None:
        raise InvalidValueError("the contact has no pair")
    return Contact(
        pair=pair,
        stamp_ns=time_from_msg(msg.header.stamp),
        trajectory_id=msg.trajectory_id,
        **{name: getattr(msg, name) for name in _NUMBERS},
    )


def machine_states_to_msg(states: Sequence[MachineState]) -> MachineStatesMsg:
    """The states of all machines."""
    return MachineStatesMsg(
        equipment=[each.equipment for each in states],
        states=[each.state for each in states],
        next=[each.next for each in states],
        remaining=[each.remaining for each in states],
    )


def machine_states_from_msg(msg: MachineStatesMsg) -> tuple[MachineState, ...]:
    """The states of all machines. Raises InvalidValueError for lists of different lengths."""
    rows = msg.equipment, msg.states, msg.next, msg.remaining
    if len({len(row) for row in rows}) != 1:
        lengths = ", ".join(str(len(row)) for row in rows)
        raise InvalidValueError(f"equipment, states, next and remaining have {lengths} entries")
    return tuple(MachineState(*row) for row in zip(*rows, strict=True))
