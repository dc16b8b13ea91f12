from __future__ import annotations

import pytest

from ir_msgs_py.wake_on_lan import mac_bytes, magic_packet, wakes
from ir_values.errors import InvalidValueError

MAC = "02:00:00:C4:02:10"


def test_the_magic_packet_is_six_ff_and_the_mac_sixteen_times() -> None:
    packet = magic_packet(MAC)
    assert len(packet) == 102
    assert packet == b"\xff" * 6 + bytes([2, 0, 0, 0xC4, 2, 0x10]) * 16


@pytest.mark.parametrize("password", [b"", b"four", b"sixsix"])
def test_a_packet_wakes_the_controller_it_is_for_with_or_without_a_password(
    password: bytes,
) -> None:
    assert wakes(magic_packet("02-00-00-c4-02-10") + password, MAC)
    assert not wakes(magic_packet(MAC) + password, "02:00:00:c4:02:11")


@pytest.mark.parametrize(
    "packet", [b"", magic_packet(MAC)[:-1], magic_packet(MAC) + b"x", b"x" + magic_packet(MAC)]
)
def test_what_is_not_the_packet_wakes_nobody(packet: bytes) -> None:
    assert not wakes(packet, MAC)


@pytest.mark.parametrize("mac", ["", "02:00:00:c4:02", "02:00:00:c4:02:1g", "0200.00c4.0210"])
def test_a_mac_is_six_hex_bytes(mac: str) -> None:
    with pytest.raises(InvalidValueError, match="must be six hex bytes"):
        mac_bytes(mac)
