"""The magic packet."""

from __future__ import annotations

from ir_program_runner.wake_on_lan import magic_packet


def test_the_magic_packet_is_six_ff_and_the_mac_sixteen_times():
    packet = magic_packet("02:00:00:C4:02:10")
    assert len(packet) == 102
    assert packet == b"\xff" * 6 + bytes([2, 0, 0, 0xC4, 2, 0x10]) * 16
