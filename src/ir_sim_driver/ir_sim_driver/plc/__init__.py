"""The PLC's side: its inputs with their rules, the watchdog, and the links that it can connect
by.
"""

from ir_sim_driver.plc.inputs import (
    OFF_BIT,
    OWN_BITS,
    POWER_BITS,
    Plc,
    PlcSettings,
    Watchdog,
    Written,
    giver_of,
)
from ir_sim_driver.plc.links import LINKS, SERVICE, TOPIC, WRITERS, usable_links
from ir_sim_driver.plc.port import STOP_BIT, Controller, Link, OpenLink, Readout
from ir_sim_driver.plc.wake_listener import WakeOnLan

__all__ = [
    "LINKS",
    "OFF_BIT",
    "OWN_BITS",
    "POWER_BITS",
    "SERVICE",
    "STOP_BIT",
    "TOPIC",
    "WRITERS",
    "Controller",
    "Link",
    "OpenLink",
    "Plc",
    "PlcSettings",
    "Readout",
    "WakeOnLan",
    "Watchdog",
    "Written",
    "giver_of",
    "usable_links",
]
