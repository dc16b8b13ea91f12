"""Wake-on-LAN: six bytes 0xFF, then the MAC address 16 times, by UDP."""

from __future__ import annotations

import socket

_SYNC = b"\xff" * 6
_REPEATS = 16


def magic_packet(mac: str) -> bytes:
    """Return the 102 bytes for a MAC address like "02:00:00:c4:02:10"."""
    return _SYNC + bytes.fromhex(mac.replace(":", "").replace("-", "")) * _REPEATS


def send_packet(packet: bytes, address: str, port: int) -> None:
    """Send it to an address, which may be a broadcast. Raises OSError where the network is not there."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        sender.sendto(packet, (address, port))
