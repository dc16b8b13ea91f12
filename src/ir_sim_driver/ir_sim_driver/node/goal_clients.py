"""Who has sent a goal, and whether that process is still there.

A goal names no client. Its request carries the identity of the endpoint that wrote it, which rclpy
keeps for itself; its first bytes are those of the process's participant, as in the identity of the
subscription that every action client has to the feedback.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Sequence
from typing import Any

_PARTICIPANT = 12  # bytes of an endpoint's identity that all endpoints of a participant share
_VALUE = 2 * ctypes.sizeof(ctypes.c_void_p)  # where an object of pybind11 points to what it wraps


class _RequestId(ctypes.Structure):
    """rmw_request_id_t."""

    _fields_ = (("writer", ctypes.c_uint8 * 16), ("sequence_number", ctypes.c_int64))


def participant_of(request_id: Any) -> bytes:
    """Participant of who wrote a request; b"" where it is not known."""
    value = ctypes.c_void_p.from_address(id(request_id) + _VALUE).value
    if not value:
        return b""
    found = _RequestId.from_address(value)
    same = found.sequence_number == request_id.sequence_number
    return bytes(found.writer)[:_PARTICIPANT] if same else b""


class ClientWatch:
    """Whether the client of a goal has been gone for `timeout` [s]; 0: never.

    participant: of who sent it, b"" where nobody knows: any subscriber to the feedback counts then,
    and also before the participant's own has been discovered.
    """

    def __init__(self, timeout: float, participant: bytes = b"") -> None:
        self._timeout = timeout
        self._participant = participant
        self._known = False
        self._seen = time.monotonic()

    def gone(self, subscribers: Sequence[bytes]) -> bool:
        """Look at the identities of those who subscribe to the feedback now."""
        now = time.monotonic()
        own = bool(self._participant) and any(
            each.startswith(self._participant) for each in subscribers
        )
        self._known = self._known or own
        if own or (subscribers and not self._known):
            self._seen = now
        return 0.0 < self._timeout < now - self._seen
