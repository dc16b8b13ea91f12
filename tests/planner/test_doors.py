"""Doors along a program: the planner counts on no state that the driver's machines might not be
in.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import ProgramStep, load_cell, load_power_data
from ir_msgs_py.announcements import MachineState
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.plc import Signal
from ir_msgs_py.status import StatusCode
from ir_planner import Planner
from ir_planner.current_cell import DriverReports
from ir_planner.program import ProgramPlan, ProgramRequest, plan_program
from ir_planner.program.steps import doors_along
from ir_planner.request import Work, parse_goal
from ir_sim_driver.controller.cell_scene import MachinesInScene

DEMO = load_cell("demo")
OPEN = "lathe_open_door"
IS_OPEN = "lathe_door_open"

steps = st.builds(
    ProgramStep,
    kind=st.just("POSTURE"),
    target=st.sampled_from(["home", "park"]),
    dwell=st.sampled_from([0.0, 1.0, 1.5, 4.0]),
    wait_for=st.lists(st.builds(Signal, st.just(IS_OPEN), st.booleans()), max_size=1).map(tuple),
    set_signals=st.lists(st.builds(Signal, st.just(OPEN), st.booleans()), max_size=2).map(tuple),
)


@given(
    st.lists(steps, max_size=8),
    st.lists(st.floats(0.0, 3.0), min_size=8, max_size=8),
    st.booleans(),
    st.booleans(),
)
@settings(deadline=None)
def test_the_driver_s_machine_is_in_the_planned_states_however_long_movements_take(
    program, seconds, shut, shut_in_the_file
):
    state, written = ("door_closed" if each else "door_open" for each in (shut, shut_in_the_file))
    cell, file = (DEMO.with_equipment("lathe", state=each) for each in (state, written))
    heard = DriverReports(TransitionTimes)
    heard.machines = MachinesInScene(cell).states(0.0)
    along = doors_along(file, program, heard.doors(file))
    machines = MachinesInScene(cell)
    lathe = cell.machine("lathe")
    now = 0.0
    delay = next(signal.delay for signal in cell.signals if signal.name == IS_OPEN)
    due: tuple[float, bool] = (-1.0, not shut)  # when the answer comes, and which
    for step, (before, after), moving in zip(program, along, seconds, strict=False):
        for signal in step.wait_for:
            if signal.value != due[1]:
                return  # it waits forever
            now = max(now, due[0])
        machines.step(now)
        for arrived, doors, wait in ((False, before, moving), (True, after, step.dwell)):
            planned = dict(doors).get("lathe", (written,))
            if arrived:
                for signal in step.set_signals:
                    machines.hear(OPEN, signal.value, now)
                    due = (now + delay, signal.value)
                now += wait
                machines.step(now)
                assert set(machines.present(lathe)) <= set(planned)
            else:
                assert set(machines.present(lathe)) <= set(planned)
                now += wait
                machines.step(now)


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (
            MachineState("lathe", "door_closed"),
            f"lathe is door_closed, as signal {OPEN} has it; {OPEN} turns it",
        ),
        (
            MachineState("lathe", "door_closed", "door_open", 0.7),
            f"to door_open: wait for signal {IS_OPEN}",
        ),
    ],
)
def test_a_door_that_the_driver_says_is_not_open_refuses_the_visit_and_names_the_signal(
    said, sentence
):
    planner = Planner("demo", clock=lambda: 0.0)
    start = np.array(planner.cell.machine_home)
    planner.heard.machines = (said, MachineState("a machine of another cell", "open"))
    plan = planner.plan_program(stations=("lathe_work",), start=start)
    assert plan.status.code in (StatusCode.GOAL_IN_COLLISION, StatusCode.PLANNING_FAILED)
    assert sentence in plan.status.message
    assert [
        "at the start, as the driver says: lathe door_closed" in each.note
        for each in plan.info.stages
    ].count(True) == 1
    planner.heard.machines = (MachineState("lathe", "door_open"),)
    again = planner.plan_program(stations=("lathe_work",), start=start)
    planner.heard.machines = None
    as_the_cell_has_it = planner.plan_program(stations=("lathe_work",), start=start)
    assert again.status.ok
    assert again.program_id == as_the_cell_has_it.program_id


def planned(*program: ProgramStep) -> ProgramPlan:
    cell = replace(DEMO.with_equipment("lathe", state="door_closed"), program=program)
    request = ProgramRequest(
        cell, load_power_data(), (), np.array(cell.machine_home), PlanOptions()
    )
    return plan_program(request, Work(100_000, 1.0, lambda: 0.0))


OPENED = ProgramStep("POSTURE", "home", set_signals=(Signal(OPEN, True),))
HOME = ProgramStep("POSTURE", "home")


def test_a_movement_through_a_door_that_may_be_closed_is_refused_with_the_signal_to_wait_for():
    plan = planned(OPENED, ProgramStep("STATION", "lathe_work"), HOME)
    assert plan.status.code in (StatusCode.GOAL_IN_COLLISION, StatusCode.PLANNING_FAILED)
    assert (
        f"lathe changes from door_closed to door_open: wait for signal {IS_OPEN}"
        in plan.status.message
    )


@pytest.mark.parametrize("wait", [Signal(IS_OPEN, True), None])
def test_a_door_that_was_waited_for_is_relied_upon(wait):
    opened = OPENED if wait else replace(OPENED, dwell=1.5)
    there = ProgramStep("STATION", "lathe_work", wait_for=(wait,) if wait else ())
    plan = planned(opened, there, HOME)
    assert plan.status.ok, plan.status.message
    assert any(movement.states == ("lathe=door_open",) for movement in plan.movements)


def test_a_door_that_closes_on_the_robot_is_refused():
    closing = ProgramStep("STATION", "lathe_work", set_signals=(Signal(OPEN, False),))
    plan = planned(replace(OPENED, dwell=1.5), closing, HOME)
    assert not plan.status.ok
    assert "lathe changes from door_open to door_closed" in plan.status.message


def planner_that_hears(*said: MachineState) -> Planner:
    planner = Planner("demo", clock=lambda: 0.0)
    planner.heard.machines = said
    return planner


SHUT = "lathe is door_closed, as signal lathe_open_door has it; lathe_open_door turns it"


def test_single_movements_and_states_count_with_doors_as_the_driver_says_and_name_them():
    planner = planner_that_hears(MachineState("lathe", "door_open"))
    home = np.array(planner.cell.machine_home)
    options = PlanOptions()
    there = parse_goal("lathe_work", planner.cell)
    found = planner.plan_regional(start=home, goal=there, options=options)
    assert found.trajectory is not None
    inside = found.trajectory.positions[-1]
    planner.heard.machines = (MachineState("lathe", "door_closed"),)
    refused = planner.plan_regional(start=home, goal=there, options=options)
    again = planner.evaluate(found.trajectory, safety_distance=0.0, station="lathe_work")
    state = planner.check_state(inside, safety_distance=0.0, max_pairs=1, station="lathe_work")
    assert not refused.status.ok
    assert refused.status.message.endswith(SHUT)
    assert "as the driver says: lathe door_closed" in refused.info.stages[-1].note
    assert again.status.message.endswith(SHUT)
    assert not state.valid
    assert state.status.message.endswith(SHUT)
    away = planner.plan_regional(start=home, goal=parse_goal("park", planner.cell), options=options)
    assert away.status.ok
    assert away.info.stages[-1].name == "doors"
    planner.heard.machines = None
    assert (
        planner.plan_regional(start=home, goal=there, options=options).trajectory.trajectory_id
        == found.trajectory.trajectory_id
    )
