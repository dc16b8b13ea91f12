"""Opens the links that the settings ask for; a controller that nothing can wake does not
hibernate.
"""

from __future__ import annotations

from collections.abc import Iterable

from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import LinkError
from ir_sim_driver.plc import Link, OpenLink, WakeOnLan


def open_links(links: Iterable[Link], driver: Driver) -> dict[str, OpenLink]:
    """Links by name; one that can't be opened is a warning, as a port that another driver has."""
    opened: dict[str, OpenLink] = {}
    for link in links:
        if not link.wanted:
            continue
        try:
            opened[link.name] = link.open(driver.plc)
        except LinkError as error:
            driver.warn(str(error))
            if link.name == WakeOnLan.name:
                driver.forbid_hibernation(f"nothing could wake the controller ({error})")
    return opened
