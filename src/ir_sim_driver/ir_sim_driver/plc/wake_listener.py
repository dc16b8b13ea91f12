"""Wake-on-LAN as a link: a thread that listens for the magic packet."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.wake_on_lan import CONTROLLER_MAC, WAKE_PORT, mac_bytes, wakes
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc.port import Controller, OpenLink
from ir_values.settings import check_settings, setting

_PACKET_MAX = 2048  # bytes; longer datagrams are cut, and then wake nobody
_POLL = 0.2  # s between two looks at whether the listener was closed


@dataclass(frozen=True)
class WakeOnLan:
    """A packet for the controller's MAC address wakes it."""

    name: ClassVar[str] = "wake_on_lan"
    sets_inputs: ClassVar[bool] = False

    wake_on_lan: bool = setting(
        True,
        "Whether a Wake-on-LAN packet wakes the controller; it does not hibernate without.",
        read_only=True,
    )
    mac: str = setting(
        CONTROLLER_MAC, "MAC address that a Wake-on-LAN packet has to carry.", read_only=True
    )
    wake_host: str = setting(
        "127.0.0.1", "Address the Wake-on-LAN listener is bound to.", read_only=True
    )
    wake_port: int = setting(
        WAKE_PORT,
        "UDP port of the Wake-on-LAN listener; 0 takes a free one. The real one is 9.",
        minimum=0,
        maximum=65535,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)
        mac_bytes(self.mac)

    @property
    def wanted(self) -> bool:
        """Whether the settings ask for it: nothing else ends hibernation."""
        return self.wake_on_lan

    def open(self, controller: Controller) -> OpenLink:
        """Listen. Raises DriverError when the port is taken."""
        try:
            return WakeListener(self.wake_host, self.wake_port, self.mac, controller.wake)
        except OSError as error:
            where = f"UDP {self.wake_host}:{self.wake_port}"
            raise DriverError(f"no Wake-on-LAN: {where} can't be opened ({error})") from error


class WakeListener:
    """Listens on a UDP port and calls `wake` for every packet that is for us; `close` ends it.

    port 0 takes a free one; `port` says which. Raises OSError when the port is taken or the host is
    no name.
    """

    def __init__(self, host: str, port: int, mac: str, wake: Callable[[], None]) -> None:
        mac_bytes(mac)
        self._mac = mac
        self._wake = wake
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, ValueError, TypeError) as error:  # the last two: a host that is no name
            self._socket.close()
            raise OSError(str(error)) from error
        self._socket.settimeout(_POLL)
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
                packet = self._socket.recv(_PACKET_MAX)
            except TimeoutError:
                continue
            except (
                OSError
            ):  # for example an ICMP error of an earlier answer: the socket stays usable
                continue
            if wakes(packet, self._mac):
                self._wake()
