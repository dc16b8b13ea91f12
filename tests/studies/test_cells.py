"""Robotic cells of the public benchmark: read, solved, judged by code that knows only the file."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from _cells_drawn import drawn
from _cells_judge import energy, faults

from ir_studies.cells import (
    CellAnswer,
    Instance,
    hurried,
    read_instances,
    solution,
    solve_cell,
    written,
)
from ir_studies.cells.instance import EnergyCurve, StaticActivity, StopLocation, stay_ranges
from ir_studies.errors import SettingsError


def rows_of(answer: CellAnswer) -> list[tuple[int, int, int, float, float]]:
    assert answer.schedule is not None
    return [
        (d.activity, d.choice, d.mode, d.start, d.duration)
        for robot in answer.schedule.robots
        for d in robot
    ]


def file_of(tmp_path: Path, instance: Instance) -> Path:
    path = tmp_path / "cells.xml"
    path.write_text(written([instance]))
    return path


@pytest.mark.parametrize("seed", range(4))
def test_a_schedule_is_valid_proved_and_costs_what_the_file_says(tmp_path: Path, seed: int) -> None:
    path = file_of(tmp_path, drawn(2, 4 + seed % 2, seed))
    (instance,) = read_instances(path)
    answer = solve_cell(instance)
    element = ET.parse(path).getroot().find("instance")
    assert faults(element, rows_of(answer)) == []
    assert energy(element, rows_of(answer)) == pytest.approx(answer.energy, rel=1e-9)
    assert answer.gap == 0.0


def test_the_judge_sees_what_is_wrong(tmp_path: Path) -> None:
    path = file_of(tmp_path, drawn(2, 4, 1))
    answer = solve_cell(read_instances(path)[0])
    element = ET.parse(path).getroot().find("instance")
    rows = rows_of(answer)
    assert faults(element, rows[1:])
    assert faults(element, [(a, c, m, s + (a < 1000), d) for a, c, m, s, d in rows[:3]] + rows[3:])
    moved = [(a, c, m, s, d * 1.01) for a, c, m, s, d in rows]
    assert faults(element, moved)


def test_a_written_cell_is_read_again(tmp_path: Path) -> None:
    instance = drawn(3, 4, 0)
    (read,) = read_instances(file_of(tmp_path, instance))
    assert replace(read, name=instance.name) == instance


def test_no_schedule_of_one_robot_is_cheaper_than_the_proved_one() -> None:
    """All ways through one robot's stops, durations on a grid of the cycle."""
    instance = drawn(1, 3, 3)
    answer = solve_cell(instance)
    assert answer.gap == 0.0
    (robot,) = instance.robots
    best = np.inf
    stops = {stop.number: stop for stop in robot.stops}
    hops = {(h.start, h.end): h for h in robot.hops}
    order = [stop.number for stop in robot.stops]
    step = 0.05
    for a in stops[order[0]].places:
        for b in stops[order[1]].places:
            for c in stops[order[2]].places:
                chain = [
                    (order[2], order[0], c, a),
                    (order[0], order[1], a, b),
                    (order[1], order[2], b, c),
                ]
                costs = [np.array([0.0])]
                for u, v, here, there in chain:
                    move = next(
                        m
                        for m in hops[u, v].movements
                        if (m.start, m.end) == (here.point, there.point)
                    )
                    costs.append(_costs_of_move(move.curve, step, instance.cycle))
                    costs.append(_costs_of_stay(stops[v], there, robot.modes, step, instance.cycle))
                total = costs[0]
                for more in costs[1:]:
                    total = _least_sum(total, more, round(instance.cycle / step))
                best = min(best, total[round(instance.cycle / step)])
    assert answer.energy == pytest.approx(best, rel=5e-3)
    assert answer.energy <= best * (1.0 + 2e-3)


def _costs_of_move(curve: EnergyCurve, step: float, cycle: float) -> np.ndarray:
    times = np.arange(round(cycle / step) + 1) * step
    inside = (times >= curve.least) & (times <= curve.most)
    safe = np.where(inside, times, 1.0)
    return np.where(inside, [curve.energy(t) for t in safe], np.inf)


def _costs_of_stay(
    stop: StaticActivity, place: StopLocation, modes: dict, step: float, cycle: float
) -> np.ndarray:
    times = np.arange(round(cycle / step) + 1) * step
    costs = np.full(len(times), np.inf)
    for mode, shortest in modes.items():
        inside = (times >= max(stop.least, shortest)) & (times <= stop.most)
        costs = np.where(inside, np.minimum(costs, place.power[mode] * times), costs)
    return costs


def _least_sum(one: np.ndarray, other: np.ndarray, most: int) -> np.ndarray:
    result = np.full(most + 1, np.inf)
    for k, value in enumerate(one):
        if np.isfinite(value):
            upto = min(len(other), most + 1 - k)
            result[k : k + upto] = np.minimum(result[k : k + upto], value + other[:upto])
    return result


