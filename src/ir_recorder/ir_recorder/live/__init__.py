"""A live view: the page of the report fed by the running nodes, on this machine's loopback only."""

from ir_recorder.live.server import LiveServer
from ir_recorder.live.stream import Stream

__all__ = ["LiveServer", "Stream"]
