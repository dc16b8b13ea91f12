"""Wake-on-LAN: the magic packet, and a thread that listens for it."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable

from ir_sim_driver.errors import SettingsError

_SYNC = b"\xff" * 6
_REPEATS = 16
_PASSWORD_LENGTHS = (0, 4, 6)  # SecureOn
_MAC = re.compile(r"[0-9A-Fa-f]{2}([:-][0-9A-Fa-f]{2}){5}")


def mac_bytes(mac: str) -> bytes:
    """Return the six bytes of "02:00:00:c4:02:10". Raises SettingsError."""
    if not _MAC.fullmatch(mac):
        raise SettingsError(f"mac is {mac[:80]!r}: it must be six hex bytes like 02:00:00:c4:02:10")
    return bytes.fromhex(mac.replace(":", "").replace("-", ""))


def magic_packet(mac: str) -> bytes:
    """Return the 102 bytes that wake the controller with this MAC."""
    return _SYNC + mac_bytes(mac) * _REPEATS


def wakes(packet: bytes, mac: str) -> bool:
    """Whether the packet is a magic packet for this MAC: nothing before it, at most a password behind it."""
    magic = magic_packet(mac)
    return packet.startswith(magic) and len(packet) - len(magic) in _PASSWORD_LENGTHS


class WakeListener:
    """Listens on a UDP port and calls `wake` for every packet that is for us; `close` ends it.

    port 0 takes a free one; `port` tells which. Raises OSError when the port is taken.
    """

    def __init__(self, host: str, port: int, mac: str, wake: Callable[[], None]) -> None:
        mac_bytes(mac)
        self._mac, self._wake = mac, wake
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(0.2)
        self.port = int(self._socket.getsockname()[1])
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="wake_on_lan", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                packet = self._socket.recv(2048)
            except TimeoutError:
                continue
            except OSError:  # for example an ICMP error of an earlier answer: the socket stays usable
                continue
            if wakes(packet, self._mac):
                self._wake()
