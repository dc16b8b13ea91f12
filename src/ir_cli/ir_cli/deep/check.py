"""`ir cell check --deep`: what a program would fail at, and what to write into the cell file
instead.

Every station in every situation that the program finds there: a configuration with a free line in
and out, or the contacts, the zone and the approach distance that would make one. Then everything is
planned, with what
was suggested: what still fails is said too.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ir_cli.offline.asking import CEILING
from ir_description import Cell, cell_to_yaml
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner

from .mended import (
    DISTANCES,
    Exit,
    Suggestion,
    best_exit,
    changed_machine,
    changed_station,
    contacts_yaml,
    exits,
    with_contacts,
    with_zone,
    zone_lacks,
    zone_yaml,
)
from .stations import MARGIN, Visit, visits


def suggestions_of(cell: Cell) -> Iterator[Suggestion]:
    """What to change at stations and machines, then what fails when that has been done."""
    mended, suggestions = mended_cell(cell)
    yield from suggestions
    yield from _planned(mended)


def mended_cell(cell: Cell) -> tuple[Cell, list[Suggestion]]:
    """The cell with the contacts, zones and approach distances that its stations lack, and what
    these are.
    """
    suggestions = list[Suggestion]()
    situations: dict[str, list[Visit]] = {}
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


def _station(cell: Cell, name: str, found: Sequence[Visit]) -> tuple[Cell, list[Suggestion]]:
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
        sentence = (
            f"no configuration keeps {1e3 * MARGIN:g} mm; in the best of them {best.sentence}"
        )
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
    cell: Cell, name: str, found: Sequence[Visit], here: Sequence[Exit]
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
        sentence = (
            f"no configuration keeps {1e3 * MARGIN:g} mm; in the best of them {best.sentence}"
        )
        suggestions.append(Suggestion("error", name, sentence, "\n".join(contacts_yaml(station))))
    given = station.approach_distance or DISTANCES[0]
    out = f"has no free straight line out of {given:g} m: {_why(found, given)}"
    sentence = f"{out}; a withdrawal is searched there"
    suggestions.append(Suggestion("warning", name, sentence))
    return _with_zone(changed_station(cell, station), name, best), suggestions


def _why(found: Sequence[Visit], approach: float) -> str:
    """What is in the path of the line that lacks least."""
    return max(exits(found, approach), key=lambda each: each.depth).sentence


def _door(best: Exit, cell: Cell) -> str:
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


def _by(best: Exit, found: Sequence[Visit]) -> str:
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
    step = (MARGIN - pair.distance) * normal
    return " by ({}) m in the world".format(", ".join(f"{each + 0.0:.3f}" for each in step))


def _with_zone(cell: Cell, name: str, best: Exit) -> Cell:
    """The cell whose zone holds the places where contacts are needed."""
    machine = cell.machine(cell.station(name).equipment)
    places = np.concatenate([line.within for line in best.lines])
    if not len(places) or not zone_lacks(machine, places):
        return cell
    return changed_machine(cell, with_zone(machine, places))


def _planned(cell: Cell) -> Iterator[Suggestion]:
    """What the planner refuses: the program, and stations where it does not go, from park and
    back.
    """
    planner = Planner(time.monotonic)
    options = PlanOptions(planning_time=CEILING)
    planner.set_cell(cell_to_yaml(cell), "")
    visited = {step.target for step in cell.program}
    asked: list[tuple[str, tuple[str, ...]]] = [("program", ())] if cell.program else []
    asked += [
        (each.name, (each.name, "park")) for each in cell.stations if each.name not in visited
    ]
    for subject, stations in asked:
        plan = planner.plan_program(stations, 0.0, options, cell.posture("park"))
        if not plan.status.ok:
            yield Suggestion("error", subject, plan.status.message)
