"""Laws: a program that may pass stops and ends of lines without standing still costs no more than
the one that stands still, passes each place within its blend and in order, and keeps all limits and
distances.

Judges: Pinocchio (where the tool passes, limits and torque at 10 kHz), Coal (distances).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from ir_description import Cell, ProgramStep, cell_from_yaml, cell_to_yaml, load_cell
from ir_description.cell import AllowedContact, station_at
from ir_description.poses import composed, inverse
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_planner import Planner, ProgramPlan, RequestError
from ir_planner.checks import evaluate_trajectory
from ir_planner.krl import export_krl
from ir_program_runner.program import station_of
from ir_values.arrays import FloatArray
from ir_values.errors import CellFileError, InvalidValueError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judges
from _coal_model import Coal
from _pinocchio_arm import pinocchio_arm
from _second_opinion import SecondOpinion

CELLS = ("open", "kr6_bench", "ur10e_bench")
MARGIN = 0.02  # m
ROUNDED = 1e-5  # m between two codes
SAMPLED = 2e-4  # m and rad that the nearest of samples 0.1 ms apart may be farther
LITTLE = {"max_iterations": 20_000}
OBJECTIVES = ("time", "time_and_energy", "movement_cost")


def drawn_cell(name: str, seed: int, count: int = 3) -> tuple[Cell, list[str]]:
    """A cell with stations at drawn free places, some with a line of approach, and their names."""
    cell = load_cell(name)
    planner = Planner(cell, clock=lambda: 0.0)
    draw = np.random.default_rng([seed, 31])
    machine = cell.equipment[0]
    home = np.array(cell.machine_home)
    stations = list(cell.stations)
    while len(stations) < len(cell.stations) + count:
        q = home + draw.uniform(-0.6, 0.6, len(home))
        if not planner.check_state(q=q).valid:
            continue
        tool = planner.scene().chain.tcp_poses(q[None])[0]
        pose = composed(inverse(machine.pose), tool)
        approach = float(draw.choice([0.0, 0.08]))
        stations.append(station_at(machine, f"drawn_{len(stations)}", pose, (), approach))
    names = [station.name for station in stations[len(cell.stations) :]]
    return replace(cell, stations=tuple(stations)), names


def cost(plan: ProgramPlan, planner: Planner, objective: str) -> float:
    report = plan.report
    joules = report.energy - report.base_energy
    value = planner.cell.robot.time_value
    return {
        "time": report.duration,
        "time_and_energy": joules + value * report.duration,
        "movement_cost": report.movement_cost,
    }[objective]


def passes_in_order(
    movements: tuple[PlannedMovement, ...], cell: Cell, stops: list[str], blend: float
) -> bool:
    """Whether the tool comes to the stops one after the other, each within the blend."""
    model = pinocchio_arm(cell.robot, (), cell.base_pose)
    data = model.createData()
    foot = np.linalg.inv(cell.base_pose)
    driven = [step.trajectory for step in movements if step.trajectory is not None]
    q = np.concatenate(
        [
            one.sample(np.linspace(0.0, one.duration, int(1e4 * one.duration) + 2)).q
            for one in driven
        ]
    )[::5]
    tools = []
    for row in q:
        pinocchio.forwardKinematics(model, data, row)
        joint = data.oMi[cell.robot.n]
        tools.append(joint.homogeneous @ cell.tcp)
    places = np.array(tools)
    first = 0
    for name in stops:
        wanted = foot @ cell.station(name).pose
        away = np.linalg.norm(places[first:, :3, 3] - wanted[:3, 3], axis=1)
        trace = np.einsum("nij,ij->n", places[first:, :3, :3], wanted[:3, :3])
        turned = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
        near = (away <= blend + 5 * SAMPLED) & (turned <= 4.0 * blend + 5 * SAMPLED)
        if not near.any():
            return False
        first += int(near.argmax())
    return True


def judged(planner: Planner, movements: tuple[PlannedMovement, ...]) -> None:
    """Every movement begins where the one before ended, and keeps limits and distances."""
    scene = planner.scene()
    second = SecondOpinion(scene)
    loads = [capsule for load in scene.loads for capsule in load.capsules]
    judge = Coal(scene.collision, [*scene.cell.robot.capsules, *loads], scene.cell.bodies())
    here: FloatArray | None = None
    for step in movements:
        if step.trajectory is None:
            continue
        assert step.report.certified
        assert second.largest_share(step.trajectory) <= 1.0 + 1e-6
        if here is not None:
            assert step.trajectory.positions[0] == pytest.approx(here, abs=1e-9)
        here = step.trajectory.positions[-1]
        for q in step.trajectory.sample(np.linspace(0.0, step.duration, 200)).q:
            assert (judge.distances(q) > scene.thresholds(MARGIN) - ROUNDED).all()


@pytest.mark.parametrize(
    ("name", "seeds"),
    [
        ("kr6_bench", range(1)),
        *(pytest.param(name, range(7), marks=pytest.mark.long) for name in CELLS),
    ],
)
def test_a_program_without_rests_costs_no_more_and_passes_all_stops(
    name: str, seeds: range
) -> None:
    passed = 0
    for seed in seeds:
        cell, stops = drawn_cell(name, seed)
        draw = np.random.default_rng([seed, 32])
        planner = Planner(cell, clock=lambda: 0.0)
        objective = OBJECTIVES[(seed + CELLS.index(name)) % len(OBJECTIVES)]
        blend = float(draw.uniform(0.01, 0.1))
        asked = {"stations": tuple(stops), "start": "home", "objective": objective}
        resting = planner.plan_program(**asked)
        if not resting.status.ok:
            continue
        passing = planner.plan_program(**asked, blend=blend)
        assert passing.status.ok, passing.status
        costs = [cost(plan, planner, objective) for plan in (passing, resting)]
        assert costs[0] <= costs[1] * (1.0 + 1e-9)
        assert passes_in_order(passing.movements, cell, stops, blend)
        judged(planner, passing.movements)
        passed += len(resting.movements) - len(passing.movements)
        again = planner.plan_program(**asked, blend=blend)
        assert again.program_id == passing.program_id
    assert passed > 0


@pytest.mark.long
@pytest.mark.parametrize("name", ["open", pytest.param("kr6_bench", marks=pytest.mark.long)])
def test_a_cycle_takes_fewer_joules_and_may_be_shorter(name: str) -> None:
    cell, stops = drawn_cell(name, 5, 2)
    planner = Planner(cell, clock=lambda: 0.0)
    asked = {"stations": tuple(stops), "start": "home", "max_iterations": 100_000}
    fastest = planner.plan_program(**asked, objective="time")
    cycle = 1.3 * fastest.report.duration
    resting = planner.plan_program(**asked, cycle_time=cycle)
    passing = planner.plan_program(**asked, cycle_time=cycle, blend=0.05)
    assert passing.report.duration == pytest.approx(resting.report.duration, abs=2e-3)
    assert passing.report.energy <= resting.report.energy * (1.0 + 1e-9)
    assert passes_in_order(passing.movements, cell, stops, 0.05)
    judged(planner, passing.movements)
    quickest = planner.plan_program(**asked, objective="time", blend=0.05)
    assert quickest.report.duration < fastest.report.duration
    between = 0.25 * fastest.report.duration + 0.75 * quickest.report.duration
    if between < fastest.report.duration * 0.999:
        short = planner.plan_program(**asked, cycle_time=between, blend=0.05)
        assert short.status.ok
        assert short.report.duration <= between + 1e-5
        judged(planner, short.movements)
    with pytest.raises(RequestError, match=r"the shortest is \d+\.\d+ s"):
        planner.plan_program(**asked, cycle_time=0.5 * quickest.report.duration, blend=0.05)


def visiting(cell: Cell, stops: list[str], within: float | None, **changed: object) -> Cell:
    steps = [ProgramStep("STATION", name, blend=within) for name in stops]
    steps[1] = replace(steps[1], **changed)
    return replace(cell, program=(*steps, ProgramStep("POSTURE", "home")))


def ends_at(plan: ProgramPlan, name: str) -> bool:
    """Whether a movement ends at a station."""
    return any(
        step.to_station == name and step.kind != MovementKind.PAUSE for step in plan.movements
    )


@pytest.mark.long
def test_where_something_happens_the_robot_stands_still() -> None:
    cell, stops = drawn_cell("open", 2)
    middle = stops[1]
    passing = Planner(visiting(cell, stops, 0.08), clock=lambda: 0.0).plan_program(**LITTLE)
    rests = [step.kind for step in passing.movements].count(MovementKind.PAUSE)
    assert rests == 0
    dwelling = Planner(visiting(cell, stops, 0.08, dwell=1.0), clock=lambda: 0.0).plan_program(
        **LITTLE
    )
    assert ends_at(dwelling, middle)
    standing = Planner(visiting(cell, stops, 0.08, blend=0.0), clock=lambda: 0.0).plan_program(
        **LITTLE
    )
    assert ends_at(standing, middle)
    assert len(standing.movements) > len(passing.movements)
    as_stations = tuple(
        replace(station, blend=0.08 if station.name in stops else 0.0) for station in cell.stations
    )
    said = replace(visiting(cell, stops, None), stations=as_stations)
    read = cell_from_yaml(cell_to_yaml(said), "said.yaml")
    by_station = Planner(read, clock=lambda: 0.0).plan_program(**LITTLE)
    assert by_station.program_id == passing.program_id


def test_contacts_of_one_station_hold_in_a_joined_movement() -> None:
    cell, stops = drawn_cell("open", 2)
    body = cell.equipment[0].bodies[0].name
    contact = (AllowedContact("t_part", body, 0.005),)
    own = tuple(
        replace(station, allowed_contacts=contact, approach_distance=0.1)
        if station.name in stops[:2]
        else station
        for station in cell.stations
    )
    planner = Planner(replace(cell, stations=own), clock=lambda: 0.0)
    plan = planner.plan_program(stations=tuple(stops), start="home", blend=0.08, **LITTLE)
    assert plan.status.ok
    joined = 0
    for step in plan.movements:
        assert step.report.certified
        leaving = step.kind == MovementKind.SERVICE_EXIT
        entering = step.kind == MovementKind.SERVICE_ENTRY
        expected = step.from_station if leaving else step.to_station if entering else ""
        assert station_of(step) == expected
        joined += step.from_station != step.to_station and (leaving or entering)
        scene = planner.scene()
        again = evaluate_trajectory(step.trajectory, scene, MARGIN, station_of(step))
        assert again.verification.certified
    assert joined > 0


@pytest.mark.long
@pytest.mark.parametrize("style", ["spline", pytest.param("kss8", marks=pytest.mark.long)])
def test_a_passed_stop_is_written_as_krl_and_driven_without_a_rest_there(style: str) -> None:
    cell, stops = drawn_cell("open", 2)
    planner = Planner(cell, clock=lambda: 0.0)
    plan = planner.plan_program(stations=tuple(stops), start="home", blend=0.08, **LITTLE)
    written = export_krl(planner, plan.movements, "passing", style=style)
    assert written.exported.certified
    assert any(step.passes for step in plan.movements)
    assert passes_in_order(written.steps, cell, stops, 0.08 + 0.011)


def test_what_makes_no_sense_is_refused_with_value_and_bound() -> None:
    planner = Planner("open", clock=lambda: 0.0)
    for wrong in (-0.5, 1.5, float("nan"), "near"):
        with pytest.raises(RequestError, match=r"blend is .*: it must be"):
            planner.plan_program(stations=("p1", "p2"), blend=wrong)
    with pytest.raises(InvalidValueError, match=r"blend is 0.1 m at posture home.*dwells 2 s"):
        ProgramStep("POSTURE", "home", dwell=2.0, blend=0.1)
    with pytest.raises(InvalidValueError, match="sets signals"):
        ProgramStep("POSTURE", "home", set_signals=(Signal("a"),), blend=0.1)
    with pytest.raises(InvalidValueError, match="blend"):
        ProgramStep("STATION", "p1", blend=2.0)
    with pytest.raises(InvalidValueError, match="only stations and postures"):
        ProgramStep("PATH", "seam", blend=0.1)
    text = cell_to_yaml(
        replace(load_cell("open"), program=(ProgramStep("POSTURE", "home", blend=0.5),))
    )
    for good, bad, said in (
        ("blend: 0.5", "blend: 1.5", r"blend is 1.5 m, must be in \[0, 1\] m"),
        ("blend: 0.5", "blend: 0.5, dwell: 2", "dwells 2 s"),
    ):
        assert good in text
        with pytest.raises(CellFileError, match=said):
            cell_from_yaml(text.replace(good, bad), "blend.yaml")
