"""The planner's node over ROS: every service answers what the core answers, and lives through bad
input.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import MarkerArray

from ir_description import cell_to_yaml, load_cell
from ir_krl import parse
from ir_krl.write import read_plc_table
from ir_msgs.action import Plan
from ir_msgs.msg import PlanOptions, ProgramSavings, Status
from ir_msgs.srv import (
    CheckState,
    ComputeIk,
    EvaluateTrajectory,
    ExportProgram,
    GetCell,
    GetProgram,
    GetTrajectory,
    PlanProgram,
    PlanRegionalMovement,
    PlanStandby,
    PlanTrajectory,
    SetCell,
    SetEquipment,
)
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.ros.conversions import trajectory_from_msg
from ir_msgs_py.ros.testing import PATIENCE
from ir_planner import Planner
from ir_planner.node.node import PlannerNode

HOME = [0.0, -1.5707963267948966, 1.5707963267948966, 0.0, 0.0, 0.0]
Call = Callable[..., Any]


def state(q: list[float], names: tuple[str, ...] = JOINT_NAMES) -> JointState:
    return JointState(name=list(names), position=[float(v) for v in q])


def moving(speed: float) -> JointState:
    return JointState(name=list(JOINT_NAMES), position=HOME, velocity=[speed] * 6)


def alive(call: Call) -> bool:
    return bool(call(GetCell, "get_cell").status.code == Status.SUCCESS)


def pose(x: float, y: float, z: float, frame: str = "cell", w: float = 1.0) -> PoseStamped:
    msg = PoseStamped()
    msg.header.frame_id = frame
    msg.pose.position.x = x
    msg.pose.position.y = y
    msg.pose.position.z = z
    msg.pose.orientation.w = w
    return msg


# -- every service


def test_set_cell_names_the_stations_and_get_cell_gives_its_text_back(call: Call) -> None:
    loaded = call(SetCell, "set_cell", cell_file="open")
    assert loaded.status.code == Status.SUCCESS, loaded.status.message
    assert {station.name for station in loaded.stations} >= {"p1", "p2", "conv"}
    text = call(GetCell, "get_cell")
    again = call(SetCell, "set_cell", cell_yaml=text.cell_yaml)
    assert again.cell_name == loaded.cell_name
    assert "<robot" in text.robot_description


def test_a_closed_door_obstructs_until_it_opens(call: Call) -> None:
    inside = {"goal": "lathe_work"}
    assert call(ComputeIk, "compute_ik", **inside).status.code == Status.SUCCESS
    shut = call(SetEquipment, "set_equipment", name="lathe", state="door_closed")
    assert shut.status.code == Status.SUCCESS, shut.status.message
    blocked = call(ComputeIk, "compute_ik", **inside)
    assert blocked.status.code == Status.GOAL_IN_COLLISION
    assert "lathe_door_down" in blocked.status.message
    call(SetEquipment, "set_equipment", name="lathe", state="door_open")
    assert call(ComputeIk, "compute_ik", **inside).status.code == Status.SUCCESS


def test_check_state_lists_the_nearest_pairs_first(call: Call) -> None:
    answer = call(CheckState, "check_state", state=state(HOME), max_pairs=4)
    assert answer.status.code == Status.SUCCESS
    assert answer.valid
    distances = [pair.distance for pair in answer.pairs]
    assert len(distances) == 4
    assert distances == sorted(distances)
    assert answer.min_distance == pytest.approx(distances[0])


def test_compute_ik_ranks_by_cost_and_reaches_the_pose(call: Call) -> None:
    answer = call(ComputeIk, "compute_ik", goal="X 1.8 Y 0 Z 1.2 A 0 B 90 C 0", near=state(HOME))
    assert answer.status.code == Status.SUCCESS, answer.status.message
    costs = [solution.movement_cost for solution in answer.solutions]
    assert costs == sorted(costs)
    assert max(solution.position_error for solution in answer.solutions) < 1e-9
    assert all(solution.clearance > 0.02 - 1e-6 for solution in answer.solutions)


def test_the_same_request_gives_the_same_trajectory_and_its_points_can_be_fetched(
    call: Call,
) -> None:
    request = {"start": state(HOME), "goal": "A1 30 A2 -90 A3 90 A4 0 A5 0 A6 0"}
    first = call(PlanRegionalMovement, "plan_regional_movement", **request)
    second = call(PlanRegionalMovement, "plan_regional_movement", **request)
    assert first.status.code == Status.SUCCESS, first.status.message
    assert first.trajectory_id == second.trajectory_id
    assert not first.trajectory.points
    assert first.report.certified
    assert first.report.energy > 0.0
    fetched = call(GetTrajectory, "get_trajectory", trajectory_id=first.trajectory_id)
    trajectory = trajectory_from_msg(fetched.trajectory)
    assert trajectory.trajectory_id == first.trajectory_id
    assert np.degrees(trajectory.positions[-1][0]) == pytest.approx(30.0)


def test_points_come_with_the_answer_when_asked_for(call: Call) -> None:
    answer = call(
        PlanRegionalMovement,
        "plan_regional_movement",
        start=state(HOME),
        goal="park",
        options=PlanOptions(include_points=True),
    )
    assert trajectory_from_msg(answer.trajectory).trajectory_id == answer.trajectory_id


def test_the_start_defaults_to_the_last_joint_states(
    call: Call, planner_node: PlannerNode, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    stale = call(PlanRegionalMovement, "plan_regional_movement", goal="park")
    assert stale.status.code == Status.ROBOT_STATE_STALE
    publisher = ros_executor.run(lambda: ros_node.create_publisher(JointState, "/joint_states", 10))
    start = [0.2, *HOME[1:]]

    def asked() -> Any:
        ros_executor.run(lambda: publisher.publish(state(start)))
        answer = call(PlanRegionalMovement, "plan_regional_movement", goal="park")
        return answer if answer.status.code == Status.SUCCESS else None

    answer = wait_for(asked, what="the state arrives")
    assert list(answer.info.start.position) == pytest.approx(start)

    def refused(kind: Any, name: str, **fields: Any) -> Any:
        ros_executor.run(lambda: publisher.publish(moving(0.3)))
        status = call(kind, name, **fields).status
        return status if status.code == Status.START_STATE_INVALID else None

    plan = wait_for(lambda: refused(PlanRegionalMovement, "plan_regional_movement", goal="park"))
    assert "the robot is moving: joint_a1" in plan.message
    assert wait_for(lambda: refused(PlanProgram, "plan_program", stations=["park"]))


def test_plan_trajectory_passes_the_reference_points(call: Call) -> None:
    points = [HOME, [0.3, -1.4, 1.5, 0.0, 0.2, 0.0], [0.6, -1.5, 1.6, 0.0, 0.1, 0.0]]
    reference = JointTrajectory(
        joint_names=list(JOINT_NAMES), points=[JointTrajectoryPoint(positions=q) for q in points]
    )
    answer = call(
        PlanTrajectory,
        "plan_trajectory",
        reference=reference,
        options=PlanOptions(include_points=True),
    )
    assert answer.status.code == Status.SUCCESS, answer.status.message
    trajectory = trajectory_from_msg(answer.trajectory)
    for q in points:
        assert np.abs(trajectory.positions - q).max(axis=1).min() < 1e-9
    options = PlanOptions(planner_id="genetic")
    notes = [
        s.note
        for s in call(
            PlanTrajectory, "plan_trajectory", reference=reference, options=options
        ).info.stages
    ]
    assert "planner_id genetic is not used: nothing is searched between given points" in notes


def test_evaluate_trajectory_names_the_first_violation(call: Call) -> None:
    fast = JointTrajectory(joint_names=list(JOINT_NAMES))
    for k, q in enumerate((HOME, [1.5, *HOME[1:]])):
        point = JointTrajectoryPoint(positions=q, velocities=[0.0] * 6, accelerations=[0.0] * 6)
        point.time_from_start.nanosec = 100_000_000 * k
        fast.points.append(point)
    answer = call(EvaluateTrajectory, "evaluate_trajectory", trajectory=fast)
    assert answer.status.code == Status.INVALID_MOTION_PLAN
    assert "joint_a1" in answer.status.message
    assert "limit" in answer.status.message
    assert answer.report.velocity_ratio[0] > 1.0
    assert not answer.report.certified


def test_evaluate_trajectory_agrees_with_the_plan_and_gives_profiles(call: Call) -> None:
    plan = call(PlanRegionalMovement, "plan_regional_movement", start=state(HOME), goal="park")
    answer = call(EvaluateTrajectory, "evaluate_trajectory", trajectory_id=plan.trajectory_id)
    assert answer.status.code == Status.SUCCESS
    assert answer.report.energy == pytest.approx(plan.report.energy)
    assert len(answer.times) == len(answer.distances) == len(answer.watts) > 10
    assert min(answer.distances) >= answer.report.min_clearance - 1e-12


def set_short_program(call: Call) -> None:
    """The demonstration with its first two stops and a pause in place of its program."""
    cell = load_cell("demo")
    pause = next(step for step in cell.program if step.kind == "PAUSE")
    text = cell_to_yaml(replace(cell, program=(*cell.program[:2], pause)))
    answer = call(SetCell, "set_cell", cell_yaml=text)
    assert answer.status.code == Status.SUCCESS, answer.status.message


def test_plan_program_and_get_program(call: Call) -> None:
    set_short_program(call)
    answer = call(PlanProgram, "plan_program")
    assert answer.status.code == Status.SUCCESS, answer.status.message
    assert all(movement.report.certified for movement in answer.movements)
    assert sum(movement.report.energy for movement in answer.movements) == pytest.approx(
        answer.report.energy
    )
    stored = call(GetProgram, "get_program", program_id=answer.program_id, include_points=True)
    assert [m.trajectory_id for m in stored.movements] == [
        m.trajectory_id for m in answer.movements
    ]
    moves = [movement for movement in stored.movements if movement.trajectory_id]
    assert all(movement.trajectory.points for movement in moves)


def test_an_exported_program_is_what_its_fields_say(call: Call) -> None:
    """Text, data, the PLC's part and both reports, of a program and of one movement in a style."""
    set_short_program(call)
    plan = call(PlanProgram, "plan_program", savings=False)
    whole = call(ExportProgram, "export_program", program_id=plan.program_id, name="visit")
    assert whole.status.code == Status.SUCCESS, whole.status.message
    moving = [one for one in plan.movements if one.trajectory_id]
    for report, ours in ((whole.planned, moving), (whole.exported, moving)):
        assert report.certified
        assert report.duration == pytest.approx(sum(one.report.duration for one in ours), rel=0.01)
    assert whole.planned.energy == pytest.approx(sum(one.report.energy for one in moving), rel=1e-6)
    assert 0.0 < whole.deviation <= 0.002
    sources = [parse(whole.text, "visit.src"), parse(whole.data, "visit.dat")]
    assert sources[0].routines[0].name == "VISIT"
    sequences = [one.power_mode for one in plan.movements if not one.trajectory_id]
    asked = {mode for sequence in sequences if sequence for mode in sequence.split(">")}
    pauses = read_plc_table(whole.plc_table, "visit.plc.csv").values()
    assert {mode for one in pauses for mode in one.modes} >= asked
    assert "FUNCTION_BLOCK" in whole.plc_text
    one = moving[0].trajectory_id
    form = call(
        ExportProgram, "export_program", trajectory_id=one, name="one", style="krc2", tools=["3"]
    )
    assert form.status.code == Status.SUCCESS, form.status.message
    assert "PTP X" in form.text
    assert "Tool[3]" in form.text
    assert not form.plc_table
    assert not form.plc_text
    assert form.exported.duration >= form.planned.duration - 0.01
    refused: tuple[tuple[str, Any, str], ...] = (
        ("style", "kss9", "kss9"),
        ("name", "1st", "1st"),
        ("language", "rapid", "rapid"),
        ("tools", ["x"], "--tool x: it is N or N=PART"),
        ("bases", ["3=nobody"], "--base 3=nobody"),
        ("numbers_from", "DEFDAT $CONFIG\nENDDAT\n", "$config.dat has no TOOL_DATA"),
    )
    for field, wrong, said in refused:
        chosen = {"trajectory_id": one, "name": "one", "style": "krc2", field: wrong}
        answer = call(ExportProgram, "export_program", **chosen)
        assert answer.status.code != Status.SUCCESS
        assert said in answer.status.message


