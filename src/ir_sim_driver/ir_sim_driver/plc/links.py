"""Links that there are: a new field bus is a module and a line here, or an entry point of an
installed package.
"""

from __future__ import annotations

import warnings
from dataclasses import is_dataclass
from typing import Any, cast

from ir_sim_driver.plc.modbus import ModbusTcp
from ir_sim_driver.plc.port import Link
from ir_sim_driver.plc.wake_listener import WakeOnLan
from ir_values.errors import InvalidValueError, shown
from ir_values.extensions import Registry
from ir_values.settings import describe


def _made_link(name: str, value: Any) -> type[Link]:
    """The link of an entry point. Raises InvalidValueError; nobody asks for a link by installing
    its package.
    """
    if not (isinstance(value, type) and is_dataclass(value) and hasattr(value, "open")):
        raise InvalidValueError("must be a frozen dataclass with a method open")
    link = cast(type[Link], value)
    if link.name != name:
        raise InvalidValueError(f"has the name {shown(link.name)}: both must be the same")
    describe(link)
    if link().wanted:
        raise InvalidValueError("opens by its defaults: a setting must ask for it")
    return link


LINKS: Registry[type[Link]] = Registry(
    "ir_sim_driver.links", {link.name: link for link in (WakeOnLan, ModbusTcp)}, _made_link
)
TOPIC = "topic"
SERVICE = "service"
WRITERS = (
    TOPIC,
    *(name for name in LINKS if name not in LINKS.own or LINKS.own[name].sets_inputs),
    SERVICE,
)
"""Who may set PLC inputs: the node's topic and service, and links."""


def usable_links() -> tuple[type[Link], ...]:
    """All links; warns (RuntimeWarning) of an installed package that can't be used."""
    refused = {name: LINKS.why_not(name) for name in LINKS}
    for why in filter(None, refused.values()):
        warnings.warn(why, RuntimeWarning, stacklevel=2)
    return tuple(LINKS[name] for name in LINKS if not refused[name])
