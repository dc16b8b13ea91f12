"""The rail of a cell file: a linear unit under the robot, read and written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from ir_description.robot import Rail
from ir_description.shapes import Capsule
from ir_values.yaml_items import Item

_NUMBERS = {
    "home": (-100.0, 100.0, "m"),
    "jerk": (0.0, 1e4, "m/s^3"),
    "force": (0.0, 1e6, "N"),
    "power": (0.0, 1e6, "W"),
    "reflected_mass": (0.0, 1e5, "kg"),
    "friction_coulomb": (0.0, 1e5, "N"),
    "friction_viscous": (0.0, 1e5, "N s/m"),
    "gear_ratio": (0.0, 1e5, "rad/m"),
}
_NEEDED = {
    "velocity": (0.0, 20.0, "m/s"),
    "acceleration": (0.0, 50.0, "m/s^2"),
    "carriage_mass": (0.0, 1e5, "kg"),
}
_CAPSULES_MAX = 20


def read_rail(item: Item) -> Rail:
    """Return the rail of a mapping."""
    table = item.table(("axis", "travel", *_NEEDED), ("name", "title", "capsules", *_NUMBERS))
    low, high = table["travel"].numbers(2, -100.0, 100.0, "m")
    needed = {key: table[key].number(*_NEEDED[key], above=True) for key in _NEEDED}
    others = {key: table[key].number(*bounds) for key, bounds in _NUMBERS.items() if key in table}
    capsules = table["capsules"].list(0, _CAPSULES_MAX) if "capsules" in table else []
    with item.blamed():
        return Rail(
            axis=table["axis"].numbers(3, -1.0, 1.0),
            low=float(low),
            high=float(high),
            name=table["name"].name() if "name" in table else "E1",
            title=table["title"].text(64) if "title" in table else "",
            capsules=tuple(_capsule(each) for each in capsules),
            **needed,
            **others,
        )


def _capsule(item: Item) -> Capsule:
    table = item.table(("name", "p0", "p1", "radius"))
    return Capsule(
        name=table["name"].name(),
        link=1,
        p0=table["p0"].numbers(3, -100, 100, "m"),
        p1=table["p1"].numbers(3, -100, 100, "m"),
        radius=table["radius"].number(0, 100, "m", above=True),
    )


def rail_lines(
    rail: Rail, number: Callable[[float], str], quoted: Callable[[str], str]
) -> Iterator[str]:
    """The mapping of a rail, line by line; `read_rail` reads it back bit for bit."""

    def row(values: Iterable[float]) -> str:
        return f"[{', '.join(number(value) for value in values)}]"

    yield f"name: {rail.name}"
    if rail.title:
        yield f"title: {quoted(rail.title)}"
    yield f"axis: {row(rail.axis)}"
    yield f"travel: {row((rail.low, rail.high))}"
    for key in (*_NEEDED, *_NUMBERS):
        value = getattr(rail, key)
        if value != 0.0:
            yield f"{key}: {number(value)}"
    if rail.capsules:
        yield "capsules:"
    for capsule in rail.capsules:
        ends = f"p0: {row(capsule.p0)}, p1: {row(capsule.p1)}"
        yield f"  - {{name: {capsule.name}, {ends}, radius: {number(capsule.radius)}}}"