def test_stops_are_passed_as_near_as_the_request_says(call: Call) -> None:
    stops = ["home", "infeed_pick", "gauge_measure", "home"]
    little = PlanOptions(max_iterations=20_000)
    asked = {"stations": stops, "options": little, "savings": False}
    standing = call(PlanProgram, "plan_program", **asked)
    passing = call(PlanProgram, "plan_program", **asked, blend=0.05)
    assert passing.status.code == Status.SUCCESS, passing.status.message
    assert not any(step.passes for step in standing.movements)
    passed = [name for step in passing.movements for name in step.passes]
    assert passed == ["gauge_measure"]
    assert passing.report.duration < standing.report.duration
    by_library = Planner("demo", clock=lambda: 0.0).plan_program(
        stations=tuple(stops), start="home", blend=0.05, max_iterations=20_000
    )
    assert passing.program_id == by_library.program_id
    stored = call(GetProgram, "get_program", program_id=passing.program_id)
    assert [list(step.passes) for step in stored.movements] == [
        list(step.passes) for step in by_library.movements
    ]


def test_a_program_comes_with_its_savings_and_its_front(
    call: Call, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    heard: list[Any] = []
    subscription = ros_executor.run(
        lambda: ros_node.create_subscription(
            ProgramSavings, "/ir_planner/savings", heard.append, QoSProfile(depth=1)
        )
    )
    wait_for(lambda: subscription.get_publisher_count() == 1, what="the savings have a publisher")
    answer = call(PlanProgram, "plan_program", stations=["home", "park"], front_points=3)
    savings = answer.savings
    assert savings.available, savings.sentence
    assert savings.total.share == pytest.approx(1.0 - savings.total.planned / savings.total.common)
    assert 0.0 <= answer.gap < 100.0
    compared = call(GetProgram, "get_program", program_id=savings.program_id)
    assert compared.report.energy == pytest.approx(savings.total.planned)
    assert [point.cycle_time for point in answer.front] == sorted(
        p.cycle_time for p in answer.front
    )
    assert len(answer.front) == 3
    for point in answer.front:
        stored = call(GetProgram, "get_program", program_id=point.program_id)
        assert stored.report.energy == pytest.approx(point.energy)
        assert stored.report.duration == pytest.approx(point.cycle_time)
    wait_for(lambda: heard, what="the savings are published")
    assert heard[-1].program_id == savings.program_id
    plain = call(PlanProgram, "plan_program", stations=["home", "park"], savings=False)
    assert not plain.savings.available
    assert "not asked for" in plain.savings.sentence
    ros_executor.run(lambda: ros_node.destroy_subscription(subscription))


def test_plan_standby_wakes_in_time(call: Call) -> None:
    answer = call(PlanStandby, "plan_standby", pause=300.0)
    assert answer.status.code == Status.SUCCESS
    assert answer.chosen.name == "BUS_POWER_OFF"
    assert answer.wake_at == pytest.approx(300.0 - answer.chosen.regular_time_to_operate)
    assert answer.energy <= min(answer.alternative_energies)
    assert list(answer.modes) == ["STAND_ON_BRAKES", "BUS_POWER_OFF"]
    assert list(answer.switch_times) == pytest.approx([0.0, 1.3])


def test_plan_standby_takes_a_length_that_nobody_knows_and_postures(call: Call) -> None:
    answer = call(
        PlanStandby,
        "plan_standby",
        pause_samples=[5.0, 200.0, 4000.0],
        postures=["park", "home"],
        pause=0.0,
    )
    assert answer.status.code == Status.SUCCESS, answer.status.message
    assert answer.clairvoyant <= answer.expected == answer.energy <= answer.worst
    assert np.isinf(answer.wake_at)
    assert list(answer.switch_times) == sorted(answer.switch_times)
    assert answer.modes[-1] == "HIBERNATION"
    assert len(answer.posture_energies) == 2
    assert min(answer.posture_energies) >= answer.energy
    assert "park: " in answer.status.message


# -- the action


@pytest.fixture
def plan_action(planner_node: PlannerNode, ros_node: Any, ros_executor: Any, wait_for: Any) -> Any:
    kept = QoSProfile(
        depth=1000
    )  # of the feedback: by default the eleventh that waits takes the first's place
    client = ros_executor.run(
        lambda: ActionClient(ros_node, Plan, "/ir_planner/plan", feedback_sub_qos_profile=kept)
    )
    wait_for(client.server_is_ready, what="the action is offered")
    yield client
    ros_executor.run(client.destroy)


def test_the_action_plans_the_program_with_feedback(
    plan_action: Any, ros_executor: Any, wait_for: Any
) -> None:
    phases: list[str] = []
    sent = ros_executor.run(
        lambda: plan_action.send_goal_async(
            Plan.Goal(stations=["home", "gauge_measure", "park"]),
            feedback_callback=lambda message: phases.append(message.feedback.phase),
        )
    )
    wait_for(sent.done)
    result = ros_executor.run(sent.result().get_result_async)
    wait_for(result.done)
    assert result.result().result.status.code == Status.SUCCESS
    wait_for(lambda: {"configurations", "movements"} <= set(phases), what="feedback of both phases")


def test_a_cancelled_plan_stops_and_quick_services_answer_meanwhile(
    plan_action: Any, call: Call, ros_executor: Any, wait_for: Any, planner_node: PlannerNode
) -> None:
    entered = threading.Event()
    release = threading.Event()
    plan = planner_node.planner.plan_program

    def slow(*args: Any, **asked: Any) -> Any:
        entered.set()
        release.wait(PATIENCE)
        return plan(*args, **asked)

    vars(planner_node.planner)["plan_program"] = slow
    sent = ros_executor.run(lambda: plan_action.send_goal_async(Plan.Goal()))
    wait_for(sent.done)
    wait_for(entered.is_set)
    assert alive(call), "get_cell waits for the plan"
    cancelled = ros_executor.run(sent.result().cancel_goal_async)
    wait_for(cancelled.done)
    release.set()
    result = ros_executor.run(sent.result().get_result_async)
    wait_for(result.done)
    assert result.result().result.status.code == Status.PREEMPTED
    assert not result.result().result.movements


# -- topics


def test_late_listeners_get_markers_and_trajectory_and_diagnostics_come(
    call: Call, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    plan = call(
        PlanRegionalMovement,
        "plan_regional_movement",
        start=state(HOME),
        goal="park",
        options=PlanOptions(include_points=True),
    )
    heard: dict[str, Any] = {}
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    for kind, topic, qos in (
        (MarkerArray, "/ir_planner/markers", latched),
        (JointTrajectory, "/ir_planner/planned_trajectory", latched),
        (DiagnosticArray, "/diagnostics", 10),
    ):
        ros_executor.run(
            lambda kind=kind, topic=topic, qos=qos: ros_node.create_subscription(
                kind, topic, lambda message: heard.__setitem__(topic, message), qos
            )
        )
    wait_for(lambda: len(heard) == 3, what="markers, trajectory and diagnostics")
    assert (
        trajectory_from_msg(heard["/ir_planner/planned_trajectory"]).trajectory_id
        == plan.trajectory_id
    )
    assert {"lathe", "zones", "stations"} <= {
        marker.ns for marker in heard["/ir_planner/markers"].markers
    }
    assert heard["/diagnostics"].status[0].name == "ir_planner"


# -- bad input: a code and a sentence, and the node lives on


NAN = float("nan")
BAD: list[tuple[str, Any, str, dict[str, Any], int, str]] = [
    (
        "two goals",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "goal_state": state(HOME)},
        -16,
        "exactly one",
    ),
    (
        "no goal",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME)},
        -16,
        "exactly one",
    ),
    (
        "unknown goal",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "nowhere"},
        -19,
        "gauge_measure",
    ),
    (
        "goal beyond a limit",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "A1 200 A2 -90 A3 90 A4 0 A5 0 A6 0"},
        -27,
        "185",
    ),
    (
        "nan in start",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state([NAN, *HOME[1:]]), "goal": "park"},
        -26,
        "finite",
    ),
    (
        "start too fast",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": moving(30.0), "goal": "park"},
        -26,
        "start in motion: joint_a1 has velocity 30 rad/s: it must be at most",
    ),
    (
        "nan velocity of a start",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": moving(NAN), "goal": "park"},
        -26,
        "velocity[0] is nan",
    ),
    (
        "goal too fast",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal_state": moving(30.0)},
        -27,
        "goal in motion: joint_a1 has velocity 30 rad/s: it must be at most",
    ),
    (
        "nan velocity of a state",
        CheckState,
        "check_state",
        {"state": moving(NAN)},
        -17,
        "velocity[0] is nan",
    ),
    (
        "nan velocity of near",
        ComputeIk,
        "compute_ik",
        {"goal": "gauge_measure", "near": moving(NAN)},
        -17,
        "velocity[0] is nan",
    ),
    (
        "unknown joint",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME, ("a1", *JOINT_NAMES[1:])), "goal": "park"},
        -26,
        "joint_a1",
    ),
    (
        "missing joint",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME[:5], JOINT_NAMES[:5]), "goal": "park"},
        -26,
        "joint_a6",
    ),
    (
        "start in collision",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(np.radians([0, -20, 60, 0, 0, 0]).tolist()), "goal": "park"},
        -10,
        "mm",
    ),
    (
        "goal in collision",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "A1 0 A2 -20 A3 60 A4 0 A5 0 A6 0"},
        -12,
        "mm",
    ),
    (
        "unreachable pose",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "X 9 Y 0 Z 1 A 0 B 90 C 0"},
        -31,
        "m",
    ),
    (
        "zero quaternion",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal_pose": pose(1.5, 0, 1.5, w=0.0)},
        -16,
        "norm",
    ),
    (
        "unknown frame",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal_pose": pose(1.5, 0, 1.5, "moon")},
        -21,
        "moon",
    ),
    (
        "nan pose",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal_pose": pose(NAN, 0, 1.5)},
        -16,
        "finite",
    ),
    *(
        (
            f"planning_time {value}",
            PlanRegionalMovement,
            "plan_regional_movement",
            {"start": state(HOME), "goal": "park", "options": PlanOptions(planning_time=value)},
            -16,
            "planning_time",
        )
        for value in (0.0, -1.0, NAN)
    ),
    (
        "nan safety distance",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "options": PlanOptions(safety_distance=NAN)},
        -16,
        "safety_distance",
    ),
    (
        "unknown objective",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "options": PlanOptions(objective="beauty")},
        -16,
        "time_and_energy",
    ),
    (
        "unknown planner",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "options": PlanOptions(planner_id="fastest")},
        -16,
        "detours",
    ),
    (
        "velocity scaling above 1",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "options": PlanOptions(velocity_scaling=1.5)},
        -16,
        "1.5",
    ),
    (
        "unknown load",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "options": PlanOptions(load="anvil")},
        -19,
        "gear",
    ),
    (
        "too short a duration",
        PlanRegionalMovement,
        "plan_regional_movement",
        {"start": state(HOME), "goal": "park", "options": PlanOptions(duration=0.05)},
        -16,
        "shortest",
    ),
    ("unknown cell", SetCell, "set_cell", {"cell_file": "atlantis"}, -19, "demo"),
    (
        "broken cell",
        SetCell,
        "set_cell",
        {"cell_yaml": "format: ir_cell/1\nname: [1"},
        -16,
        "<text>:3",
    ),
    ("no cell given", SetCell, "set_cell", {}, -16, "neither"),
    ("unknown machine", SetEquipment, "set_equipment", {"name": "crane"}, -19, "lathe"),
    (
        "unknown door state",
        SetEquipment,
        "set_equipment",
        {"name": "lathe", "state": "ajar"},
        -19,
        "door_open",
    ),
    (
        "state of five joints",
        CheckState,
        "check_state",
        {"state": JointState(position=HOME[:5])},
        -17,
        "5",
    ),
    (
        "unknown station of a state",
        CheckState,
        "check_state",
        {"state": state(HOME), "station": "moon"},
        -19,
        "lathe_work",
    ),
    ("ik of a configuration", ComputeIk, "compute_ik", {"goal": "park"}, -16, "pose"),
    (
        "unknown ik method",
        ComputeIk,
        "compute_ik",
        {"goal": "gauge_measure", "method": "magic"},
        -16,
        "analytic",
    ),
    (
        "unknown trajectory",
        GetTrajectory,
        "get_trajectory",
        {"trajectory_id": "feedbeef"},
        -19,
        "feedbeef",
    ),
    ("unknown program", GetProgram, "get_program", {"program_id": "feedbeef"}, -19, "feedbeef"),
    ("no trajectory", EvaluateTrajectory, "evaluate_trajectory", {}, -16, "exactly one"),
    ("empty reference", PlanTrajectory, "plan_trajectory", {}, -2, "joint names"),
    (
        "unknown planner of a reference",
        PlanTrajectory,
        "plan_trajectory",
        {
            "reference": JointTrajectory(
                joint_names=list(JOINT_NAMES), points=[JointTrajectoryPoint(positions=HOME)] * 2
            ),
            "options": PlanOptions(planner_id="magic"),
        },
        -16,
        "rrt_connect",
    ),
    (
        "nan in reference",
        PlanTrajectory,
        "plan_trajectory",
        {
            "reference": JointTrajectory(
                joint_names=list(JOINT_NAMES), points=[JointTrajectoryPoint(positions=[NAN] * 6)]
            )
        },
        -2,
        "point 0 joint 0",
    ),
    (
        "reference of wrong joints",
        PlanTrajectory,
        "plan_trajectory",
        {
            "reference": JointTrajectory(
                joint_names=["x"], points=[JointTrajectoryPoint(positions=[0.0])]
            )
        },
        -2,
        "joint_a1",
    ),
    (
        "unknown station in a program",
        PlanProgram,
        "plan_program",
        {"stations": ["moon"]},
        -19,
        "lathe_work",
    ),
    (
        "nan cycle time",
        PlanProgram,
        "plan_program",
        {"stations": ["park"], "cycle_time": NAN},
        -16,
        "cycle_time",
    ),
    (
        "too short a cycle",
        PlanProgram,
        "plan_program",
        {"stations": ["home", "park"], "cycle_time": 0.1},
        -16,
        "shortest",
    ),
    (
        "too many points of a front",
        PlanProgram,
        "plan_program",
        {"stations": ["park"], "front_points": 51},
        -16,
        "50",
    ),
    *(
        (
            f"a blend of {blend:g}",
            PlanProgram,
            "plan_program",
            {"stations": ["home", "park"], "blend": blend},
            -16,
            f"blend is {blend:g} m: it must be in [0, 1] m",
        )
        for blend in (-0.5, 1.5)
    ),
    (
        "a blend of nan",
        PlanProgram,
        "plan_program",
        {"stations": ["home", "park"], "blend": NAN},
        -16,
        "blend is nan m: it must be finite",
    ),
    ("negative pause", PlanStandby, "plan_standby", {"pause": -1.0}, -16, "-1"),
    ("nan pause", PlanStandby, "plan_standby", {"pause": NAN}, -16, "nan"),
]


