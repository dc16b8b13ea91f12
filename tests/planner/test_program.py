"""The demonstration program: all movements certified, parts in hand where they should be, one
id.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, PowerData, ProgramStep, load_cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_planner.errors import CancelledError, RequestError
from ir_planner.planner import Planner
from ir_planner.program.program import ProgramPlan, ProgramRequest, plan_program
from ir_planner.program.station_chain import TOLERANCE, layers_of
from ir_planner.program.steps import Route, Scenes, placed_steps, steps_of
from ir_planner.regional.regional import plan_to_configurations
from ir_planner.request.context import Context, Journal, Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.search.registry import registered
from ir_planner.service.exit_paths import EXIT_SEARCHES
from ir_planner.service.service_lines import timed_service
from ir_planner.settings import PlannerSettings


def no_progress(phase: str, done: int, total: int, cost: float) -> None:
    """Nobody listens."""


def planned(
    cell: Cell, power: PowerData, *stations: str, cycle_time: float = 0.0, **choices: Any
) -> ProgramPlan:
    choices = {"planning_time": 60.0, **choices}
    request = ProgramRequest(
        cell, power, stations, np.array(cell.machine_home), PlanOptions(**choices), cycle_time
    )
    return plan_program(request, Work(100_000, 1.0, lambda: 0.0), no_progress)


@pytest.fixture(scope="module")
def demo(demo_cell: Cell, power: PowerData) -> ProgramPlan:
    plan = planned(demo_cell, power)
    assert plan.status.ok, plan.status.message
    return plan


@pytest.mark.long
def test_an_answer_names_its_timing(demo: ProgramPlan, demo_cell: Cell, power: PowerData) -> None:
    assert demo.info.timing == "synchronous"
    alone = {
        "timing": "asynchronous",
        "planner_id": "direct",
        "load": "none",
    }  # torque for laws of their own
    own = planned(demo_cell, power, "home", "park", "home", **alone)
    assert own.info.timing == "asynchronous"


def test_every_movement_is_certified_and_costs_joules(demo: ProgramPlan) -> None:
    moves = [movement for movement in demo.movements if not movement.is_pause]
    assert len(moves) > 10
    for movement in moves:
        assert movement.report.certified
        assert movement.report.energy > 0.0
        assert movement.trajectory is not None
        assert movement.trajectory_id == movement.trajectory.trajectory_id
        assert movement.duration == movement.trajectory.duration
    assert demo.report.certified
    assert demo.report.energy == pytest.approx(
        sum(movement.report.energy for movement in demo.movements)
    )
    assert demo.report.duration == pytest.approx(
        sum(movement.duration for movement in demo.movements)
    )


def test_each_movement_starts_where_the_last_one_ended(demo: ProgramPlan, demo_cell: Cell) -> None:
    ends = [
        movement.trajectory.positions[[0, -1]]
        for movement in demo.movements
        if movement.trajectory is not None
    ]
    assert np.array_equal(ends[0][0], demo_cell.machine_home)
    for before, after in pairwise(ends):
        assert np.array_equal(before[1], after[0])


def test_the_part_is_in_the_hand_between_fetching_and_putting_down(demo: ProgramPlan) -> None:
    held = False
    for movement in demo.movements:
        assert movement.load == ("gripper+gear" if held else "gripper")
        if movement.attach:
            assert (movement.attach, movement.to_station) == ("gear", "infeed_pick")
            held = True
        if movement.detach:
            assert (movement.detach, movement.to_station) == ("gear", "outfeed_place")
            held = False
    assert not held


def test_stations_are_entered_and_left_in_a_straight_line_with_their_contacts_named(
    demo: ProgramPlan, demo_scene: Any
) -> None:
    kinds = (MovementKind.SERVICE_ENTRY, MovementKind.SERVICE_EXIT)
    service = [m for m in demo.movements if m.kind in kinds and m.to_station != "washer_rinse"]
    assert {m.to_station for m in service} == {
        "infeed_pick",
        "lathe_work",
        "gauge_measure",
        "outfeed_place",
    }
    for movement in service:
        station = demo_scene.station(movement.to_station)
        assert movement.trajectory is not None
        q = movement.trajectory.sample(np.linspace(0.0, movement.duration, 200)).q
        tcp = demo_scene.chain.tcp_poses(q)[:, :3, 3] - np.asarray(station.pose)[:3, 3]
        along = tcp @ np.asarray(station.pose)[:3, 0]
        aside = tcp - along[:, None] * np.asarray(station.pose)[:3, 0]
        assert np.abs(aside).max() < 1e-3
        assert along.min() == pytest.approx(-station.approach_distance, abs=1e-6)
        assert along.max() == pytest.approx(0.0, abs=1e-6)
    contacts = {(c.body_a, c.body_b) for m in service for c in m.report.contacts}
    assert ("gear_held", "lathe_spindle") in contacts
    assert all(contact.allowed_contact for m in service for contact in m.report.contacts)


def test_signals_and_pauses_stand_where_the_program_says(demo: ProgramPlan) -> None:
    texts = [(m.wait_for, m.set_signals) for m in demo.movements]
    assert [wait for wait, _ in texts if wait] == [
        ("lathe_door_open",),
        ("lathe_done",),
        ("conveyor_free",),
    ]
    assert ("lathe_open_door=0", "lathe_start=0") in [signals for _, signals in texts]
    rests = [(m.duration, m.power_mode) for m in demo.movements if m.power_mode]
    assert rests == [(180.0, "BUS_POWER_OFF"), (1800.0, "HIBERNATION")]
    for movement in demo.movements:
        if movement.is_pause and movement.duration > 0.0:
            assert movement.report.energy > 0.0


def test_reports_say_the_safety_distance_that_was_planned_with(demo: ProgramPlan) -> None:
    moving = {m.report.safety_distance for m in demo.movements if not m.is_pause}
    assert moving == {demo.report.safety_distance} == {PlanOptions().safety_distance}


def test_the_same_program_has_the_same_id(demo_cell: Cell, power: PowerData) -> None:
    stations = ("infeed_pick", "home")
    once = planned(demo_cell, power, *stations)
    assert planned(load_cell("demo"), power, *stations).program_id == once.program_id
    slower = planned(demo_cell, power, *stations, velocity_scaling=0.5)
    assert slower.program_id != once.program_id


def test_a_program_takes_no_duration_of_a_movement(demo_cell: Cell, power: PowerData) -> None:
    with pytest.raises(RequestError, match="duration is 5 s: a program has a cycle_time"):
        planned(demo_cell, power, "home", "park", duration=5.0)


def test_progress_gives_the_cost_of_the_chain_to_the_end(demo_cell: Cell, power: PowerData) -> None:
    heard: dict[str, list[float]] = {}
    request = ProgramRequest(
        demo_cell, power, ("home", "gauge_measure"), np.array(demo_cell.machine_home), PlanOptions()
    )
    plan_program(
        request,
        Work(100_000, 1.0, lambda: 0.0),
        lambda phase, done, total, cost: heard.setdefault(phase, []).append(cost),
    )
    assert heard["movements"] == pytest.approx(
        [heard["station graph"][-1]] * len(heard["movements"])
    )
    assert heard["movements"][0] > 0.0


def test_a_station_that_nobody_reaches_fails_with_its_name(
    demo_cell: Cell, power: PowerData
) -> None:
    shut = demo_cell.with_equipment("lathe", state="door_closed")
    plan = planned(shut, power, "lathe_work")
    assert plan.status.code in (StatusCode.GOAL_IN_COLLISION, StatusCode.PLANNING_FAILED)
    assert "lathe_work" in plan.status.message
    assert plan.movements == ()


def test_an_unknown_station_lists_the_known(demo_cell: Cell, power: PowerData) -> None:
    with pytest.raises(RequestError, match="infeed_pick, lathe_work"):
        planned(demo_cell, power, "moon")


def test_progress_is_reported_and_a_cancel_stops(demo_cell: Cell, power: PowerData) -> None:
    heard: list[str] = []
    stations = ("infeed_pick", "home")
    home = np.array(demo_cell.machine_home)
    request = ProgramRequest(demo_cell, power, stations, home, PlanOptions())
    budget = Work(100_000, 1.0, lambda: 0.0, lambda: "movements" in heard)
    with pytest.raises(CancelledError):
        plan_program(request, budget, lambda phase, done, total, cost: heard.append(phase))
    assert heard.index("configurations") < heard.index("station graph") < heard.index("movements")


def test_automatic_pauses_take_the_cheapest_mode(power: PowerData) -> None:
    from ir_description import cell_from_yaml, cell_to_yaml

    text = cell_to_yaml(load_cell("demo"))
    assert "power_mode: BUS_POWER_OFF" in text
    cell = cell_from_yaml(text.replace("power_mode: BUS_POWER_OFF", "power_mode: AUTO"))
    pauses = tuple(step for step in cell.program if step.kind == "PAUSE")
    plan = planned(replace(cell, program=pauses), power)
    chosen = [movement.power_mode for movement in plan.movements if movement.duration == 180.0]
    assert chosen == ["STAND_ON_BRAKES>BUS_POWER_OFF"]


@pytest.mark.parametrize("lengths", [(0.01,), (10.0,), (3.0, 60.0, 600.0)])
def test_a_program_of_pauses_alone_has_their_joules(
    lengths: tuple[float, ...], demo_cell: Cell
) -> None:
    """Also held against the common program, which waits as long: both have nothing to slow down."""
    steps = tuple(ProgramStep("PAUSE", dwell=each, power_mode="AUTO") for each in lengths)
    plan = Planner(replace(demo_cell, program=steps)).plan_program(savings=True)
    assert all(step.is_pause for step in plan.movements)
    assert plan.report.duration == pytest.approx(sum(lengths))
    assert plan.report.energy == pytest.approx(sum(s.report.energy for s in plan.movements))
    assert plan.report.energy > 0.0
    assert plan.report.energy_low <= plan.report.energy <= plan.report.energy_high
    assert plan.report.certified
    assert plan.savings.sentence.startswith("no movements; pauses ")
    assert plan.savings.movements.common == plan.savings.movements.planned == 0.0


@pytest.mark.parametrize("cut", [1, 2])
def test_a_program_is_truncated_when_time_runs_out_before_its_movements_are_planned(
    cut: int,
) -> None:
    """Time stands until the graph has been looked at `cut` times, then the ceiling has passed."""
    now = [0.0]
    planner = Planner("demo", clock=lambda: now[0])
    stations = ("park", "home", "park")
    start = np.array(planner.cell.machine_home)

    def plan(last: int) -> ProgramPlan:
        heard: list[str] = []

        def progress(phase: str, done: int, total: int, cost: float) -> None:
            assert total == len(stations)
            heard.append(phase)
            now[0] = 1000.0 if heard.count("station graph") >= last else 0.0

        now[0] = 0.0
        return planner.plan_program(
            stations=stations,
            options=PlanOptions(planning_time=300.0),
            start=start,
            progress=progress,
        )

    whole = plan(1000)
    assert not whole.info.truncated
    found = plan(cut)
    assert found.status.ok, found.status.message
    assert found.info.truncated
    assert found.info.iterations < whole.info.iterations


def test_the_chain_is_the_cheapest_of_all_that_the_planner_can_move_along(
    demo_cell: Cell, power: PowerData
) -> None:
    """Every movement between all configurations of two stations, planned one by one."""
    stations = ("infeed_pick", "gauge_measure")
    plan = planned(demo_cell, power, *stations)
    assert plan.status.ok, plan.status.message
    options = PlanOptions(planning_time=60.0, time_value=500.0)

    def cost(report: TrajectoryReport) -> float:
        return report.energy - report.base_energy + options.time_value * report.duration

    def asked(scene: PlanningScene) -> Context:
        return Context(scene, options, Journal(Work(10**7, np.inf, lambda: 0.0), 0))

    steps = placed_steps(demo_cell, steps_of(demo_cell, stations), demo_cell.parts_at_start())
    scenes = Scenes(demo_cell, power, PlannerSettings().drives(demo_cell.robot))
    route = Route.over(steps, scenes)
    home = np.array(demo_cell.machine_home)
    layers = layers_of(route, home, asked(route.arriving(0)), EXIT_SEARCHES, no_progress)
    total = {-1: 0.0}  # of the cheapest chain to each configuration of a stop
    for hop in range(2):
        scene = route.arriving(hop)
        cheapest = {}
        for b, there in enumerate(layers[hop + 1]):
            entry = timed_service(there.line, True, asked(scene).at(stations[hop])).report
            for a, before in total.items():
                here = layers[hop][max(a, 0)]
                across = plan_to_configurations(
                    here.departure, there.arrival[None], asked(scene), registered()
                )
                chain = before + cost(across.report) + cost(entry)
                if hop:
                    line = timed_service(here.line, False, asked(scene).at(stations[hop - 1]))
                    chain += cost(line.report)
                cheapest[b] = min(chain, cheapest.get(b, np.inf))
        total = cheapest
    found = sum(cost(movement.report) for movement in plan.movements if not movement.is_pause)
    assert found <= min(total.values()) * (1.0 + 1.01 * TOLERANCE)
    assert min(total.values()) < 0.9 * max(total.values())  # choosing mattered


def test_with_movement_cost_the_chain_is_the_shortest_path_of_eq_9(
    demo_cell: Cell, power: PowerData
) -> None:
    plan = planned(demo_cell, power, "gauge_measure", "park", objective="movement_cost")
    assert plan.status.ok, plan.status.message
    scene = scene_with(
        demo_cell, load_text(demo_cell), power, PlannerSettings().drives(demo_cell.robot)
    )
    home = np.array(demo_cell.machine_home)
    park = np.array(demo_cell.park)
    steps = placed_steps(
        demo_cell, steps_of(demo_cell, ("gauge_measure",)), demo_cell.parts_at_start()
    )
    route = Route.over(steps, Scenes(demo_cell, power, PlannerSettings().drives(demo_cell.robot)))
    context = Context(scene, PlanOptions(), Journal(Work(10**7, np.inf, lambda: 0.0), 0))
    nodes = layers_of(route, home, context, EXIT_SEARCHES, no_progress)[1]
    costs = [
        float(
            (np.abs(node.arrival - home) + np.abs(node.departure - park)) @ scene.weights
            + 2.0 * np.abs(np.diff(node.line.points, axis=0)).sum(axis=0) @ scene.weights
        )
        for node in nodes
    ]
    entry = next(m for m in plan.movements if m.kind == MovementKind.SERVICE_ENTRY)
    assert entry.trajectory is not None
    at = np.array(
        [np.abs(node.interaction - entry.trajectory.positions[-1]).max() for node in nodes]
    )
    assert costs[int(np.argmin(at))] == pytest.approx(min(costs))


def test_the_answer_does_not_depend_on_the_number_of_cores(
    demo_cell: Cell, power: PowerData, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = []
    for cores in (1, 2, 5):
        monkeypatch.setattr("os.sched_getaffinity", lambda _, cores=cores: set(range(cores)))
        ids.append(planned(demo_cell, power, "infeed_pick", "park").program_id)
    assert len(set(ids)) == 1


def test_a_program_has_the_work_of_one_movement_for_each_of_its_steps(demo_cell: Cell) -> None:
    """Each movement goes on while its own work lasts, and what the program reports is the sum."""
    planner = Planner("demo", clock=lambda: 0.0)
    start = np.array(demo_cell.machine_home)
    most = 20_000
    one, three = (
        planner.plan_program(
            stations=stations, options=PlanOptions(max_iterations=most), start=start
        ).info.iterations
        for stations in (("park",), ("park", "home", "park"))
    )
    assert one <= most < three <= 3 * most


@pytest.mark.parametrize(
    ("seconds", "mode", "planned", "said"),
    [
        (60.0, "HIBERNATION", "STAND_ON_BRAKES", "a pause of 60 s is too short for HIBERNATION"),
        (1.0, "BUS_POWER_OFF", "STAND_ON_MOTORS", "a pause of 1 s is too short for BUS_POWER_OFF"),
        (100.0, "STAND_ON_MOTORS", "STAND_ON_BRAKES", "longer than the controller stands on"),
        (90.0, "BUS_POWER_OFF", "BUS_POWER_OFF", ""),
        (60.0, "AUTO", "STAND_ON_BRAKES", ""),
    ],
)
def test_a_pause_that_is_planned_in_another_mode_is_said(
    seconds: float, mode: str, planned: str, said: str
) -> None:
    cell = load_cell("open")
    home = ProgramStep("POSTURE", "home")
    pause = ProgramStep("PAUSE", dwell=seconds, power_mode=mode)
    planner = Planner(replace(cell, program=(home, pause)), clock=lambda: 0.0)
    plan = planner.plan_program(start=planner.cell.posture("park"))
    (rest,) = (step for step in plan.movements if step.is_pause)
    assert rest.power_mode == planned
    assert said in plan.status.message
    assert ("it is planned in" in plan.status.message) == bool(said)