@pytest.mark.parametrize("seed", range(3))
def test_a_longer_cycle_with_unbounded_waits_costs_at_most_the_wait(seed: int) -> None:
    instance = drawn(1, 4, seed)
    longer = replace(instance, cycle=instance.cycle + 1.0)
    (robot,) = instance.robots
    stops = tuple(replace(s, most=2.0 * instance.cycle) if s.closes else s for s in robot.stops)
    free = [replace(i, robots=(replace(robot, stops=stops),)) for i in (instance, longer)]
    costs = [solve_cell(i).energy for i in free]
    dearest = max(max(p.power.values()) for s in stops for p in s.places)
    assert costs[1] <= costs[0] + dearest + 1e-3


def test_hurrying_never_saves() -> None:
    for seed in range(3):
        instance = drawn(1, 4, seed)
        assert solve_cell(hurried(instance)).energy >= solve_cell(instance).energy - 1e-3


@pytest.mark.parametrize("seed", range(2))
def test_parts_alone_give_a_valid_schedule_and_bound_no_more_than_the_whole_proves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """The whole model is never asked: a schedule robot by robot, bounds by robots, parts anew."""
    path = file_of(tmp_path, drawn(4, 4, seed, conflicts=20))
    (instance,) = read_instances(path)
    whole = solve_cell(instance)
    assert whole.gap == 0.0
    monkeypatch.setattr(solution._Search, "_whole", lambda search, seconds: False)
    parts = solve_cell(instance)
    element = ET.parse(path).getroot().find("instance")
    assert faults(element, rows_of(parts)) == []
    assert energy(element, rows_of(parts)) == pytest.approx(parts.energy, rel=1e-9)
    assert 0.9 * whole.energy < parts.bound <= whole.energy * (1.0 + solution.PROVED)
    assert whole.bound * (1.0 - solution.PROVED) <= parts.energy < 1.05 * whole.energy


@pytest.mark.parametrize("seed", range(2))
def test_curves_that_are_not_met_in_time_give_a_valid_schedule(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    monkeypatch.setattr(solution, "_MOST_ROUNDS", 1)
    path = file_of(tmp_path, drawn(2, 5, seed))
    answer = solve_cell(read_instances(path)[0])
    element = ET.parse(path).getroot().find("instance")
    assert faults(element, rows_of(answer)) == []
    assert answer.bound <= answer.energy


def test_many_robots_get_a_schedule_with_a_stated_gap(tmp_path: Path) -> None:
    path = file_of(tmp_path, drawn(5, 4, 2, conflicts=20))
    answer = solve_cell(read_instances(path)[0], seconds=20.0, gap=0.01)
    element = ET.parse(path).getroot().find("instance")
    assert faults(element, rows_of(answer)) == []
    assert answer.bound <= answer.energy
    assert answer.gap <= 0.01


def test_a_cell_without_a_schedule_is_said_to_have_none() -> None:
    instance = drawn(1, 3, 0)
    answer = solve_cell(replace(instance, cycle=0.5))
    assert answer.is_impossible
    assert answer.schedule is None


def test_a_concave_curve_is_bounded_from_below() -> None:
    curve = EnergyCurve(((-1, 100.0), (2, -3.0), (1, 80.0)), 1.0, 6.0)
    for at in np.linspace(1.0, 6.0, 11):
        slope, zero = curve.tangent(float(at))
        for t in np.linspace(1.0, 6.0, 51):
            assert slope * t + zero <= curve.energy(float(t)) + 1e-9


def test_modes_are_disjoint_ranges_of_the_cheapest() -> None:
    place = StopLocation(0, 0, {0: 100.0, 1: 40.0, 2: 60.0, 3: 10.0})
    ranges = stay_ranges(
        StaticActivity(0, 1.0, 30.0, (place,)), place, {0: 0.0, 1: 5.0, 2: 8.0, 3: 20.0}
    )
    assert [(r.mode, r.least, r.most) for r in ranges] == [
        (0, 1.0, 5.0),
        (1, 5.0, 20.0),
        (3, 20.0, 30.0),
    ]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("<dataset>", "<dataset", "is no XML"),
        ('last_in_cycle="true"', "", "must have one static-activity with last_in_cycle"),
        ("<min-duration>", "<min-duration>-", "must be a number of at least 0"),
        ('degree="-1"', 'degree="0.5"', "must be a whole number"),
        ("<from-point>", "<from-point>9", "belongs to no location"),
        ("<production-cycle-time>", "<production-cycle-time>x", "must be a number"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(
    tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    path = file_of(tmp_path, drawn(1, 3, 0))
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SettingsError, match=sentence) as refused:
        read_instances(path)
    assert "\n" not in str(refused.value)
