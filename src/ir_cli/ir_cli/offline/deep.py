"""`ir cell check --deep`: what a program would fail at, and what to write into the cell file instead.

At every station, with what the program holds there: pairs that need an allowed contact, and a straight exit
that is free. At last the whole program is planned.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ir_description import AllowedContact, Cell, Station, cell_to_yaml
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_planner.request import Context, Journal, Work
from ir_planner.scene import PlanningScene
from ir_planner.service import lines_free, service_lines

from .asking import CEILING
from .stations import MARGIN, visits

DISTANCES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6)  # m of approach that are tried
WORK = 20_000  # certified edges of one station
_SHARE = 0.5  # of the distance at the station: how near a contact may come
_GRID = 1e-4  # m, to which it is rounded down


@dataclass(frozen=True)
class Suggestion:
    """What is wrong with a station or with the program, and lines to paste into the cell file ("": none).

    A warning may be meant, as where a machine is left by a withdrawal.
    """

    severity: Literal["error", "warning"]
    subject: str
    sentence: str
    yaml: str = ""


def suggestions_of(cell: Cell) -> Iterator[Suggestion]:
    """What to change, station by station, then the program's own failure."""
    situations: dict[str, list[PlanningScene]] = {}
    for visit in visits(cell):
        situations.setdefault(visit.station.name, []).append(visit.scene)
    for name, scenes in situations.items():
        station = cell.station(name)
        near = [each for scene in scenes if (each := _contacts(station, scene)) is not None]
        if near:
            yield _merged(station, near)
        else:
            yield from _approach(cell, station)
    if cell.program:
        planner = Planner(time.monotonic)
        planner.set_cell(cell_to_yaml(cell), "")
        plan = planner.plan_program((), 0.0, PlanOptions(planning_time=CEILING), cell.posture("park"))
        if not plan.status.ok:
            yield Suggestion("error", "program", plan.status.message)


@dataclass(frozen=True)
class _TooNear:
    """Why no configuration is free, and the contacts that would allow one (none: nothing does)."""

    sentence: str
    contacts: tuple[AllowedContact, ...]


def _contacts(station: Station, scene: PlanningScene) -> _TooNear | None:
    """Pairs that are too near in the configuration that needs least; None where one is free."""
    load = scene.load_text
    q = scene.inverse_kinematics.solve(np.asarray(station.pose)[None]).q
    if not len(q):
        return _TooNear(f"no configuration reaches it with {load}: move it, or turn it", ())
    distance = scene.collision.distances(q)
    lacking = scene.thresholds(MARGIN, station.name) - distance
    k = int(np.argmin(lacking.max(axis=1, initial=-np.inf)))
    near = np.flatnonzero(lacking[k] > 0.0)
    if not len(near):
        return None
    pairs = [(scene.collision.pairs[int(z)], float(distance[k, z])) for z in near]
    listed = ", ".join(f"{pair.body_a} and {pair.body_b} {1e3 * d:.1f} mm" for pair, d in pairs)
    sentence = f"no configuration keeps {1e3 * MARGIN:g} mm with {load}; best of them: {listed}"
    for pair, d in pairs:
        if d <= 0.0 or pair.kind == "SELF":
            return _TooNear(f"{sentence}; {pair.body_a} must not touch {pair.body_b}: move the station", ())
    return _TooNear(sentence, tuple(_contact(pair.body_a, pair.body_b, d) for pair, d in pairs))


def _contact(body_a: str, body_b: str, distance: float) -> AllowedContact:
    return AllowedContact(body_a, body_b, float(np.floor(_SHARE * distance / _GRID) * _GRID))


def _merged(station: Station, found: list[_TooNear]) -> Suggestion:
    """One suggestion for all loads, with the contacts that the station has."""
    sentence = "; ".join(each.sentence for each in found)
    if not all(each.contacts for each in found):
        return Suggestion("error", station.name, sentence)
    nearest: dict[frozenset[str], AllowedContact] = {}
    for contact in (*station.allowed_contacts, *(c for each in found for c in each.contacts)):
        pair = frozenset((contact.body_a, contact.body_b))
        known = nearest.setdefault(pair, contact)
        nearest[pair] = min(known, contact, key=lambda each: each.safety_distance)
    lines = [
        f"  - {{between: [{c.body_a}, {c.body_b}], safety_distance: {c.safety_distance:g}}}"
        for c in nearest.values()
    ]
    return Suggestion("error", station.name, sentence, "\n".join(["allowed_contacts:", *lines]))


def _approach(cell: Cell, station: Station) -> Iterator[Suggestion]:
    """The approach distance nearest to the given one with a free straight exit; none where that has one."""
    given = station.approach_distance
    if given > 0.0 and _exits(cell, station, given):
        return
    for distance in sorted(DISTANCES, key=lambda each: abs(each - given)):
        if _exits(cell, station, distance):
            wrong = f"no free straight exit of {given:g} m" if given else "no approach_distance"
            yield Suggestion("warning", station.name, f"has {wrong}", f"approach_distance: {distance:g}")
            return
    yield Suggestion("warning", station.name, "has no free straight exit: a withdrawal is searched there")


def _exits(cell: Cell, station: Station, distance: float) -> bool:
    """Whether a configuration has a free straight exit of a distance [m], in each situation."""
    stations = tuple(
        replace(each, approach_distance=distance) if each.name == station.name else each
        for each in cell.stations
    )
    options = PlanOptions(safety_distance=MARGIN)
    for visit in visits(replace(cell, stations=stations)):
        if visit.station.name != station.name:
            continue
        work = Work(WORK, time.monotonic() + CEILING, time.monotonic)
        context = Context(visit.scene, options, Journal(work, 0)).at(station.name)
        q = visit.scene.inverse_kinematics.solve(np.asarray(station.pose)[None]).q
        free = q[visit.scene.collision.is_free(q, context.thresholds())] if len(q) else q
        rejected = Counter[str]()
        if not any(lines_free(service_lines(free, context, rejected), context, rejected)):
            return False
    return True
