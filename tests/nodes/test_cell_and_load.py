"""Cell, load and timers don't drift apart: planner and driver as nodes, in one graph and a
namespace each.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from ir_description import cell_hash, load_cell
from ir_msgs.msg import CarriedLoad, CellState, ControllerTimers, MachineStates, Signal
from ir_msgs.srv import (
    CheckState,
    GetTrajectory,
    PlanRegionalMovement,
    PlanStandby,
    SetEquipment,
    SetLoad,
)
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import time_from_msg, trajectory_from_msg
from ir_msgs_py.ros.plan_conversions import report_from_msg
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import COMMANDS, LATCHED
from ir_planner.node.node import PlannerNode
from ir_sim_driver.controller import surroundings
from ir_sim_driver.node import SimDriver, announcements
from ir_values.errors import RequestRefusedError

DEMO = load_cell("demo")


@pytest.fixture
def make_driver(ros_context: Any, ros_executor: Any) -> Callable[..., SimDriver]:
    def make(namespace: str = "", executor: Any = ros_executor, **parameters: Any) -> SimDriver:
        values = {
            "cell": "demo",
            "backend": "ideal",
            "wake_port": 0,
            "modbus_port": 0,
            **parameters,
        }
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        node: SimDriver = executor.add_node(
            SimDriver(
                context=ros_context, namespace=namespace or None, parameter_overrides=overrides
            )
        )
        return node

    return make


@pytest.fixture
def client(ros_context: Any) -> Any:
    with Client(context=ros_context, timeout=PATIENCE) as opened:
        yield opened


def planned(client: Client, goal: str = "A1 20 A2 -90 A3 90 A4 0 A5 0 A6 0") -> tuple[Any, Any]:
    """Report and trajectory of a movement from machine home."""
    request = PlanRegionalMovement.Request(goal=goal)
    request.start.position = [float(value) for value in DEMO.machine_home]
    answer = client.ask(names.PLAN_REGIONAL_MOVEMENT, request)
    found = client.ask(
        names.GET_TRAJECTORY, GetTrajectory.Request(trajectory_id=answer.trajectory_id)
    )
    return report_from_msg(answer.report), trajectory_from_msg(found.trajectory)


def test_a_change_of_load_has_the_time_of_the_plant_which_may_lag(
    make_driver: Any, client: Client, wait_for: Any
) -> None:
    """Before its first tick there is no such time, and the clock's stands for it."""
    driver = make_driver()
    begun = wait_for(lambda: driver._driver.stamp_ns, what="the plant ticks")
    client.ask(names.SET_LOAD, SetLoad.Request(load="none"))

    def changed() -> Any:
        heard = client.next_message(names.CARRIED_LOAD, CarriedLoad)
        return heard if heard.load == "none" else None

    stamp = time_from_msg(wait_for(changed).header.stamp)
    assert begun <= stamp <= driver._driver.stamp_ns
    assert stamp % 2_000_000 == 0  # the grid of joint_states


