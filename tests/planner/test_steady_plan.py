"""The cheapest steady cycle of the bundled flexible cell: certified, in step with its machines,
within its throughput; and the laws that it keeps.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from tending import LITTLE, steady

from ir_description import (
    Cell,
    ProgramStep,
    cell_from_yaml,
    cell_hash,
    cell_to_yaml,
    check_cell,
    load_cell,
)
from ir_msgs_py.report import PlannedMovement
from ir_planner import CancelledError, Planner, RequestError, SteadyPlan
from ir_planner.cycle import fastest_cycle
from ir_planner.flexible import steady_plan
from ir_planner.flexible.steady_plan import machine_bars

CELL = load_cell("flexible")
PAGE = Path(__file__).parents[2] / "docs" / "flexible.md"
ROUNDING = 1e-3  # s: durations are whole nanoseconds, slowed down by millionths
SETTLED = 0.005  # of the energy: two plans of slightly different durations, each within its gap


@cache
def planned(parts_per_hour: float, lathe: float = 95.0) -> SteadyPlan:
    machines = tuple(
        replace(machine, process=lathe) if machine.name == "lathe" else machine
        for machine in CELL.equipment
    )
    return steady(replace(CELL, equipment=machines), parts_per_hour=parts_per_hour)


@cache
def at_thirty() -> SteadyPlan:
    """The plan that most tests look at, with its saving and two cycles of a run."""
    return steady(CELL, parts_per_hour=30.0, saving=True, cycles=2)


@cache
def lathe_line(visits: tuple[str, ...], capacity: int, parts_per_hour: float) -> SteadyPlan:
    """With a lathe that works on so many parts at once."""
    cell = routed(CELL, visits)
    machines = tuple(
        replace(machine, capacity=capacity) if machine.name == "lathe" else machine
        for machine in cell.equipment
    )
    cell = replace(cell, equipment=machines)
    return steady(cell, parts_per_hour=parts_per_hour, saving=True, cycles=2)


LATHE = ("infeed_pick", "lathe_chuck", "outfeed_place")
WHOLE = ("infeed_pick", "lathe_chuck", "washer_basket", "gauge_seat", "outfeed_place")
LINES = [LATHE, pytest.param(WHOLE, marks=pytest.mark.long)]


def tended(visits: tuple[str, ...]) -> list[str]:
    """The machines of a line whose lathe has two places, by the names of their slots."""
    others = [CELL.station(name).equipment for name in visits[2:-1]]
    return ["lathe.1", "lathe.2", *others]


@pytest.mark.long
@pytest.mark.parametrize("visits", LINES)
def test_a_lathe_for_two_parts_is_twice_as_soon_and_no_dearer(visits: tuple[str, ...]) -> None:
    plan = lathe_line(visits, 2, 45.0)
    for_one = lathe_line(visits, 1, 30.0)
    assert plan.cycle is not None
    assert plan.cycle.seconds_per_part <= 80.0 + ROUNDING < for_one.fastest
    assert plan.joules < for_one.joules
    assert plan.gap < 1.0
    assert plan.cycle.most == (2, *(1 for _ in visits[2:-1]))


@pytest.mark.long
@pytest.mark.parametrize("visits", LINES)
def test_bars_of_a_machine_are_its_work_and_no_more_parts_than_it_works_on(
    visits: tuple[str, ...],
) -> None:
    plan = lathe_line(visits, 2, 45.0)
    assert plan.cycle is not None
    bars = machine_bars(plan)
    assert list(bars) == tended(visits)
    for name, own in bars.items():
        machine = name.partition(".")[0]
        parts = 1 if machine == "lathe" else 2
        worked = sum(length for _, length in own)
        assert worked == pytest.approx(parts * CELL.machine(machine).process)
        for moment in np.linspace(0.0, plan.cycle.period, 500):
            assert sum(begin < moment < begin + length for begin, length in own) <= 1


@pytest.mark.long
def test_movements_depend_neither_on_how_long_machines_work_nor_on_what_they_hold() -> None:
    """What the tests of this folder share."""
    cell = routed(CELL, ("infeed_pick", "gauge_seat", "outfeed_place"))
    machines = tuple(
        replace(machine, process=33.0, capacity=2, buffer=1) if machine.process else machine
        for machine in cell.equipment
    )
    steady(cell)
    shared = steady(replace(cell, equipment=machines), cycles=2)
    own = Planner(replace(cell, equipment=machines), clock=lambda: 0.0)
    alone = own.plan_steady_cycle(cycles=2, max_iterations=LITTLE)
    for one, other in ((shared.program, alone.program), (shared.run, alone.run)):
        assert one is not None
        assert other is not None
        assert one.program_id == other.program_id


@pytest.fixture
def searching(monkeypatch: pytest.MonkeyPatch) -> Event:
    """Set when the search for a cycle begins, of movements that are known."""
    at_thirty()
    begun = Event()

    def fastest(*what: Any, **named: Any) -> Any:
        begun.set()
        return fastest_cycle(*what, **named)

    monkeypatch.setattr(steady_plan, "fastest_cycle", fastest)
    return begun


@pytest.mark.long
def test_the_search_for_a_cycle_ends_on_request(searching: Event) -> None:
    with pytest.raises(CancelledError):
        steady(CELL, parts_per_hour=30.0, cancelled=searching.is_set)


@pytest.mark.long
def test_two_parts_a_cycle_are_searched_for_until_the_time_is_up(searching: Event) -> None:
    plan = steady(CELL, clock=lambda: 1e6 * searching.is_set(), parts_per_hour=30.0, units=2)
    assert plan.info.truncated
    assert plan.cycle is not None
    assert plan.cycle.units == 1
    assert plan.joules == pytest.approx(at_thirty().joules, rel=SETTLED)


@pytest.mark.parametrize("visits", LINES)
def test_a_lathe_for_two_parts_has_a_program_that_is_certified_and_read_back(
    visits: tuple[str, ...],
) -> None:
    plan = lathe_line(visits, 2, 45.0)
    assert plan.cycle is not None
    assert plan.program is not None
    assert plan.cell is not None
    assert plan.run_cell is not None
    assert plan.run is not None
    assert plan.saving is not None
    steps = (*plan.program.movements, *plan.run.movements)
    assert all(step.report.certified for step in steps if step.trajectory is not None)
    assert plan.program.report.duration == pytest.approx(plan.cycle.period, abs=ROUNDING)
    awaited = {name for step in plan.program.movements for name in step.wait_for}
    assert awaited == {f"{name}.done" for name in tended(visits)}
    assert plan.saving.common > plan.saving.joules
    assert plan.saving.common_period >= plan.cycle.period - ROUNDING
    for cell in (plan.cell, plan.run_cell):
        again = cell_from_yaml(cell_to_yaml(cell))
        assert again.program == cell.program
        assert cell_hash(again) == cell_hash(cell)


def test_a_program_in_which_slots_take_long_to_repeat_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(steady_plan, "_PARTS_MAX", 1)
    machines = tuple(
        replace(machine, buffer=1) if machine.name == "lathe" else machine
        for machine in CELL.equipment
    )
    with pytest.raises(RequestError, match="2 parts until all have used their slots in turn"):
        steady(replace(CELL, equipment=machines))


def test_machines_that_can_be_full_in_too_many_ways_are_refused_before_anything_is_planned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(steady_plan, "_CONTENTS_MAX", 700)
    monkeypatch.setattr(steady_plan, "planned_columns", None)
    machines = tuple(
        replace(machine, capacity=4, buffer=4) if machine.process else machine
        for machine in CELL.equipment
    )
    planner = Planner(replace(CELL, equipment=machines), clock=lambda: 0.0)
    with pytest.raises(RequestError, match="can hold parts in 729 ways, at most 700"):
        planner.plan_steady_cycle()


def without(cell: Cell, name: str) -> Cell:
    """The cell with a machine that is switched off."""
    machines = tuple(replace(machine, enabled=machine.name != name) for machine in cell.equipment)
    return replace(cell, equipment=machines)


@pytest.mark.parametrize("name", ["infeed", "lathe", "gauge"])
def test_a_machine_that_is_switched_off_is_not_visited(name: str) -> None:
    planner = Planner(without(CELL, name), clock=lambda: 0.0)
    with pytest.raises(RequestError, match=f"of {name}, which is switched off"):
        planner.plan_steady_cycle()


def test_every_movement_is_certified_and_the_robot_is_back_where_it_began() -> None:
    plan = at_thirty()
    assert plan.program is not None
    assert plan.cycle is not None
    moves = [step for step in plan.program.movements if step.trajectory is not None]
    assert all(step.report.certified for step in moves)
    ends = [(s.trajectory.positions[0], s.trajectory.positions[-1]) for s in moves if s.trajectory]
    for (_, end), (begin, _) in zip(ends, [*ends[1:], ends[0]], strict=True):
        assert np.abs(end - begin).max() < 1e-9
    assert plan.program.report.duration == pytest.approx(plan.cycle.period, abs=ROUNDING)
    assert plan.cycle.period <= 120.0 + ROUNDING
    assert plan.gap < 1.0


def begun(step: PlannedMovement) -> list[str]:
    """Signals that start a machine when the step has ended."""
    return [name for name in step.set_signals if name.endswith(".start")]


def test_a_run_fills_the_line_from_empty_and_comes_into_the_planned_cycle() -> None:
    """From its steps alone: no part is taken before it is finished, none put where one lies, the
    first station always has one, and the last cycles are the planned one.
    """
    plan = at_thirty()
    assert plan.cycle is not None
    assert plan.run is not None
    assert plan.run_cell is not None
    visits = CELL.route.visits if CELL.route else ()
    here = 0.0
    places = plan.run_cell.parts_at_start()
    assert [station for station in places.lying.values() if station] == [visits[0]]
    ready: dict[str, float] = {}
    left = []
    for step in plan.run.movements:
        for name in step.wait_for:
            assert here >= ready.pop(name.removesuffix(".done")) - ROUNDING
        here += step.duration
        if step.attach or step.detach:
            target = step.to_station
            places = places.after(
                ProgramStep("STATION", target, attach=step.attach, detach=step.detach)
            )
            assert visits[0] in places.lying.values() or places.held
            left += [here] if step.detach and target == visits[-1] else []
        for name in begun(step):
            machine = name.removesuffix(".start")
            ready[machine] = here + CELL.machine(machine).process
        assert step.trajectory is None or step.report.certified
    assert len(left) == 2
    assert left[1] - left[0] == pytest.approx(plan.cycle.period, abs=10.0 * ROUNDING)
    assert max(step.duration for step in plan.run.movements) <= 95.0 + ROUNDING
    again = cell_from_yaml(cell_to_yaml(plan.run_cell))
    assert again.program == plan.run_cell.program


def test_the_program_waits_for_every_machine_at_least_as_long_as_it_works() -> None:
    """From the steps alone, in a cycle that runs on and on."""
    plan = at_thirty()
    assert plan.program is not None
    here = 0.0
    started: dict[str, float] = {}
    awaited: dict[str, float] = {}
    for step in plan.program.movements:
        awaited |= {name.removesuffix(".done"): here for name in step.wait_for}
        here += step.duration
        started |= {name.removesuffix(".start"): here for name in begun(step)}
    process = {machine.name: machine.process for machine in CELL.equipment if machine.process}
    assert set(started) == set(awaited) == set(process)
    for name, seconds in process.items():
        after = (awaited[name] - started[name]) % here
        assert after >= seconds - ROUNDING


@pytest.mark.long
def test_energy_per_part_never_rises_when_the_throughput_falls() -> None:
    joules = []
    for rate in (33.4, 32.0, 30.0, 25.0, 20.0):
        cycle = planned(rate).cycle
        assert cycle is not None
        joules.append(cycle.joules)
    for faster, slower in itertools.pairwise(joules):
        assert slower <= faster * (1.0 + SETTLED)


@pytest.mark.long
def test_a_faster_machine_never_makes_it_dearer() -> None:
    faster = planned(30.0, 80.0).cycle
    slower = planned(30.0).cycle
    assert faster is not None
    assert slower is not None
    assert faster.joules <= slower.joules * (1.0 + SETTLED)


def test_more_than_the_machines_can_make_is_refused_with_the_most() -> None:
    with pytest.raises(
        RequestError, match=r"parts_per_hour is 40, .* at most 33\.\d+ are possible"
    ):
        planned(40.0)
    with pytest.raises(RequestError, match=r"parts_per_hour is -1: it must be in \[0, 3600\]"):
        planned(-1.0)


def test_a_cell_without_a_route_is_refused_with_what_to_write() -> None:
    with pytest.raises(RequestError, match="cell demo has no route: say which stations"):
        Planner("demo").plan_steady_cycle(parts_per_hour=1.0)


def test_the_saving_names_its_baseline_and_holds_zero_only_where_it_says_so() -> None:
    saving = at_thirty().saving
    assert saving is not None
    assert saving.low <= saving.common - saving.joules <= saving.high
    assert saving.joules < saving.common < saving.on_motors
    assert "the controller's own timers" in saving.sentence


@pytest.mark.long
def test_the_page_s_figures_are_those_that_are_planned() -> None:
    plan = steady(CELL, work=0, parts_per_hour=30.0, saving=True)
    saving = plan.saving
    assert saving is not None
    assert plan.cycle is not None
    saved = saving.common - saving.joules
    text = PAGE.read_text("utf-8")
    for figure in (
        f"at least 30 parts an hour | {plan.cycle.period:.2f} s | {saving.joules / 1e3:.2f} |",
        f"own timers | {saving.common_period:.2f} s | {saving.common / 1e3:.2f} |",
        f"always on motors | {saving.common_period:.2f} s | {saving.on_motors / 1e3:.2f} |",
        f"{100.0 * saved / saving.common:.1f} % less ({saved / 1e3:.1f} kJ, 90 % interval "
        f"{saving.low / 1e3:.1f} to {saving.high / 1e3:.1f} kJ)",
        f"takes {plan.fastest:.2f} s ({3600.0 / plan.fastest:.1f} parts an hour)",
    ):
        assert figure in text


@pytest.mark.long
def test_the_cycle_is_written_as_a_cell_that_is_planned_as_a_program() -> None:
    plan = at_thirty()
    assert plan.cell is not None
    assert plan.cycle is not None
    again = cell_from_yaml(cell_to_yaml(plan.cell))
    assert [finding.severity for finding in check_cell(again)].count("error") == 0
    assert len([step for step in again.program if step.attach]) == len(plan.cycle.visits)
    program = Planner(again, clock=lambda: 0.0).plan_program(max_iterations=LITTLE)
    assert program.status.ok, program.status.message


def routed(cell: Cell, visits: tuple[str, ...]) -> Cell:
    assert cell.route is not None
    names = [cell.station(name).equipment for name in visits[1:-1]]
    machines = tuple(
        machine if machine.name in names else replace(machine, process=0.0)
        for machine in cell.equipment
    )
    return replace(cell, equipment=machines, route=replace(cell.route, visits=visits))


@pytest.mark.long
def test_one_machine_alone_is_tended_too() -> None:
    cell = routed(CELL, ("infeed_pick", "gauge_seat", "outfeed_place"))
    plan = steady(cell)
    assert plan.cycle is not None
    assert plan.cycle.order == ((0, 0), (1, 0))
    assert plan.cycle.period >= 12.0


@pytest.mark.long
@pytest.mark.parametrize("over", [pytest.param(1.05, marks=pytest.mark.long), 1.5])
def test_fixed_order_and_no_process_cost_what_a_planned_program_costs(over: float) -> None:
    """One machine that takes no time leaves one order: the cycle is a program of its own period."""
    cell = routed(CELL, ("infeed_pick", "gauge_seat", "outfeed_place"))
    machines = tuple(
        replace(machine, process=1e-3) if machine.process else machine for machine in cell.equipment
    )
    cell = replace(cell, equipment=machines)
    fastest = steady(cell, work=0).fastest
    plan = steady(cell, work=0, parts_per_hour=3600.0 / (over * fastest))
    assert plan.cycle is not None
    assert plan.cell is not None
    assert plan.request is not None
    program = Planner(plan.cell, clock=lambda: 0.0).plan_program(
        cycle_time=plan.cycle.period, start=plan.request.start
    )
    assert program.status.ok, program.status.message
    assert plan.joules >= program.report.energy * (1.0 - program.gap / 100.0)
    assert plan.joules == pytest.approx(program.report.energy, rel=SETTLED)


@pytest.mark.long
def test_two_units_are_never_dearer_and_every_one_of_their_parts_is_made() -> None:
    cell = routed(CELL, ("infeed_pick", "washer_basket", "gauge_seat", "outfeed_place"))
    one = steady(cell, parts_per_hour=50.0)
    two = steady(cell, parts_per_hour=50.0, units=2, cycles=2)
    assert one.cycle is not None
    assert two.cycle is not None
    assert two.run is not None
    assert two.joules <= one.joules * (1.0 + SETTLED)
    assert two.cycle.seconds_per_part <= 72.0 + ROUNDING
    made = [step for step in two.run.movements if step.detach and step.to_station == cell_end(cell)]
    assert len(made) >= 2 * two.cycle.units


def cell_end(cell: Cell) -> str:
    assert cell.route is not None
    return cell.route.visits[-1]


BUFFERED = {
    "infeed_pick": ((), "raw"),
    "washer_basket": (("raw",), "clean"),
    "gauge_seat": (("clean",), "clean"),  # a buffer beside the washer
    "outfeed_place": (("clean",), ""),
}


def with_buffer(*, at_will: bool) -> Cell:
    """A washer, and the gauge as a place where parts may wait, or have to."""
    visits = tuple(BUFFERED)
    names = {name: BUFFERED.get(name, ((), "")) for name in (s.name for s in CELL.stations)}
    stations = tuple(
        replace(station, takes=names[station.name][0], gives=names[station.name][1])
        for station in CELL.stations
    )
    machines = tuple(
        machine if machine.name == "washer" else replace(machine, process=0.0)
        for machine in CELL.equipment
    )
    assert CELL.route is not None
    route = replace(CELL.route, visits=visits)
    cell = replace(CELL, equipment=machines, stations=stations, route=route)
    return replace(cell, route=replace(route, by_states=True)) if at_will else cell


@pytest.mark.long
def test_a_buffer_is_used_where_that_pays_and_parts_go_through_it() -> None:
    forced = steady(with_buffer(at_will=False), parts_per_hour=30.0, cycles=2)
    chosen = steady(with_buffer(at_will=True), parts_per_hour=30.0)
    assert chosen.stations == ("infeed_pick", "washer_basket", "outfeed_place")  # time to spare
    assert chosen.joules <= forced.joules * (1.0 + SETTLED)
    assert chosen.fastest <= forced.fastest * (1.0 + SETTLED)
    assert forced.stations == tuple(BUFFERED)
    assert forced.run is not None
    names = {name for step in forced.run.movements for name in (*step.wait_for, *step.set_signals)}
    assert {name.partition(".")[0].removeprefix("not ") for name in names} == {"washer"}
    moved = [(step.attach or step.detach, step.to_station) for step in forced.run.movements]
    held = [each for each in moved if each[0]]
    first = [station for part, station in held if part == held[0][0]]
    assert first[:6] == [
        "infeed_pick",
        *("washer_basket",) * 2,
        *("gauge_seat",) * 2,
        "outfeed_place",
    ]


@pytest.mark.long
@pytest.mark.parametrize("name", ["gauge", "washer"])
def test_a_way_by_states_goes_without_a_machine_that_is_switched_off(name: str) -> None:
    cell = without(with_buffer(at_will=True), name)
    if name == "washer":
        with pytest.raises(RequestError, match="of washer, which is switched off"):
            Planner(cell, clock=lambda: 0.0).plan_steady_cycle()
    else:
        assert len(cell.part_routes) == 2
        plan = steady(cell)
        assert plan.stations == ("infeed_pick", "washer_basket", "outfeed_place")
