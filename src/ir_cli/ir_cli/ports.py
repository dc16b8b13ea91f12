"""Free ports of this host, and claims on them."""

from __future__ import annotations

import random
import socket
import sys

UDP = socket.SOCK_DGRAM
TCP = socket.SOCK_STREAM
_GIVEN_AWAY = 32_768
"""From here on the system gives ports to whoever asks for any, as DDS does for every participant:
one that is free now may be taken before a node has started and listens on it.
"""
_DDS = 7_400
_DDS_DOMAIN = 250
_DDS_USED = 200
"""The ports of DDS: 250 of each domain, of which 95 participants on a host use the first 200."""
_OURS = [port for port in range(10_000, _GIVEN_AWAY) if (port - _DDS) % _DDS_DOMAIN >= _DDS_USED]


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


class PortClaims:
    """Ports that this process has chosen for nodes it starts: nobody else who asks gets them,
    though those nodes do not listen yet. They are free again when the block ends, or this process,
    however it ends.
    """

    def __init__(self) -> None:
        self._held: list[socket.socket] = []

    def __enter__(self) -> PortClaims:
        return self

    def __exit__(self, *exception: object) -> None:
        for held in self._held:
            held.close()
        self._held.clear()

    def take(self, port: int, kind: socket.SocketKind) -> bool:
        """Claim a port that nobody listens on and nobody else has claimed; whether that could be
        done.
        """
        if not is_free(port, kind):
            return False
        if not sys.platform.startswith("linux"):
            return True
        name = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            name.bind(f"\0ir_port.{kind.name}.{port}")
        except OSError:
            name.close()
            return False
        self._held.append(name)
        return True


def free_port(kind: socket.SocketKind) -> int:
    """A port that is free now, and that nobody gets by chance."""
    ports = random.sample(_OURS, len(_OURS))
    found = next((port for port in ports if is_free(port, kind)), None)
    if found is not None:
        return found
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
