"""Cells ask for searches of the paper at stations and steps; what these did travels with the
plan.
"""

from __future__ import annotations

import re
import sys
from importlib.resources import files
from itertools import pairwise, product
from pathlib import Path
from typing import TypeVar

import coal
import numpy as np
import pytest

from ir_description import Cell, PowerData, cell_from_yaml, cell_to_yaml, load_cell
from ir_kernels import Chain
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind
from ir_msgs_py.search_log import (
    ConfigurationLog,
    CorrectionLog,
    SearchLog,
    WithdrawalLog,
)
from ir_msgs_py.status import StatusCode
from ir_planner import PlannerSettings
from ir_planner.errors import RequestError
from ir_planner.program.program import ProgramPlan, ProgramRequest, plan_program
from ir_planner.request.context import Work
from ir_planner.service import ModifiedGa
from ir_values.arrays import FloatArray
from ir_values.errors import DescriptionError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from _coal_shapes import along_z, solid

Log = TypeVar("Log", WithdrawalLog, ConfigurationLog, CorrectionLog)
BENCH = (files("ir_description") / "data" / "cells" / "kr6_bench.yaml").read_text(encoding="utf-8")
PICK = "abc_deg: [0, 90, 0]}, approach_distance: 0.1}"
PLACE = "{station: place, dwell: 0.5}"
ROUNDED = 2e-3  # m: positions in a log are whole millimetres, in three axes
S_M = PlanOptions().safety_distance
FINE = 0.005  # rad between configurations that Coal is asked about
# m: the tool in a hundredth of a radian of each joint, at its reach, and the rounding
A_STEP = 0.02
AT_THE_POSE = 1e-3  # m: Psi below xi (1e-8 m^2), and the rounding


def bench(at_pick: str = "", to_place: str = "") -> str:
    """The bench with more keys at its first station and its second step."""
    text = (
        BENCH.replace(PICK, PICK.replace("}, app", f"}}, {at_pick} app"), 1) if at_pick else BENCH
    )
    return (
        text.replace(PLACE, f"{{station: place, {to_place} dwell: 0.5}}", 1) if to_place else text
    )


def planned(cell: Cell, power: PowerData, *stations: str, seed: int = 0) -> ProgramPlan:
    options = PlanOptions(seed=seed, planning_time=60.0)
    request = ProgramRequest(cell, power, stations, np.array(cell.machine_home), options)
    return plan_program(request, Work(100_000, 1.0, lambda: 0.0))


def logs_of(plan: ProgramPlan) -> list[SearchLog]:
    return list(plan.info.searches)


@pytest.fixture(scope="module")
def asked() -> Cell:
    return cell_from_yaml(
        bench("configurations: ccd, starts: 40, withdrawal: modified_ga,", "planner: genetic,")
    )


@pytest.fixture(scope="module")
def plan(asked: Cell, power: PowerData) -> ProgramPlan:
    found = planned(asked, power)
    assert found.report.certified
    return found


def one(plan: ProgramPlan, kind: type[Log]) -> Log:
    (log,) = [log for log in logs_of(plan) if isinstance(log, kind)]
    return log


def test_a_station_that_asks_for_a_withdrawal_is_left_by_it(plan: ProgramPlan, asked: Cell) -> None:
    log = one(plan, WithdrawalLog)
    station = asked.station("pick")
    assert (log.station, log.method, log.load) == ("pick", "modified_ga", "gripper")
    assert (log.asked, log.blocked) == (True, "")  # a straight line is free there
    for places in (log.path, log.kept):
        assert np.abs(places[0] - station.pose[:3, 3]).max() < ROUNDED
    assert (log.parents[1:] < np.arange(1, len(log.parents))).all()
    assert len(log.kept) - 1 + sum(count for _, count in log.rejected) == log.candidates
    assert log.distance[1] > log.distance[0]
    (out,) = [
        m for m in plan.movements if m.kind == MovementKind.SERVICE_EXIT and m.to_station == "pick"
    ]
    assert out.trajectory is not None
    chain = Chain(asked.robot, asked.base_pose, asked.tcp)
    tcp = chain.tcp_poses(out.trajectory.positions[[0, -1]])[:, :3, 3]
    assert np.abs(tcp - log.path[[0, -1]]).max() < ROUNDED


def test_a_station_may_name_the_trees(power: PowerData) -> None:
    log = one(planned(cell_from_yaml(bench("withdrawal: tree,")), power, "pick"), WithdrawalLog)
    assert (log.method, log.generations) == ("tree", 0)
    assert len(log.path) > 1


