"""Changes to a cell file that its stations lack: contacts, zones and approach distances.

`ir check --deep` looks at every station in every situation of the program: is there a
configuration with a free line in and out, or which contacts, zone and approach distance would make
one? Then the cell with these changes is planned; failures that remain are reported too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ir_cli.planning import CEILING, clock
from ir_cli.station_access import AccessLine, StationVisit, lines_of, visits
from ir_description import Cell, Equipment, Station, cell_to_yaml
from ir_description.cell import AllowedContact
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE, PlanOptions
from ir_planner import Planner
from ir_values.arrays import FloatArray

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
class SuggestedExit:
    """The lines of one configuration in every situation at a station, with one approach distance
    [m].
    """

    approach: float
    lines: tuple[AccessLine, ...]

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


def exits(visits: Sequence[StationVisit], approach: float) -> list[SuggestedExit]:
    """One for each configuration that reaches the station of these visits."""
    found = [lines_of(visit, approach) for visit in visits]
    return [SuggestedExit(approach, lines) for lines in zip(*found, strict=True)]


def best_exit(visits: Sequence[StationVisit]) -> SuggestedExit | None:
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
    return bool((np.linalg.norm(beyond, axis=1) > DEFAULT_SAFETY_DISTANCE).any())


def contacts_yaml(station: Station) -> Iterator[str]:
    """Lines to paste into a station."""
    yield "allowed_contacts:"
    for c in station.allowed_contacts:
        yield f"  - {{between: [{c.body_a}, {c.body_b}], safety_distance: {c.safety_distance:g}}}"


def zone_yaml(machine: Equipment) -> str:
    """A line to paste into a machine."""
    zone = machine.zone_in_equipment
    turned = "" if np.array_equal(zone.pose[:3, :3], np.eye(3)) else _rotation(zone.pose[:3, :3])
    box = f"size: [{_numbers_text(zone.size)}], xyz: [{_numbers_text(zone.pose[:3, 3])}]"
    return f"zone: {{kind: {zone.kind}, {box}{turned}}}"


def _rotation(rotation: FloatArray) -> str:
    rows = ", ".join(f"[{', '.join(repr(float(value)) for value in row)}]" for row in rotation)
    return f", rotation: [{rows}]"


def _numbers_text(values: FloatArray) -> str:
    """Numbers of a cell file, to six digits after the point."""
    return ", ".join(f"{value + 0.0:g}" for value in np.round(values, 6))


def changed_station(cell: Cell, station: Station) -> Cell:
    """The cell with a station in place of the one of that name."""
    return replace(
        cell,
        stations=tuple(station if each.name == station.name else each for each in cell.stations),
    )


def changed_machine(cell: Cell, machine: Equipment) -> Cell:
    """The cell with a machine changed."""
    return replace(
        cell,
        equipment=tuple(machine if each.name == machine.name else each for each in cell.equipment),
    )


def suggestions_of(cell: Cell) -> Iterator[Suggestion]:
    """What to change at stations and machines, then what fails when that has been done."""
    mended, suggestions = mended_cell(cell)
    yield from suggestions
    yield from _planner_suggestions(mended)


def mended_cell(cell: Cell) -> tuple[Cell, list[Suggestion]]:
    """The cell with the contacts, zones and approach distances that its stations lack, and what
    these are.
    """
    suggestions = list[Suggestion]()
    situations: dict[str, list[StationVisit]] = {}
    for visit in visits(cell):
        situations.setdefault(visit.station.name, []).append(visit)
    mended = cell
    for name, found in situations.items():
        mended, lacking = _station(mended, name, found)
        suggestions += lacking
    for machine in mended.equipment:
        if machine is not cell.machine(machine.name):
            sentence = (
                "allowed contacts hold in its zone only, and the tcp is outside while "
                "they are needed"
            )
            suggestions.append(Suggestion("error", machine.name, sentence, zone_yaml(machine)))
    return mended, suggestions


def _kept_by_none(best: str) -> str:
    """Sentence where no configuration keeps the safety distance; best: what is said of the best."""
    kept = 1e3 * DEFAULT_SAFETY_DISTANCE
    return f"no configuration keeps {kept:g} mm; in the best of them {best}"


def _station(cell: Cell, name: str, found: Sequence[StationVisit]) -> tuple[Cell, list[Suggestion]]:
    """The cell with what a station lacks, and what that is."""
    station = cell.station(name)
    here = exits(found, 0.0)
    if not here:
        loads = found[0].scene.load_text
        return cell, [
            Suggestion("error", name, f"no configuration reaches it with {loads}: move or turn it")
        ]
    best = best_exit(found)
    if best is None:
        return _without_line(cell, name, found, here)
    given = station.approach_distance
    suggestions = list[Suggestion]()
    if best.contacts:
        sentence = _kept_by_none(best.sentence)
        station = with_contacts(station, best.contacts)
        suggestions.append(Suggestion("error", name, sentence, "\n".join(contacts_yaml(station))))
    if best.approach != given:
        wrong = f"no free straight line out of {given:g} m" if given else "no approach_distance"
        why = f": {_why(found, given)}" if given else ""
        line = f"approach_distance: {best.approach:g}"
        suggestions.append(Suggestion("warning", name, f"has {wrong}{why}", line))
        station = replace(station, approach_distance=best.approach)
    return _with_zone(changed_station(cell, station), name, best), suggestions


def _without_line(
    cell: Cell, name: str, found: Sequence[StationVisit], here: Sequence[SuggestedExit]
) -> tuple[Cell, list[Suggestion]]:
    """The same where no straight line can be free: contacts at the station itself, if these
    suffice.
    """
    station = cell.station(name)
    best = max(here, key=lambda each: (each.free, each.mendable, each.depth))
    if not (best.free or best.mendable):
        sentence = f"no configuration is free; in the best of them {best.sentence}"
        advice = _door(best, cell) or f"move the station{_by(best, found)}"
        return cell, [Suggestion("error", name, f"{sentence}: {advice}")]
    suggestions = []
    if best.contacts:
        station = with_contacts(station, best.contacts)
        sentence = _kept_by_none(best.sentence)
        suggestions.append(Suggestion("error", name, sentence, "\n".join(contacts_yaml(station))))
    given = station.approach_distance or DISTANCES[0]
    out = f"has no free straight line out of {given:g} m: {_why(found, given)}"
    sentence = f"{out}; a withdrawal is searched there"
    suggestions.append(Suggestion("warning", name, sentence))
    return _with_zone(changed_station(cell, station), name, best), suggestions


def _why(found: Sequence[StationVisit], approach: float) -> str:
    """What is in the path of the line that lacks least."""
    return max(exits(found, approach), key=lambda each: each.depth).sentence


def _door(best: SuggestedExit, cell: Cell) -> str:
    """What moves the body in the path, "" where it is always there."""
    in_path = {near.body_b for line in best.lines for near in line.near}
    for machine in cell.equipment:
        for state in machine.states:
            for body in in_path.intersection(state.bodies):
                by = (
                    f" by signal {machine.switch.signal}, and wait for it" if machine.switch else ""
                )
                return (
                    f"{body} is there while {machine.name} is {state.name}: change that before{by}"
                )
    return ""


def _by(best: SuggestedExit, found: Sequence[StationVisit]) -> str:
    """By how much, and where to: the shortest that parts the worst pair, "" where that is not
    known.
    """
    worst = min((line for line in best.lines if line.near), key=lambda line: line.near[0].distance)
    visit = found[best.lines.index(worst)]
    pair = worst.near[0]
    model = visit.scene.collision
    z = next(k for k, each in enumerate(model.pairs) if each[1:] == (pair.body_a, pair.body_b))
    if model.pairs[z].kind == "SELF":
        return ""
    normal = model.witnesses(worst.q[None], np.array([z])).normal[0]
    step = (DEFAULT_SAFETY_DISTANCE - pair.distance) * normal
    return " by ({}) m in the world".format(", ".join(f"{each + 0.0:.3f}" for each in step))


def _with_zone(cell: Cell, name: str, best: SuggestedExit) -> Cell:
    """The cell whose zone holds the places where contacts are needed."""
    machine = cell.machine(cell.station(name).equipment)
    places = np.concatenate([line.within for line in best.lines])
    if not len(places) or not zone_lacks(machine, places):
        return cell
    return changed_machine(cell, with_zone(machine, places))


def _planner_suggestions(cell: Cell) -> Iterator[Suggestion]:
    """What the planner refuses: the program, and stations where it does not go, from park and
    back.
    """
    planner = Planner(clock=clock)
    options = PlanOptions(planning_time=CEILING)
    planner.set_cell(text=cell_to_yaml(cell))
    visited = {step.target for step in cell.program}
    asked: list[tuple[str, tuple[str, ...]]] = [("program", ())] if cell.program else []
    asked += [
        (each.name, (each.name, "park")) for each in cell.stations if each.name not in visited
    ]
    for subject, stations in asked:
        plan = planner.plan_program(stations=stations, options=options)
        if not plan.status.ok:
            yield Suggestion("error", subject, plan.status.message)
