"""The links between PLC and controller that there are: a new one is a module and a line here."""

from __future__ import annotations

from ir_sim_driver.plc.modbus_link import ModbusTcp
from ir_sim_driver.plc.port import Link
from ir_sim_driver.plc.wake_on_lan import WakeOnLan

LINKS: tuple[type[Link], ...] = (WakeOnLan, ModbusTcp)
TOPIC = "topic"
SERVICE = "service"
WRITERS = (TOPIC, *(link.name for link in LINKS if link.sets_inputs), SERVICE)
"""Who may set PLC inputs: the node's topic and service, and links."""