def test_of_a_flood_of_cells_the_newest_is_read_and_none_waits(
    make_driver: Any, wait_for: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading a large one takes longer than sending it; whatever it raises is a warning."""
    read: list[str] = []
    go_on = threading.Event()

    def slow(text: str) -> Any:
        read.append(text)
        go_on.wait(PATIENCE)
        raise MemoryError(text)

    driver = make_driver()
    warnings = []
    monkeypatch.setattr(announcements, "cell_from_yaml", slow)
    monkeypatch.setattr(driver._driver, "warn", warnings.append)
    driver._announcements._heard(CellState(cell_yaml="first"))
    wait_for(lambda: read == ["first"], what="the first is read")
    for k in range(50):
        driver._announcements._heard(CellState(cell_yaml=str(k)))
    assert len(driver._announcements._offered) == 1
    go_on.set()
    wait_for(lambda: len(warnings) == 2, what="the newest is read")
    assert read == ["first", "49"]
    assert warnings[1] == "the planner's cell is not taken: unexpected MemoryError: 49"


@pytest.mark.parametrize("latched", [True, False])
def test_a_signal_that_was_sent_before_the_driver_started_counts(
    make_driver: Any,
    ros_context: Any,
    ros_executor: Any,
    client: Client,
    wait_for: Any,
    latched: bool,
) -> None:
    plc = ros_executor.add_node(Node("plc", context=ros_context))
    quality = COMMANDS[0] if latched else COMMANDS[1]
    door = plc.create_publisher(Signal, names.MACHINE_SIGNALS, quality)
    for level in (True, False):
        door.publish(Signal(name="lathe_open_door", value=level))
    make_driver()

    def state() -> str:
        states = client.next_message(names.MACHINE_STATES, MachineStates)
        lathe = list(states.equipment).index("lathe")
        return str(states.next[lathe] or states.states[lathe])

    if not latched:  # as `ros2 topic pub` by default: heard from now on
        wait_for(lambda: door.get_subscription_count() > 0)
        assert state() == "door_open"
        door.publish(Signal(name="lathe_open_door", value=False))
    wait_for(lambda: state() == "door_closed")


@pytest.mark.usefixtures("planner_node")
def test_a_machine_that_moves_makes_old_trajectories_void_and_new_ones_run(
    make_driver: Any, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_driver()
    report, trajectory = planned(client)
    assert report.cell_hash == cell_hash(DEMO)
    assert report.load == DEMO.tool.name
    client.ask(
        names.SET_EQUIPMENT, SetEquipment.Request(name=DEMO.equipment[-1].name, enabled=False)
    )
    now = client.next_message(names.CELL, CellState)
    assert now.hash == cell_hash(DEMO.with_equipment(DEMO.equipment[-1].name, enabled=False))
    assert list(now.equipment) == [machine.name for machine in DEMO.equipment]
    assert list(now.enabled)[-1] is False

    again, new = planned(client)
    assert again.cell_hash == now.hash
    with monkeypatch.context() as patient:
        patient.setattr(surroundings, "PATIENCE", 60.0)  # s: a busy machine
        client.execute(new, report=again)  # even where the cell comes later than the trajectory
    with pytest.raises(RequestRefusedError, match=report.cell_hash) as refused:
        client.execute(trajectory, report=report)
    assert now.hash in str(refused.value)


def test_the_planner_plans_with_what_the_driver_carries(
    make_driver: Any, planner_node: PlannerNode, client: Client, wait_for: Any
) -> None:
    make_driver()
    wait_for(lambda: planner_node.planner.heard.load is not None, what="the load is heard")
    part = DEMO.parts[0].name
    both = f"{DEMO.tool.name}+{part}"
    client.ask(names.SET_LOAD, SetLoad.Request(load=both))
    wait_for(lambda: planner_node.planner.scene().load_text == both, what="the part is heard")
    carried = client.next_message(names.CARRIED_LOAD, CarriedLoad)
    assert carried.mass == pytest.approx(DEMO.tool.mass + DEMO.part(part).load.mass)

    client.ask(names.SET_LOAD, SetLoad.Request(load="custom", mass=17.5))
    wait_for(
        lambda: planner_node.planner.heard.load.text == "custom", what="the custom load is heard"
    )
    request = CheckState.Request()
    request.state.position = [float(value) for value in DEMO.machine_home]
    with pytest.raises(RequestRefusedError, match=r"'custom' \(17.5 kg\)") as refused:
        client.ask(names.CHECK_STATE, request)
    assert repr(DEMO.tool.name) in str(refused.value)
    request.load = DEMO.tool.name
    assert client.ask(names.CHECK_STATE, request).valid


def test_the_drivers_timers_count_while_there_is_a_driver(
    make_driver: Any, planner_node: PlannerNode, client: Client, wait_for: Any, ros_context: Any
) -> None:
    assert client.ask(names.PLAN_STANDBY, PlanStandby.Request(pause=60.0)).timers == "data"
    parameters = {
        "transitions.motors_to_brakes_in_program": 7.0,
        "transitions.stand_on_brakes_leave": 1.25,
    }
    with BackgroundExecutor(ros_context) as spinning:
        make_driver(executor=spinning, **parameters)
        published = client.next_message(names.CONTROLLER_TIMERS, ControllerTimers)
        assert published.brakes_after == 7.0
        wait_for(lambda: planner_node.planner.heard.timers is not None, what="the timers are heard")
        wait_for(
            lambda: planner_node.planner.heard.machines is not None, what="the machines are heard"
        )
        answer = client.ask(names.PLAN_STANDBY, PlanStandby.Request(pause=60.0))
        assert (answer.timers, answer.controller_timer) == ("driver", 7.0)
        assert answer.alternatives[1].regular_time_to_operate == 1.25
    wait_for(lambda: planner_node.planner.heard.timers is None, what="the driver is forgotten")
    wait_for(lambda: planner_node.planner.heard.machines is None, what="its machines are forgotten")
    assert client.ask(names.PLAN_STANDBY, PlanStandby.Request(pause=60.0)).timers == "data"


@pytest.mark.usefixtures("planner_node")
def test_a_driver_hears_the_planner_of_its_own_namespace_alone(
    make_driver: Any, planner_node: PlannerNode, client: Client, ros_node: Any, wait_for: Any
) -> None:
    make_driver("other", cell="open")
    mine = make_driver(cell="open")
    wait_for(
        lambda: mine._driver._simulation.cell.name == "demo", what="the planner's cell is taken"
    )
    heard: list[Any] = []
    ros_node.create_subscription(CarriedLoad, f"other/{names.CARRIED_LOAD}", heard.append, LATCHED)
    wait_for(lambda: bool(heard), what="the other driver's load")
    tool = load_cell("open").tool
    assert heard[-1].load == ("none" if tool is None else tool.name)

    def heard_load() -> str:
        load = planner_node.planner.heard.load
        return "" if load is None else load.text

    wait_for(
        lambda: heard_load() == mine._driver.carried.text, what="the load in the planner's cell"
    )
    np.testing.assert_allclose(
        mine._driver.carried.mass, DEMO.tool.mass if tool is not None else 0.0
    )
