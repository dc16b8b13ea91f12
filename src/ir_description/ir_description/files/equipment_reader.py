"""Reads one machine of a cell file with its zone, states and stations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ir_description.cell import (
    APPROACH_MAX,
    BODIES_MAX,
    CONFIGURATION_SEARCHES,
    STARTS_MAX,
    SWITCH_MAX,
    ZONE_KINDS,
    ZONE_MAX,
    AllowedContact,
    Equipment,
    EquipmentState,
    StateSwitch,
    Station,
    StationSearch,
    Zone,
    station_at,
    zone_around,
)
from ir_description.files.body_reader import POSE_KEYS, BodyReader, pose_in, read_pose
from ir_description.files.items import Item, Table
from ir_description.shapes import Body
from ir_msgs_py.arrays import FloatArray

_SEARCH_KEYS = ("configurations", "starts", "withdrawal")


def read_equipment(item: Item, bodies: BodyReader) -> tuple[Equipment, list[tuple[Item, Station]]]:
    """Return a machine and its stations, each with the item it came from."""
    table = item.table(
        ("name", "bodies"), ("pose", "zone", "states", "state", "switch", "enabled", "stations")
    )
    read = bodies.all(table["bodies"].list(0, BODIES_MAX))
    states = _states(table, bodies)
    machine = Equipment(
        name=table["name"].name(),
        pose=_pose(table),
        bodies=read,
        zone_in_equipment=_zone(table, read),
        states=states,
        state=_state(table, states),
        enabled=table["enabled"].boolean() if "enabled" in table else True,
        switch=_switch(table["switch"], states) if "switch" in table else None,
    )
    items = table["stations"].list(0, 10_000) if "stations" in table else []
    stations = [_station(station, machine) for station in items]
    machine = replace(machine, zone_in_equipment=_zone(table, read, stations))
    return machine, list(zip(items, stations, strict=True))


def _pose(table: Table) -> FloatArray:
    return read_pose(table["pose"]) if "pose" in table else np.eye(4)


def _zone(table: Table, bodies: tuple[Body, ...], stations: Iterable[Station] = ()) -> Zone:
    """A word is the kind around bodies and stations, a mapping may give the box."""
    item = table.get("zone")
    if item is None or item.is_scalar():
        kind = "OPEN" if item is None else item.choice(ZONE_KINDS)
        with (item or table.item).blamed():
            return zone_around(kind, bodies, stations)  # type: ignore[arg-type]
    zone = item.table(("kind",), ("size", *POSE_KEYS))
    kind = zone["kind"].choice(ZONE_KINDS)
    with item.blamed():
        if "size" not in zone:
            for key in POSE_KEYS:
                if key in zone:
                    zone[key].fail("belongs to a zone with a size")
            return zone_around(kind, bodies, stations)  # type: ignore[arg-type]
        size = zone["size"].numbers(3, 0.0, ZONE_MAX, "m", above=True)
        return Zone(kind, pose_in(zone), size)  # type: ignore[arg-type]


def _states(table: Table, bodies: BodyReader) -> tuple[EquipmentState, ...]:
    if "states" not in table:
        return ()
    return tuple(
        EquipmentState(name, bodies.named(body.name() for body in item.list(0, 1000)))
        for name, item in table["states"].pairs()
    )


def _state(table: Table, states: tuple[EquipmentState, ...]) -> str:
    if "state" in table:
        return table["state"].name()
    if states:
        table.item.fail(
            f"has states and must say its state, one of {', '.join(state.name for state in states)}"
        )
    return ""


def _switch(item: Item, states: tuple[EquipmentState, ...]) -> StateSwitch:
    table = item.table(("signal", "on", "off"), ("time",))
    known = tuple(state.name for state in states)
    if not known:
        item.fail("belongs to a machine with states")
    on = table["on"].choice(known)
    off = table["off"].choice(known)
    time = table["time"].number(0.0, SWITCH_MAX, "s") if "time" in table else 0.0
    with item.blamed():
        return StateSwitch(table["signal"].name(), on, off, time)


def _station(item: Item, machine: Equipment) -> Station:
    table = item.table(("name", "pose"), ("approach_distance", "allowed_contacts", *_SEARCH_KEYS))
    contacts = table["allowed_contacts"].list(0, 1000) if "allowed_contacts" in table else []
    approach = table.get("approach_distance")
    return station_at(
        machine,
        table["name"].name(),
        read_pose(table["pose"]),
        tuple(read_contact(contact) for contact in contacts),
        0.0 if approach is None else approach.number(0.0, APPROACH_MAX, "m"),
        _search(table),
    )


def _search(table: Table) -> StationSearch:
    default = StationSearch()
    configurations = (
        table["configurations"].choice(CONFIGURATION_SEARCHES)
        if "configurations" in table
        else default.configurations
    )
    if "starts" in table and configurations != "ccd":
        table["starts"].fail("belongs to a station with configurations: ccd")
    starts = table["starts"].integer(1, STARTS_MAX) if "starts" in table else default.starts
    withdrawal = table["withdrawal"].name() if "withdrawal" in table else ""
    return StationSearch(configurations, starts, withdrawal)


def read_contact(item: Item) -> AllowedContact:
    """A pair with the distance that it must keep at its station or along its path."""
    table = item.table(("between", "safety_distance"))
    first, second = table["between"].list(2, 2)
    with item.blamed():
        return AllowedContact(
            first.name(), second.name(), table["safety_distance"].number(0.0, 10.0, "m")
        )
