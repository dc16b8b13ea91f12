"""Reads the tool and the parts of a cell file."""

from __future__ import annotations

import numpy as np

from ir_description.arrays import solid_box_inertia
from ir_description.cell import NameRegister, Part
from ir_description.files.body_reader import FAR, BodyReader, read_pose
from ir_description.files.items import Item, Table
from ir_description.files.robot_file import inertia_matrix
from ir_description.robot import MASS_MAX, Load
from ir_description.shapes import Capsule
from ir_msgs_py.arrays import FloatArray

_MASS_KEYS = ("inertia", "inertia_box", "capsules")


def read_tool(item: Item, link: int, shapes: NameRegister) -> Load:
    """Return the tool; its capsules stand on `link`."""
    table = item.table(("name", "mass", "com"), (*_MASS_KEYS, "watts_always", "watts_drive_bus"))
    mass = table["mass"].number(0.0, MASS_MAX, "kg", above=True)
    return Load(
        name=table["name"].name(),
        kind="tool",
        mass=mass,
        com=table["com"].numbers(3, -FAR, FAR, "m"),
        inertia=_inertia(table, mass),
        capsules=_capsules(table, link, shapes),
        watts_always=_watts(table, "watts_always"),
        watts_drive_bus=_watts(table, "watts_drive_bus"),
    )


def read_part(item: Item, link: int, shapes: NameRegister, bodies: BodyReader) -> Part:
    """Return a part: its load in its own frame, its bodies, its grasp and where it lies."""
    table = item.table(("name", "mass", "com"), (*_MASS_KEYS, "bodies", "grasp", "station"))
    mass = table["mass"].number(0.0, MASS_MAX, "kg", above=True)
    load = Load(
        name=table["name"].name(),
        kind="part",
        mass=mass,
        com=table["com"].numbers(3, -FAR, FAR, "m"),
        inertia=_inertia(table, mass),
        capsules=_capsules(table, link, shapes),
    )
    return Part(
        load=load,
        bodies=bodies.all(table["bodies"].list(0, 100)) if "bodies" in table else (),
        grasp=read_pose(table["grasp"]) if "grasp" in table else np.eye(4),
        station=table["station"].name() if "station" in table else "",
    )


def _inertia(table: Table, mass: float) -> FloatArray:
    key = table.one_of("inertia", "inertia_box")
    item = table[key]
    with item.blamed():
        if key == "inertia_box":
            return solid_box_inertia(mass, item.numbers(3, 0.0, 100.0, "m", above=True))
        return inertia_matrix(item.numbers(6, -1e6, 1e6, "kg m^2"))


def _capsules(table: Table, link: int, shapes: NameRegister) -> tuple[Capsule, ...]:
    return (
        tuple(_capsule(item, link, shapes) for item in table["capsules"].list(0, 200))
        if "capsules" in table
        else ()
    )


def _capsule(item: Item, link: int, shapes: NameRegister) -> Capsule:
    table = item.table(("name", "p0", "p1", "radius"))
    name = table["name"].name()
    with table["name"].blamed():
        shapes.add(name)
    return Capsule(
        name=name,
        link=link,
        p0=table["p0"].numbers(3, -FAR, FAR, "m"),
        p1=table["p1"].numbers(3, -FAR, FAR, "m"),
        radius=table["radius"].number(0.0, 100.0, "m", above=True),
    )


def _watts(table: Table, key: str) -> float:
    return table[key].number(0.0, 1e5, "W") if key in table else 0.0
