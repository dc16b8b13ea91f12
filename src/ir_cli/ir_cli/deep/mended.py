"""What to write into a cell file so that a station can be entered and left: contacts, a zone, an
approach distance.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ir_description import AllowedContact, Cell, Equipment, Station
from ir_msgs_py.arrays import FloatArray

from .lines import Line, lines_of
from .stations import MARGIN, Visit

DISTANCES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6)  # m of approach that are tried
_PAD = 2e-3  # m that a suggested zone is larger than it must be
_GRID = 1e-3  # m, to which its faces are rounded
_NOISE = 1e-6  # of it: processors give places that differ in their last bits


@dataclass(frozen=True)
class Suggestion:
    """What is wrong with a station, a machine or the program, and lines to paste there ("": none).

    A warning may be meant, as where a machine is left by a withdrawal.
    """

    severity: Literal["error", "warning"]
    subject: str
    sentence: str
    yaml: str = ""


@dataclass(frozen=True, eq=False)
class Exit:
    """The lines of one configuration in every situation at a station, with one approach distance
    [m].
    """

    approach: float
    lines: tuple[Line, ...]

    @property
    def free(self) -> bool:
        """Whether the station can be entered and left as the cell is."""
        return all(line.free for line in self.lines)

    @property
    def mendable(self) -> bool:
        """Whether contacts and a zone make it free."""
        return all(line.mendable for line in self.lines)

    @property
    def contacts(self) -> tuple[AllowedContact, ...]:
        """Those that are missing."""
        return tuple(contact for line in self.lines for contact in line.contacts)

    @property
    def depth(self) -> float:
        """The least distance [m] of a pair that is in the path, inf: none is."""
        return min((near.distance for line in self.lines for near in line.near), default=np.inf)

    @property
    def sentence(self) -> str:
        """What is in the path, in words."""
        found = dict.fromkeys(near.sentence for line in self.lines for near in line.near[:3])
        found.update(
            dict.fromkeys(line.sentence for line in self.lines if not line.near and not line.whole)
        )
        return ", ".join(found)


def exits(visits: Sequence[Visit], approach: float) -> list[Exit]:
    """One for each configuration that reaches the station of these visits."""
    found = [lines_of(visit, approach) for visit in visits]
    return [Exit(approach, lines) for lines in zip(*found, strict=True)]


def best_exit(visits: Sequence[Visit]) -> Exit | None:
    """What is nearest to the given approach: a free line, else one that contacts or a zone make
    free; None where there is neither.
    """
    given = visits[0].station.approach_distance
    tried = sorted({given, *DISTANCES} - {0.0}, key=lambda each: (each != given, abs(each - given)))
    every = [each for approach in tried for each in exits(visits, approach)]
    free = next((each for each in every if each.free), None)
    if free is not None:
        return free
    mendable = [each for each in every if each.mendable]
    return min(
        mendable, key=lambda each: (abs(each.approach - given), len(each.contacts)), default=None
    )


def with_contacts(station: Station, contacts: Iterable[AllowedContact]) -> Station:
    """The station with these besides its own, the nearer where a pair is named twice."""
    nearest: dict[frozenset[str], AllowedContact] = {}
    for contact in (*station.allowed_contacts, *contacts):
        pair = frozenset((contact.body_a, contact.body_b))
        known = nearest.setdefault(pair, contact)
        nearest[pair] = min(known, contact, key=lambda each: each.safety_distance)
    return replace(station, allowed_contacts=tuple(nearest.values()))


def with_zone(machine: Equipment, places: FloatArray) -> Equipment:
    """The machine with a zone that holds places (P, 3) in the world [m] as well."""
    zone = machine.zone_in_equipment
    in_machine = (places - machine.pose[:3, 3]) @ machine.pose[:3, :3]
    local = (in_machine - zone.pose[:3, 3]) @ zone.pose[:3, :3]
    half = 0.5 * zone.size
    low = np.minimum(-half, np.floor((local.min(axis=0) - _PAD) / _GRID + _NOISE) * _GRID)
    high = np.maximum(half, np.ceil((local.max(axis=0) + _PAD) / _GRID - _NOISE) * _GRID)
    pose = zone.pose.copy()
    pose[:3, 3] += zone.pose[:3, :3] @ (0.5 * (low + high))
    return replace(
        machine, zone_in_equipment=replace(zone, pose=pose, size=np.round(high - low, 6))
    )


def zone_lacks(machine: Equipment, places: FloatArray) -> bool:
    """Whether one of places (P, 3) is farther from the zone than contacts hold."""
    zone = machine.zone
    beyond = np.maximum(
        np.abs((places - zone.pose[:3, 3]) @ zone.pose[:3, :3]) - 0.5 * zone.size, 0.0
    )
    return bool((np.linalg.norm(beyond, axis=1) > MARGIN).any())


def contacts_yaml(station: Station) -> Iterator[str]:
    """Lines to paste into a station."""
    yield "allowed_contacts:"
    for c in station.allowed_contacts:
        yield f"  - {{between: [{c.body_a}, {c.body_b}], safety_distance: {c.safety_distance:g}}}"


def zone_yaml(machine: Equipment) -> str:
    """A line to paste into a machine."""
    zone = machine.zone_in_equipment
    turned = "" if np.array_equal(zone.pose[:3, :3], np.eye(3)) else _rotation(zone.pose[:3, :3])
    box = f"size: [{_row(zone.size)}], xyz: [{_row(zone.pose[:3, 3])}]"
    return f"zone: {{kind: {zone.kind}, {box}{turned}}}"


def _rotation(rotation: FloatArray) -> str:
    rows = ", ".join(f"[{', '.join(repr(float(value)) for value in row)}]" for row in rotation)
    return f", rotation: [{rows}]"


def _row(values: FloatArray) -> str:
    return ", ".join(f"{value + 0.0:g}" for value in np.round(values, 6))


def changed_station(cell: Cell, station: Station) -> Cell:
    """The cell with a station in place of the one of that name."""
    return replace(
        cell,
        stations=tuple(station if each.name == station.name else each for each in cell.stations),
    )


def changed_machine(cell: Cell, machine: Equipment) -> Cell:
    """The same for a machine."""
    return replace(
        cell,
        equipment=tuple(machine if each.name == machine.name else each for each in cell.equipment),
    )
