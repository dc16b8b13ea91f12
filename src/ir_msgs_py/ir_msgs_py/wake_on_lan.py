"""Wake-on-LAN: six bytes 0xFF, then the MAC address 16 times, by UDP; a password may follow."""

from __future__ import annotations

import re
import socket

from ir_values.errors import InvalidValueError

CONTROLLER_MAC = "02:00:00:c4:02:10"
"""MAC address of the simulated controller, where nobody says another: driver and program runner
have one.
"""
WAKE_PORT = 9009
"""UDP port that it listens on; the real one, 9, needs rights."""

_SYNC = b"\xff" * 6
_REPEATS = 16
_PASSWORD_LENGTHS = (0, 4, 6)  # SecureOn
_MAC = re.compile(r"[0-9A-Fa-f]{2}([:-][0-9A-Fa-f]{2}){5}")


def mac_bytes(mac: str) -> bytes:
    """Return the six bytes of "02:00:00:c4:02:10". Raises InvalidValueError."""
    if not _MAC.fullmatch(mac):
        raise InvalidValueError(
            f"mac is {mac[:80]!r}: it must be six hex bytes like 02:00:00:c4:02:10"
        )
    return bytes.fromhex(mac.replace(":", "").replace("-", ""))


def magic_packet(mac: str) -> bytes:
    """Return the 102 bytes that wake the controller with this MAC. Raises InvalidValueError."""
    return _SYNC + mac_bytes(mac) * _REPEATS


def wakes(packet: bytes, mac: str) -> bool:
    """Whether the packet is a magic packet for this MAC: nothing before it, at most a password
    behind it.
    """
    magic = magic_packet(mac)
    return packet.startswith(magic) and len(packet) - len(magic) in _PASSWORD_LENGTHS


def send_packet(packet: bytes, address: str, port: int) -> None:
    """Send it to an address, which may be a broadcast. Raises OSError where the network is not
    there.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        try:
            sender.sendto(packet, (address, port))
        except (ValueError, TypeError) as error:
            raise OSError(f"{address[:80]!a} is no address: {error}") from error
