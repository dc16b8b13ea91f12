"""Every value survives the conversion into a message and back; what a message can't mean is
named.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rclpy.serialization import deserialize_message, serialize_message
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from ir_msgs_py import announcements, modes, options, plc, report
from ir_msgs_py.modes import REST_MODES, Mode, TransitionTimes
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.report import IkSolution, ServiceCandidate
from ir_msgs_py.ros import conversions, plan_conversions, power_conversions
from ir_msgs_py.savings import ProgramPoint, ProgramSavings, Saving
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.errors import InvalidValueError, JointNamesError, PoseError, TrajectoryError

numbers = st.floats(-1e6, 1e6)
lengths = st.floats(0.0, 1e6)
texts = st.text(st.characters(min_codepoint=32, max_codepoint=0x2FF), max_size=12)
names = st.text("abcdefgh_123", min_size=1, max_size=8)
stamps = st.integers(0, 2**31 * 10**9 - 1)


def arrays(n: int) -> st.SearchStrategy[np.ndarray]:
    return hnp.arrays(np.float64, n, elements=numbers)


def tuples(values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.lists(values, max_size=3).map(tuple)


@st.composite
def trajectories(draw: st.DrawFn) -> JointTrajectory:
    points = draw(st.integers(1, 4))
    times = np.cumsum(
        [draw(st.integers(0, 10**12)), *(draw(st.integers(1, 10**10)) for _ in range(points - 1))]
    )
    columns = [hnp.arrays(np.float64, (points, 6), elements=numbers) for _ in range(3)]
    order = draw(st.integers(1, 3))
    return JointTrajectory(JOINT_NAMES, times, *(draw(column) for column in columns[:order]))


@st.composite
def poses(draw: st.DrawFn) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(
        draw(hnp.arrays(np.float64, 3, elements=st.floats(-3.0, 3.0)))
    ).as_matrix()
    T[:3, 3] = draw(hnp.arrays(np.float64, 3, elements=st.floats(-10.0, 10.0)))
    return T


pairs = st.builds(
    report.DistancePair,
    st.sampled_from(report.PairKind),
    texts,
    texts,
    numbers,
    arrays(3),
    arrays(3),
    st.booleans(),
)
reports = st.builds(
    report.TrajectoryReport,
    duration=lengths,
    movement_cost=numbers,
    energy=numbers,
    joint_energy=arrays(6),
    base_energy=numbers,
    burnt_energy=lengths,
    peak_power=numbers,
    min_clearance=st.one_of(numbers, st.just(float("inf"))),
    closest=st.none() | pairs,
    closest_time=lengths,
    safety_distance=lengths,
    velocity_ratio=arrays(6),
    acceleration_ratio=arrays(6),
    jerk_ratio=arrays(0),
    torque_ratio=arrays(6),
    path_length=lengths,
    certified=st.booleans(),
    cell_hash=texts,
    load=texts,
    contacts=tuples(pairs),
)
seconds = st.floats(0.0, 604_800.0)
timers = st.builds(
    announcements.ControllerTimers,
    seconds,
    st.builds(
        TransitionTimes, **{field.name: seconds for field in dataclasses.fields(TransitionTimes)}
    ),
)
loads = st.builds(
    announcements.CarriedLoad,
    texts,
    lengths,
    arrays(3),
    hnp.arrays(np.float64, (3, 3), elements=numbers).map(lambda m: np.triu(m) + np.triu(m, 1).T),
    numbers,
    numbers,
)
infos = st.builds(
    report.PlanningInfo,
    texts,
    st.integers(0, 2**64 - 1),
    arrays(6),
    st.just(JOINT_NAMES),
    st.integers(0, 2**64 - 1),
    st.booleans(),
    lengths,
    tuples(st.builds(report.PlanningStage, texts, lengths, texts)),
    tuples(st.builds(report.Rejection, texts, st.integers(0, 2**32 - 1))),
    st.sampled_from(["", *options.TIMINGS]),
)
movements = st.builds(
    report.PlannedMovement,
    kind=st.sampled_from(["service_exit", "service_entry", "regional"]),
    from_station=texts,
    to_station=texts,
    trajectory_id=texts,
    trajectory=st.none() | trajectories(),
    report=reports,
    duration=lengths,
    attach=texts,
    detach=texts,
    load=texts,
    wait_for=tuples(texts),
    set_signals=tuples(texts),
)
pauses = st.builds(
    report.PlannedMovement,
    kind=st.just("pause"),
    from_station=texts,
    duration=lengths,
    power_mode=st.sampled_from(["", *REST_MODES]),
)
mode_values = st.builds(
    modes.PowerMode,
    mode=st.sampled_from(Mode),
    pe_mode_id=st.integers(0, 255),
    power=numbers,
    time_min_pause=lengths,
    time_to_pause=lengths,
    regular_time_to_operate=lengths,
    time_min_length_of_stay=lengths,
    energy_to_pause=numbers,
    energy_to_operate=numbers,
    break_even=st.one_of(lengths, st.just(float("inf"))),
)
power_states = st.builds(
    modes.PowerState,
    stamp_ns=stamps,
    mode=st.sampled_from(Mode),
    target_mode=st.sampled_from(Mode),
    time_to_target=lengths,
    power=numbers,
    energy=numbers,
    base_power=numbers,
    bus_voltage=numbers,
    burnt_power=numbers,
    joint_power=arrays(6),
    joint_torque=arrays(6),
)
bits = st.booleans()
operating_modes = st.sampled_from(plc.OperatingMode)
signals = st.builds(plc.Signal, names, bits, stamps)
plan_options = st.builds(
    options.PlanOptions,
    planner_id=texts,
    seed=st.integers(0, 2**64 - 1),
    random_seed=bits,
    max_iterations=st.integers(0, 2**32 - 1),
    planning_time=st.floats(1e-3, 1e9),
    safety_distance=lengths,
    objective=st.sampled_from(options.OBJECTIVES),
    time_value=lengths,
    duration=lengths,
    timing=st.sampled_from(options.TIMINGS),
    velocity_scaling=st.floats(1e-3, 1.0),
    acceleration_scaling=st.floats(1e-3, 1.0),
    load=texts,
    include_points=bits,
)
solutions = st.builds(
    IkSolution,
    joint_names=st.just(JOINT_NAMES),
    q=arrays(6),
    position_error=lengths,
    rotation_error=lengths,
    branch=st.integers(0, 7),
    turns=st.tuples(*[st.integers(-128, 127)] * 6),
    clearance=st.one_of(numbers, st.just(float("inf"))),
    movement_cost=lengths,
    closest=st.none() | pairs,
)
candidates = st.builds(
    ServiceCandidate,
    method=texts,
    joint_names=st.just(JOINT_NAMES),
    work=arrays(6),
    outside=arrays(6),
    trajectory_id=texts,
    trajectory=st.none() | trajectories(),
    report=reports,
)
sentences = texts.filter(str.isprintable)  # control characters are escaped in messages
statuses = st.builds(Status, st.sampled_from(StatusCode) | st.just(7), sentences, texts)
plc_inputs = st.builds(plc.PlcInputs, *[bits] * 8, operating_modes)
plc_outputs = st.builds(plc.PlcOutputs, stamps, *[bits] * 6, operating_modes)
pointless = (movements | pauses).map(
    lambda movement: dataclasses.replace(movement, trajectory=None)
)
program_states = st.builds(
    announcements.ProgramState,
    stamp_ns=stamps,
    program_id=texts,
    index=st.integers(0, 3),
    total=st.integers(4, 9),
    event=st.sampled_from(announcements.Event),
    movement=pointless,
    note=texts,
)

saved = st.builds(Saving, numbers, numbers, lengths, numbers, numbers)
program_savings = st.builds(
    ProgramSavings,
    st.booleans(),
    saved,
    saved,
    st.integers(0, 500),
    st.integers(0, 500),
    texts,
    texts,
)

ROUND_TRIPS = {
    "status": statuses,
    "trajectory": trajectories(),
    "distance_pair": pairs,
    "report": reports,
    "planning_info": infos,
    "planned_movement": movements | pauses,
    "program_savings": program_savings,
    "program_point": st.builds(ProgramPoint, numbers, numbers, texts),
    "power_mode": mode_values,
    "power_state": power_states,
    "plc_inputs": plc_inputs,
    "plc_outputs": plc_outputs,
    "signal": signals,
    "program_state": program_states,
    "plan_options": plan_options,
    "ik_solution": solutions,
    "controller_timers": timers,
    "carried_load": loads,
    "service_candidate": candidates,
}


CONVERSIONS = vars(conversions) | vars(plan_conversions) | vars(power_conversions)


def same(a: Any, b: Any) -> bool:
    """Exactly the same content, through dataclasses, tuples and arrays."""
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in dataclasses.fields(a)
        )
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    return bool(a == b)


@pytest.mark.parametrize("name", ROUND_TRIPS)
def test_a_value_comes_back_from_its_message_as_it_was(name):
    to_msg = CONVERSIONS[f"{name}_to_msg"]
    from_msg = CONVERSIONS[f"{name}_from_msg"]

    @settings(max_examples=30, deadline=None, derandomize=True)
    @given(ROUND_TRIPS[name])
    def round_trip(value: Any) -> None:
        msg = to_msg(value)
        on_the_wire = deserialize_message(serialize_message(msg), type(msg))
        assert same(from_msg(on_the_wire), value)

    round_trip()


def test_every_conversion_is_round_tripped_here():
    elsewhere = {"time", "point", "pose", "stamped_pose", "configuration", "cell_state"}
    elsewhere |= {"contact", "machine_states"}  # test_contact_values.py
    elsewhere |= {"saving"}  # a part of program_savings
    elsewhere |= {"recovery"}
    there_and_back = {
        name.removesuffix("_to_msg") for name in CONVERSIONS if name.endswith("_to_msg")
    }
    assert there_and_back - elsewhere == {*ROUND_TRIPS, "duration"}


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**31 * 10**9 - 1))
def test_a_recovery_comes_back_and_a_header_of_something_else_names_no_stop(number, recovered):
    message = conversions.recovery_to_msg(number, recovered)
    assert conversions.recovery_from_msg(message) == (number, recovered)
    for text in ("", "cell", f"-{number}", f"{number}.0", "9" * 21, "٣"):
        message.frame_id = text
        assert conversions.recovery_from_msg(message) == (-1, recovered)


@given(poses())
def test_a_stamped_pose_comes_back_within_rounding(T):
    again = conversions.stamped_pose_from_msg(conversions.stamped_pose_to_msg(T))
    np.testing.assert_allclose(again, T, atol=1e-14)


@given(poses(), texts, st.booleans())
def test_a_cell_comes_back_with_its_machines(T, text, enabled):
    cell = announcements.CellState(text, "0123", "format: x", ("lathe",), (T,), (enabled,), (text,))
    again = power_conversions.cell_state_from_msg(power_conversions.cell_state_to_msg(cell))
    np.testing.assert_allclose(again.poses[0], T, atol=1e-14)
    assert same(dataclasses.replace(again, poses=()), dataclasses.replace(cell, poses=()))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"modes": [2, 3], "enter": [1.0], "stay": [1.0], "leave": [1.0]},
            "have 2, 1, 1, 1 values",
        ),
        (
            {"modes": [2], "enter": [1.0], "stay": [1.0], "leave": [1.0]},
            "BUS_POWER_OFF, HIBERNATION are miss",
        ),
        ({"modes": [99, 3, 4]}, "power mode is 99"),
        ({"enter": [-1.0, 1.0, 1.0]}, "stand_on_brakes_enter is -1"),
        ({"leave": [0.0, float("nan"), 1.0]}, "nan"),
        ({"brakes_after": float("nan")}, "brakes_after is nan"),
    ],
)
def test_timers_that_no_controller_has_are_refused(change, sentence):
    msg = power_conversions.controller_timers_to_msg(announcements.ControllerTimers(20.0))
    for name, value in change.items():
        setattr(msg, name, value)
    with pytest.raises(InvalidValueError, match=sentence):
        power_conversions.controller_timers_from_msg(msg)


@given(stamps)
def test_a_stamp_comes_back_to_the_nanosecond(stamp_ns):
    assert conversions.time_from_msg(conversions.time_to_msg(stamp_ns)) == stamp_ns


@given(arrays(3))
def test_a_point_comes_back(point):
    assert same(conversions.point_from_msg(conversions.point_to_msg(point)), point)


@given(arrays(6), st.permutations(range(6)))
def test_a_configuration_comes_back_in_the_order_that_is_asked_for(q, order):
    msg = conversions.configuration_to_msg([JOINT_NAMES[i] for i in order], q[order])
    assert conversions.configuration_from_msg(msg, JOINT_NAMES).tolist() == q.tolist()


def test_a_configuration_without_names_is_in_the_robots_order():
    msg = JointState(position=[1.0, 2.0])
    assert conversions.configuration_from_msg(msg, ("a", "b")).tolist() == [1.0, 2.0]
    assert conversions.configuration_given(msg)
    assert not conversions.configuration_given(JointState())


@pytest.mark.parametrize(
    ("names", "position", "error", "sentence"),
    [
        (["a", "a"], [0.0, 0.0], JointNamesError, "named more than once: expected are a, b"),
        (["a", "x"], [0.0, 0.0], JointNamesError, "unknown joint 'x': expected are a, b"),
        (["a"], [0.0], JointNamesError, "joint 'b' is missing"),
        (["a", "b"], [0.0], InvalidValueError, "position has 1 values: 2 joints"),
        (
            ["a", "b"],
            [0.0, float("nan")],
            InvalidValueError,
            r"position\[1\] is nan: it must be finite",
        ),
    ],
)
def test_a_bad_configuration_is_named(names, position, error, sentence):
    with pytest.raises(error, match=sentence):
        conversions.configuration_from_msg(JointState(name=names, position=position), ("a", "b"))


@given(poses())
def test_a_pose_comes_back_within_rounding(T):
    msg = conversions.stamped_pose_to_msg(T)
    np.testing.assert_allclose(conversions.stamped_pose_from_msg(msg), T, atol=1e-14)


def test_a_pose_in_a_known_frame_is_given_in_the_cell():
    T = np.eye(4)
    T[:3, 3] = (1.0, 2.0, 3.0)
    msg = conversions.stamped_pose_to_msg(np.eye(4), "base_link")
    assert conversions.stamped_pose_from_msg(msg, {"base_link": T}).tolist() == T.tolist()


def test_an_unknown_frame_lists_the_known_ones():
    msg = conversions.stamped_pose_to_msg(np.eye(4), "moon")
    with pytest.raises(
        PoseError, match='unknown frame "moon": known are cell, base_link'
    ) as caught:
        conversions.stamped_pose_from_msg(msg, {"base_link": np.eye(4)})
    assert caught.value.code == StatusCode.FRAME_TRANSFORM_FAILURE


def test_a_rounded_quaternion_is_normalised_and_a_wrong_one_refused():
    msg = conversions.pose_to_msg(np.eye(4))
    msg.orientation.w = 1.0005
    assert conversions.pose_from_msg(msg).tolist() == np.eye(4).tolist()
    for w in (0.0, 1.1, float("nan")):
        msg.orientation.w = w
        with pytest.raises(PoseError, match=r"must be 1 within 0\.001") as caught:
            conversions.pose_from_msg(msg)
        assert caught.value.code == StatusCode.INVALID_GOAL_CONSTRAINTS


def test_a_position_that_is_not_finite_is_refused():
    msg = conversions.pose_to_msg(np.eye(4))
    msg.position.z = float("inf")
    with pytest.raises(PoseError, match=r"position is \(0, 0, inf\) m: it must be finite"):
        conversions.pose_from_msg(msg)


def trajectory_msg() -> Any:
    trajectory = JointTrajectory(JOINT_NAMES[:2], [0, 10**9], np.zeros((2, 2)), np.zeros((2, 2)))
    return conversions.trajectory_to_msg(trajectory)


def spoil(field: str, value: Any) -> Any:
    msg = trajectory_msg()
    setattr(msg.points[1], field, value)
    return msg


def test_bad_trajectory_messages_are_named_by_point():
    nanosec = trajectory_msg()
    nanosec.points[1].time_from_start.nanosec = 1_500_000_000
    backwards = trajectory_msg()
    backwards.points[1].time_from_start.sec = -3
    cases = [
        (spoil("positions", [0.0]), "point 1 has 1 positions for 2 joints"),
        (spoil("velocities", []), "point 1 has 0 velocities for 2 joints"),
        (spoil("accelerations", [0.0, 0.0]), "point 0 has 0 accelerations for 2 joints"),
        (spoil("effort", [0.0, 0.0]), "point 1 has effort"),
        (spoil("positions", [0.0, float("nan")]), "point 1 joint 1 position is not finite"),
        (
            nanosec,
            "point 1: nanosec of time_from_start is 1500000000: it must be below 1000000000 ns",
        ),
        (backwards, "point 1: time -3.0"),
        (type(nanosec)(joint_names=["a"]), "no points"),
        (type(nanosec)(points=nanosec.points), "no joint names"),
    ]
    for msg, sentence in cases:
        with pytest.raises(TrajectoryError, match=sentence):
            conversions.trajectory_from_msg(msg)


def test_a_trajectory_message_is_put_into_the_expected_joint_order_or_refused():
    msg = trajectory_msg()
    msg.points[0].positions = [1.0, 2.0]
    swapped = conversions.trajectory_from_msg(msg, ("joint_a2", "joint_a1"))
    assert swapped.positions[0].tolist() == [2.0, 1.0]
    with pytest.raises(JointNamesError, match="joint 'joint_a3' is missing"):
        conversions.trajectory_from_msg(msg, JOINT_NAMES[:3])


def test_a_trajectory_with_too_many_points_is_refused_before_it_is_read():
    with pytest.raises(TrajectoryError, match="has 2 points: at most 1 are taken"):
        conversions.trajectory_from_msg(trajectory_msg(), max_points=1)


def test_the_defaults_of_options_are_those_of_the_message():
    from ir_msgs.msg import PlanOptions

    assert plan_conversions.plan_options_from_msg(PlanOptions()) == options.PlanOptions()
    assert plan_conversions.plan_options_to_msg(options.PlanOptions()) == PlanOptions()


def test_the_mode_and_code_numbers_are_those_of_the_messages():
    from ir_msgs.msg import PlcInputs, PowerMode, Status

    assert all(getattr(PowerMode, mode.name) == mode for mode in Mode)
    assert all(getattr(Status, code.name) == code for code in StatusCode)
    assert all(getattr(PlcInputs, mode.name) == mode for mode in plc.OperatingMode)


def test_a_message_without_positions_is_refused() -> None:
    """Velocities alone are not integrated."""
    q = np.zeros((2, 6))
    message = conversions.trajectory_to_msg(
        JointTrajectory.from_seconds(JOINT_NAMES, [0.0, 1.0], q, q)
    )
    for point in message.points:
        point.positions = []
    with pytest.raises(TrajectoryError, match="point 0 has 0 positions for 6 joints"):
        conversions.trajectory_from_msg(message)
