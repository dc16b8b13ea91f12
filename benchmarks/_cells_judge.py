"""A judge of schedules of robotic cells: it reads the XML itself and shares no code with the
project.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

TOLERANCE = 1e-6


def faults(instance: ET.Element, rows: Iterable[tuple[int, int, int, float, float]]) -> list[str]:
    """What a schedule breaks. rows: activity, location or movement, mode (-1), start, duration."""
    done = {row[0]: row[1:] for row in rows}
    cycle = float(instance.findtext("production-cycle-time"))
    return [
        fault for robot in instance.find("robots") for fault in _robot_faults(robot, done, cycle)
    ] + _shared_faults(instance, done, cycle)


def energy(instance: ET.Element, rows: Iterable[tuple[int, int, int, float, float]]) -> float:
    """Energy of a cycle by the file's figures."""
    total = 0.0
    for activity, choice, mode, _, took in rows:
        static = instance.find(f".//static-activity[@aid='{activity}']")
        if static is None:
            move = instance.find(
                f".//dynamic-activity[@aid='{activity}']//movement[@mid='{choice}']"
            )
            total += sum(
                float(m.get("coeff")) * took ** int(m.get("degree")) for m in move.iter("monomial")
            )
        else:
            path = f".//location[@lid='{choice}']//consumption[@pid='{mode}']"
            own = static.find(path)
            if own is None:
                robot = next(r for r in instance.find("robots") if static in list(r.iter()))
                watts = robot.findtext(f".//power-mode[@pid='{mode}']/expected-input-power")
            else:
                watts = own.get("input_power")
            total += float(watts) * took
    return total


def _robot_faults(robot: ET.Element, done: dict, cycle: float) -> list[str]:
    missing = [a.get("aid") for a in robot.iter("static-activity") if int(a.get("aid")) not in done]
    if missing:
        return [f"{aid} is not done" for aid in missing]
    found = []
    points = {}
    begins = {}
    for static in robot.iter("static-activity"):
        aid = int(static.get("aid"))
        lid, mode, start, took = done[aid]
        shortest = float(robot.findtext(f".//power-mode[@pid='{mode}']/minimal-idle-time"))
        low = max(float(static.findtext("min-duration")), shortest)
        if not low - TOLERANCE <= took <= float(static.findtext("max-duration")) + TOLERANCE:
            found.append(f"{aid} takes {took}")
        points[aid] = int(static.findtext(f".//location[@lid='{lid}']/point"))
        begins[aid] = (start, took, static.get("last_in_cycle") == "true")
    used = {}
    stops = {point: stop for stop, point in points.items()}
    for dynamic in robot.iter("dynamic-activity"):
        if int(dynamic.get("aid")) in done:
            found += _hop_faults(dynamic, done, stops, begins, used, cycle)
    total = sum(
        done[int(a.get("aid"))][3] for a in robot.find("activities") if int(a.get("aid")) in done
    )
    if abs(total - cycle) > TOLERANCE:
        found.append(f"a cycle of {total}")
    at = next(iter(points))
    seen = set()
    while at in used and at not in seen:
        seen.add(at)
        at = used[at]
    if seen != set(points):
        found.append("the robot's way is no cycle through all stops")
    return found


def _hop_faults(
    dynamic: ET.Element, done: dict, stops: dict, begins: dict, used: dict, cycle: float
) -> list[str]:
    aid = int(dynamic.get("aid"))
    mid, _, start, took = done[aid]
    move = dynamic.find(f".//movement[@mid='{mid}']")
    low = float(move.findtext("min-duration"))
    high = float(move.findtext("max-duration"))
    found = []
    if not low - TOLERANCE <= took <= high + TOLERANCE:
        found.append(f"{aid} takes {took}")
    tail = stops.get(int(move.findtext("from-point")))
    head = stops.get(int(move.findtext("to-point")))
    if tail is None or head is None:
        return [f"{aid} joins places that are not taken"]
    if tail in used:
        found.append(f"{tail} is left twice")
    used[tail] = head
    left = begins[tail][0] + begins[tail][1] - (cycle if begins[tail][2] else 0.0)
    if abs(start - left) > TOLERANCE or abs(start + took - begins[head][0]) > TOLERANCE:
        found.append(f"{aid} is not in time")
    return found


def _shared_faults(instance: ET.Element, done: dict, cycle: float) -> list[str]:
    return [
        *_late(instance, done, cycle),
        *_unfit(instance, done),
        *_clashes(instance, done, cycle),
    ]


def _late(instance: ET.Element, done: dict, cycle: float) -> list[str]:
    found = []
    for lag in instance.iter("time-lag"):
        a = int(lag.findtext("from-activity"))
        b = int(lag.findtext("to-activity"))
        if a in done and b in done:
            bound = float(lag.findtext("length")) - cycle * int(lag.findtext("height"))
            if done[b][2] - done[a][2] < bound - TOLERANCE:
                found.append(f"lag {a} {b}")
    return found


def _unfit(instance: ET.Element, done: dict) -> list[str]:
    found = []
    for operation in instance.iter("operation"):
        allowed = {}
        for pair in operation.iter("compatible-pair"):
            ends = sorted((int(each.get("aid")), int(each.get("lid"))) for each in pair)
            key = (ends[0][0], ends[1][0])
            allowed.setdefault(key, set()).add((ends[0][1], ends[1][1]))
        for (a, b), pairs in allowed.items():
            if (done[a][0], done[b][0]) not in pairs:
                found.append(f"places of {a} and {b}")
    return found


def _clashes(instance: ET.Element, done: dict, cycle: float) -> list[str]:
    found = []
    for pair in instance.iter("collision-pair"):
        ends = [(int(e.get("aid")), int(e.get("lid") or e.get("mid"))) for e in pair]
        if any(a not in done or done[a][0] != choice for a, choice in ends):
            continue
        (one, _), (other, _) = ends
        start, took = done[one][2:]
        begin, length = done[other][2:]
        for shift in range(-20, 21):
            at = begin + shift * cycle
            if at < start + took - TOLERANCE and start < at + length - TOLERANCE:
                found.append(f"{one} and {other} collide")
    return found
