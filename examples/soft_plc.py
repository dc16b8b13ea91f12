"""A soft PLC that runs a shift over Modbus TCP: work, a pause, hibernation, wake-up.

Start the driver first, with short transitions so that the example takes a minute:

    ir_sim_driver --ros-args -p modbus:=true -p transitions.hibernation_enter:=2.0
        -p transitions.hibernation_minimum_stay:=2.0 -p transitions.hibernation_leave:=3.0     (one
        line)

then: python examples/soft_plc.py [--host 127.0.0.1] [--port 5020] [--mac 02:00:00:c4:02:10]
    [--wake-port 9009]
"""

from __future__ import annotations

import argparse
import socket
import time

from pymodbus.client import ModbusTcpClient

from ir_msgs_py.wake_on_lan import magic_packet
from ir_sim_driver.plc.modbus import COILS, HEARTBEAT, INPUT_REGISTERS, PAUSE

MODES = {
    0: "stand on motors",
    1: "moving",
    2: "stand on brakes",
    3: "bus power off",
    4: "hibernation",
}
POLL = 0.2  # s
OFF_THE_NETWORK = 4  # Modbus exception of a controller in hibernation


class SoftPlc:
    """The controller's bits and registers, by name."""

    def __init__(self, host: str, port: int) -> None:
        self._client = ModbusTcpClient(host, port=port)
        if not self._client.connect():
            raise SystemExit(
                f"no answer from {host}:{port}; is the driver started with modbus:=true?"
            )

    def set(self, bit: str, level: bool) -> None:
        """Set one coil."""
        self._client.write_coil(COILS.index(bit), level)

    def pause(self, seconds: int) -> None:
        """Announce a pause; 0 ends it."""
        self._client.write_register(PAUSE, seconds)

    def mode(self) -> str:
        """Mode and power as text; also the heartbeat."""
        self._client.write_coil(HEARTBEAT, True)
        answer = self._client.read_input_registers(0, count=INPUT_REGISTERS)
        if answer.isError():
            return "off the network" if answer.exception_code == OFF_THE_NETWORK else "no answer"
        watts = (answer.registers[3] << 16) + answer.registers[4]
        return f"{MODES.get(answer.registers[0], 'changing mode')}, {watts} W"

    def watch(self, seconds: float, until: str = "") -> None:
        """Print the mode when it changes, for so long or until it begins with a text."""
        shown = ""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            now = self.mode()
            if now.partition(",")[0] != shown:
                shown = now.partition(",")[0]
                print(f"{time.strftime('%H:%M:%S')}  {now}")
            if until and now.startswith(until):
                return
            time.sleep(POLL)


def main() -> None:
    """Run the shift."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=5020)
    parser.add_argument("--mac", default="02:00:00:c4:02:10")
    parser.add_argument("--wake-port", type=int, default=9009)
    options = parser.parse_args()
    plc = SoftPlc(options.host, options.port)
    print("work")
    plc.watch(3.0)
    print("a short pause: the controller chooses the mode itself")
    plc.pause(10)
    plc.watch(5.0)
    plc.pause(0)
    plc.watch(10.0, until="stand on motors")
    print("end of the shift: hibernate")
    plc.set("hib", True)
    plc.watch(600.0, until="off the network")
    print("next shift: wake by Wake-on-LAN")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        end = time.monotonic() + 600.0
        while plc.mode() == "off the network" and time.monotonic() < end:
            sender.sendto(magic_packet(options.mac), (options.host, options.wake_port))
            time.sleep(1.0)
    plc.set("hib", False)
    plc.watch(10.0, until="stand on motors")


if __name__ == "__main__":
    main()
