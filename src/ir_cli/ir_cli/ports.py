"""Ports on this host: is one free, and which one is."""

from __future__ import annotations

import socket

UDP, TCP = socket.SOCK_DGRAM, socket.SOCK_STREAM


def is_free(port: int, kind: socket.SocketKind, host: str = "127.0.0.1") -> bool:
    """Whether a node could listen on the port now; kind: UDP or TCP."""
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind is TCP:  # what servers set: connections that have just ended do not count
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True


def free_port(kind: socket.SocketKind) -> int:
    """A port that is free now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
