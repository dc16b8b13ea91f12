"""Modbus TCP as a link: its settings, and the server opened where it is wanted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ir_msgs_py.settings import check_settings, setting
from ir_sim_driver.errors import LinkError
from ir_sim_driver.plc.modbus import Limits, ModbusServer
from ir_sim_driver.plc.modbus_map import MODBUS
from ir_sim_driver.plc.modbus_tables import ControllerTables
from ir_sim_driver.plc.port import Controller, OpenLink


@dataclass(frozen=True)
class ModbusTcp:
    """A PLC can connect by Modbus TCP."""

    name: ClassVar[str] = MODBUS
    sets_inputs: ClassVar[bool] = True

    modbus: bool = setting(False, "Whether a PLC can connect by Modbus TCP.", read_only=True)
    modbus_host: str = setting("127.0.0.1", "Address of the Modbus server.", read_only=True)
    modbus_port: int = setting(
        5020,
        "TCP port of the Modbus server; 0 takes a free one. The usual one is 502.",
        minimum=0,
        maximum=65535,
        read_only=True,
    )
    modbus_watchdog: float = setting(
        2.0,
        "Without a heartbeat for this long the link to the PLC counts as lost, if it has ever "
        "sent one.",
        unit="s",
        minimum=0.1,
        maximum=3600.0,
        read_only=True,
    )

    modbus_connections: int = setting(
        16,
        "Modbus clients at once; one more takes the place of the one that has been silent for "
        "longest.",
        minimum=1,
        maximum=1000,
        read_only=True,
    )
    modbus_idle: float = setting(
        60.0,
        "A Modbus client that is silent for this long is disconnected.",
        unit="s",
        minimum=0.1,
        maximum=86400.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def wanted(self) -> bool:
        """Whether the settings ask for it."""
        return self.modbus

    def open(self, controller: Controller) -> OpenLink:
        """Serve the controller. Raises LinkError when the port is taken."""
        tables = ControllerTables(controller, self.modbus_watchdog)
        limits = Limits(self.modbus_connections, self.modbus_idle)
        try:
            return ModbusServer(self.modbus_host, self.modbus_port, tables, limits)
        except OSError as error:
            raise LinkError(f"no Modbus: {error}") from error