def test_configurations_of_a_station_come_from_counted_starts(
    plan: ProgramPlan, asked: Cell
) -> None:
    log = one(plan, ConfigurationLog)
    reached = asked.station("pick").pose[:3, 3]
    assert (log.station, log.starts) == ("pick", 40)
    assert log.accepted + sum(count for _, count in log.rejected) == log.starts == len(log.tracks)
    assert 1 <= log.distinct <= log.accepted
    for track in log.tracks:
        if not track.outcome:
            assert np.abs(track.points[-1] - reached).max() < AT_THE_POSE
    reasons = [track.outcome for track in log.tracks if track.outcome]
    assert {(reason, reasons.count(reason)) for reason in reasons} == set(log.rejected)


def test_a_step_s_planner_corrects_its_movement(plan: ProgramPlan) -> None:
    log = one(plan, CorrectionLog)
    assert (log.start, log.goal) == ("pick", "place")
    assert log.generations == sum(len(each) for each in log.fitness) > 0
    assert all(later <= earlier for each in log.fitness for earlier, later in pairwise(each))
    assert log.costs[1] > log.costs[0] > 0.0
    assert np.abs(log.straight[[0, -1]] - log.path[[0, -1]]).max() < ROUNDED


def test_what_collides_of_the_straight_movement_is_what_coal_finds_there(
    plan: ProgramPlan, asked: Cell
) -> None:
    log = one(plan, CorrectionLog)
    (across,) = [m for m in plan.movements if (m.from_station, m.to_station) == ("pick", "place")]
    assert across.trajectory is not None
    first, last = across.trajectory.positions[[0, -1]]
    share = np.linspace(0.0, 1.0, 1 + int(np.ceil(np.abs(last - first).max() / FINE)))
    q = first + share[:, None] * (last - first)
    near = _least_distances(asked, q) <= PlanOptions().safety_distance
    tool = Chain(asked.robot, asked.base_pose, asked.tcp).tcp_poses(q)[:, :3, 3]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(int), [0]])))
    assert len(log.stretches) == len(edges) // 2 > 0
    for stretch, begin, end in zip(log.stretches, edges[::2], edges[1::2], strict=True):
        assert np.linalg.norm(stretch[0] - tool[begin], axis=-1) < A_STEP
        assert np.linalg.norm(stretch[-1] - tool[end - 1], axis=-1) < A_STEP
    driven = across.trajectory.sample(np.linspace(0.0, across.duration, len(log.driven))).q
    places = Chain(asked.robot, asked.base_pose, asked.tcp).tcp_poses(driven)[:, :3, 3]
    assert np.abs(log.driven - places).max() < ROUNDED
    assert re.fullmatch(r"\w+ too near \w+", log.met)


def _least_distances(cell: Cell, q: FloatArray) -> FloatArray:
    """The least distance [m] of what moves beyond link 2 to the machines' bodies, by Coal, (N,)."""
    capsules = [*cell.robot.capsules, *(c for load in cell.loads("") for c in load.capsules)]
    moving = [
        (c.link, along_z(c.p0, c.p1), coal.Capsule(c.radius, float(np.linalg.norm(c.p1 - c.p0))))
        for c in capsules
        if c.link > 2 and np.linalg.norm(c.p1 - c.p0) > 0.0
    ]
    standing = [
        (_placed(np.asarray(body.pose)), solid(body))
        for body in cell.bodies()
        if body.kind != "plane"
    ]
    least = np.full(len(q), np.inf)
    for k, links in enumerate(Chain(cell.robot, cell.base_pose, cell.tcp).link_poses(q)):
        for (link, along, capsule), (there, body) in product(moving, standing):
            asked = coal.DistanceRequest(), coal.DistanceResult()
            here = _placed(links[link] @ along)
            least[k] = min(least[k], coal.distance(capsule, here, body, there, *asked))
    return least


def _placed(pose: FloatArray) -> coal.Transform3s:
    return coal.Transform3s(np.ascontiguousarray(pose[:3, :3]), np.ascontiguousarray(pose[:3, 3]))


