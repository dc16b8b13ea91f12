"""Magic packets: what wakes, what doesn't, and a listener on a real socket."""

from __future__ import annotations

import socket
import threading
from types import SimpleNamespace
from typing import cast

import pytest

from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.wake_on_lan import magic_packet, send_packet, wakes
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError
from ir_sim_driver.node.node import open_links
from ir_sim_driver.plc import WakeOnLan
from ir_sim_driver.plc.modbus import ModbusTcp
from ir_sim_driver.plc.port import Controller
from ir_sim_driver.plc.wake_listener import WakeListener
from ir_values.errors import InvalidValueError

MAC = "02:00:00:c4:02:10"
PACKET = magic_packet(MAC)
NOBODY = cast(Controller, SimpleNamespace(wake=lambda: None))


def test_the_packet_has_102_bytes():
    assert len(PACKET) == 102
    assert PACKET[:6] == b"\xff" * 6


@pytest.mark.parametrize("password", [b"", b"1234", b"123456"])
def test_own_mac_wakes_with_and_without_a_password(password):
    assert wakes(PACKET + password, MAC)


@pytest.mark.parametrize(
    "packet",
    [
        b"",
        PACKET[:-1],
        PACKET[1:],
        b"\x00" + PACKET,
        PACKET + b"12345",
        PACKET * 10,
        magic_packet("02:00:00:c4:02:11"),
        b"\xff" * 102,
    ],
)
def test_wrong_truncated_and_oversized_packets_are_ignored(packet):
    assert not wakes(packet, MAC)


@pytest.mark.parametrize(
    "mac", ["", "02:00:00:c4:02", "02:00:00:c4:02:zz", "020000c40210", "02:00:00:c4:02:10:11"]
)
def test_what_is_no_mac_is_refused(mac):
    with pytest.raises(InvalidValueError, match="mac is"):
        magic_packet(mac)


def test_the_listener_hears_its_own_packet_among_others():
    woken = threading.Semaphore(0)
    listener = WakeListener("127.0.0.1", 0, MAC, woken.release)
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for packet in (b"", b"x" * 2000, magic_packet("02:00:00:c4:02:11"), PACKET):
                sender.sendto(packet, ("127.0.0.1", listener.port))
        assert woken.acquire(timeout=PATIENCE)
        assert not woken.acquire(blocking=False)
        with pytest.raises(OSError, match="in use"):
            WakeListener("127.0.0.1", listener.port, MAC, woken.release)
    finally:
        listener.close()


@pytest.mark.parametrize("host", ["a\x00b", "x" * 20_000, "\udcff"])
def test_a_host_that_is_no_name_is_a_sentence_of_each_link(host):
    links = (
        lambda: WakeOnLan(wake_host=host, wake_port=0).open(NOBODY),
        lambda: ModbusTcp(modbus=True, modbus_host=host, modbus_port=0).open(NOBODY),
    )
    for link in links:
        with pytest.raises(DriverError, match="can't be opened"):
            link()
    with pytest.raises(OSError, match=r"is no address|Errno"):
        send_packet(PACKET, host, 9)


def test_without_wake_on_lan_no_port_is_open_and_nothing_hibernates():
    """Closed by its setting; the driver says why it does not hibernate: nothing could wake it."""
    said = []
    driver = SimpleNamespace(plc=None, warn=said.append, forbid_hibernation=said.append)
    link = WakeOnLan(wake_port=0, wake_on_lan=False)
    assert open_links([link], cast(Driver, driver)) == {}
    assert said == ["nothing could wake the controller (wake_on_lan: false)"]