def test_bad_input_is_answered_by_a_sentence_and_the_node_lives(call: Call) -> None:
    wrong = []
    for name, kind, service, fields, code, word in BAD:
        status = call(kind, service, **fields).status
        if status.code != code or word not in status.message or status.source != "ir_planner":
            wrong.append(f"{name}: {status.code} {status.message!r} (wanted {code} with {word!r})")
    assert wrong == []
    assert alive(call)


def test_a_failed_set_cell_leaves_the_cell_as_it_was(call: Call) -> None:
    before = call(GetCell, "get_cell").cell_yaml
    call(SetCell, "set_cell", cell_yaml="nonsense")
    assert call(GetCell, "get_cell").cell_yaml == before


def test_a_huge_planning_time_is_capped_and_said(call: Call) -> None:
    answer = call(
        PlanRegionalMovement,
        "plan_regional_movement",
        start=state(HOME),
        goal="park",
        options=PlanOptions(planning_time=1e9),
    )
    assert answer.status.code == Status.SUCCESS
    assert any("capped" in stage.note for stage in answer.info.stages)


def test_seeds_are_echoed_and_a_random_one_is_drawn(call: Call) -> None:
    def seed(**fields: Any) -> int:
        answer = call(
            PlanRegionalMovement,
            "plan_regional_movement",
            start=state(HOME),
            goal="park",
            options=PlanOptions(**fields),
        )
        assert answer.status.code == Status.SUCCESS
        return int(answer.info.seed)

    assert seed() == 0
    assert seed(seed=2**63) == 2**63
    assert seed(random_seed=True) != seed(random_seed=True)


def test_a_parameter_out_of_range_is_refused_and_the_value_kept(
    planner_node: PlannerNode, call: Call, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    parameter = Parameter("max_iterations", Parameter.Type.INTEGER, 0).to_parameter_msg()
    answer = call(SetParameters, "set_parameters", parameters=[parameter])
    assert not answer.results[0].successful
    assert planner_node.planner.settings.max_iterations > 0


def _genetic(node: PlannerNode) -> Any:
    return node.planner.settings.searches["genetic"]


def test_the_genetic_settings_are_parameters(
    planner_node: PlannerNode, call: Call, ros_node: Any, ros_executor: Any, wait_for: Any
) -> None:
    def answer(name: str, value: int) -> Any:
        parameter = Parameter(f"genetic.{name}", Parameter.Type.INTEGER, value).to_parameter_msg()
        return call(SetParameters, "set_parameters", parameters=[parameter]).results[0]

    assert answer("population", 96).successful
    wait_for(lambda: _genetic(planner_node).population == 96)
    refused = answer("elite", 24)
    assert not refused.successful
    assert "must be less than population / islands, which is 24" in refused.reason
    assert _genetic(planner_node).elite == 2