def test_lines_out_of_the_washer_are_blocked_about_the_tool_s_axis() -> None:
    cell = load_cell("demo")
    station = cell.station("washer_rinse")
    held = [
        (coal.Capsule(c.radius, float(np.linalg.norm(c.p1 - c.p0))), along_z(c.p0, c.p1))
        for load in cell.loads("gear")
        for c in load.capsules
    ]
    washer = [
        (solid(body), _placed(np.asarray(body.pose)))
        for body in cell.machine("washer").world_bodies()
    ]

    def free(direction: FloatArray) -> bool:
        for share in np.linspace(0.0, 1.0, 101):
            pose = np.array(station.pose)
            pose[:3, 3] += 1.2 * share * direction  # farther than the washer is wide
            flange = pose @ np.linalg.inv(cell.tcp)
            for (shape, local), (body, place) in product(held, washer):
                asked = coal.DistanceRequest(), coal.DistanceResult()
                if coal.distance(shape, _placed(flange @ local), body, place, *asked) <= S_M:
                    return False
        return True

    k = np.arange(600) + 0.5
    height = 1.0 - 2.0 * k / len(k)
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    directions = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
    angle = np.degrees(np.arccos(np.clip(directions @ -station.pose[:3, 0], -1.0, 1.0)))
    assert not any(free(direction) for direction in directions[angle < 75.0])
    assert free(np.append(-station.pose[:2, 3] / np.linalg.norm(station.pose[:2, 3]), 0.0))


def test_a_withdrawal_that_is_asked_for_and_found_by_nobody_is_refused(power: PowerData) -> None:
    deep = "zone: {kind: OPEN, size: [0.3, 0.3, 0.8], xyz: [0, 0, 0.4]}"  # no small step leaves it
    text = bench("withdrawal: modified_ga,").replace("zone: OPEN", deep, 1)
    cell = cell_from_yaml(text)
    feeble = ModifiedGa(population=2, offspring=1, generations=1, step=0.001, spread=0.01)
    settings = PlannerSettings(withdrawal=feeble)
    start = np.array(cell.machine_home)
    asked = ProgramRequest(cell, power, ("pick",), start, PlanOptions(), settings=settings)
    refused = plan_program(asked, Work(100_000, 1.0, lambda: 0.0)).status
    assert refused.code == StatusCode.PLANNING_FAILED
    assert (
        "station pick: the withdrawal modified_ga that it asks for leads out of none of"
        in refused.message
    )
    assert "without `withdrawal: modified_ga`" in refused.message
    assert "straight lines are free" in refused.message


def test_what_the_searches_did_is_the_same_for_the_same_seed(
    plan: ProgramPlan, asked: Cell, power: PowerData
) -> None:
    again = planned(cell_from_yaml(cell_to_yaml(asked)), power)
    assert _logs(again) == _logs(plan)
    assert len(_logs(plan)) == 3
    assert again.program_id == plan.program_id


def _logs(plan: ProgramPlan) -> list[str]:
    return [repr(log) for log in plan.info.searches]


def test_what_a_cell_asks_for_is_written_and_read_again() -> None:
    text = bench("configurations: ccd, starts: 7, withdrawal: tree,", "planner: genetic,")
    cell = cell_from_yaml(cell_to_yaml(cell_from_yaml(text)))
    assert cell.station("pick").search == cell_from_yaml(text).station("pick").search
    assert (cell.station("pick").search.starts, cell.program[1].planner) == (7, "genetic")


@pytest.mark.parametrize(
    ("at_pick", "to_place", "sentence"),
    [
        ("configurations: guess,", "", "analytic, ccd"),
        ("starts: 8,", "", "belongs to a station with configurations: ccd"),
        ("configurations: ccd, starts: 0,", "", "[1, 10000]"),
        ("", "planner: 3,", "planner"),
    ],
)
def test_settings_that_make_no_sense_are_refused_at_their_line(
    at_pick: str, to_place: str, sentence: str
) -> None:
    with pytest.raises(DescriptionError) as refused:
        cell_from_yaml(bench(at_pick, to_place))
    assert sentence in str(refused.value)


def test_a_pause_has_no_planner() -> None:
    with pytest.raises(DescriptionError, match="does not belong to a pause step"):
        cell_from_yaml(BENCH.replace("{pause: 30,", "{pause: 30, planner: tree,"))


@pytest.mark.parametrize(
    ("at_pick", "to_place", "sentence"),
    [
        ("withdrawal: genetic,", "", "pick: withdrawal 'genetic' is unknown: known are "),
        ("", "planner: genetik,", "step 2: planner 'genetik' is unknown: known are "),
    ],
)
def test_a_search_that_nobody_has_is_refused_with_those_that_are_known(
    at_pick: str, to_place: str, sentence: str, power: PowerData
) -> None:
    with pytest.raises(RequestError) as refused:
        planned(cell_from_yaml(bench(at_pick, to_place)), power)
    assert sentence in refused.value.status.message
    assert "tree" in refused.value.status.message
