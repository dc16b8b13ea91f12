"""How motions are driven, judged by the robot's kinematics and by closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description.poses import abc_from_rotation, rotation_from_abc
from ir_krl import Followed, KrlMotionError, SourcePlace, follow, parse
from ir_krl.run import Target
from ir_planner import Planner
from ir_planner.krl import evaluate_krl, tool_in_flange
from ir_planner.krl.execution import drive
from ir_planner.krl.geometry import Arm, status_turn

Follow = Callable[..., Followed]
START = "PTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}\n"  # machine home is singular for the tool


def frame_text(arm: Arm, q: np.ndarray) -> str:
    """The E6POS of q, of the cell's tool in the robot's foot, as a controller would show it."""
    pose = arm.flange(q[None])[0] @ tool_in_flange(arm.scene.cell.tcp)
    values = [*(1e3 * pose[:3, 3]), *abc_from_rotation(pose[:3, :3])]
    status, turn = status_turn(arm.scene.chain, q)
    named = ",".join(f"{n} {v:.9f}" for n, v in zip("XYZABC", values, strict=True))
    return f"{{{named},S {status},T {turn}}}"


def steps_of(program: Followed, planner: Planner) -> list[np.ndarray]:
    scene = planner.scene("none")
    return [
        step.trajectory
        for step in drive(program, scene, planner.cell.machine_home)[0]
        if step.moves
    ]


@given(st.integers(0, 10**9))
@settings(max_examples=60, deadline=None)
def test_status_and_turn_find_the_taught_configuration_again(planner: Planner, seed: int) -> None:
    """Law: S and T of a configuration, with its pose, mean this configuration and no other."""
    robot = planner.cell.robot
    q = np.random.default_rng(seed).uniform(robot.position_min, robot.position_max)
    if np.abs(q).min() < 1e-3:
        return
    arm = Arm(planner.scene("none"))
    tool = tool_in_flange(planner.cell.tcp)
    pose = arm.flange(q[None])[0] @ tool
    values = [*(1e3 * pose[:3, 3]), *abc_from_rotation(pose[:3, :3])]
    status, turn = status_turn(arm.scene.chain, q)
    target = Target(
        None, dict(zip("XYZABC", values, strict=True)), status, turn, False, False, np.eye(4), tool
    )
    found = arm.reached(target, planner.cell.machine_home, SourcePlace())
    assert np.abs(found - q).max() < np.radians(1e-4)


def test_points_are_reached_as_the_data_list_says(
    planner: Planner, followed: Follow, home: np.ndarray
) -> None:
    arm = Arm(planner.scene("none"))
    rng = np.random.default_rng(3)
    taught = home + rng.uniform(-0.4, 0.4, (12, 6))
    program = followed(START + "\n".join(f"PTP {frame_text(arm, q)}" for q in taught))
    for trajectory, q in zip(steps_of(program, planner), taught, strict=True):
        assert np.degrees(np.abs(trajectory.positions[-1] - q)).max() < 1e-4
        away = arm.scene.chain.tcp_poses(np.stack([trajectory.positions[-1], q]))
        assert np.linalg.norm(away[0, :3, 3] - away[1, :3, 3]) < 1e-6


def test_a_lin_is_straight_and_keeps_its_speed(planner: Planner, followed: Follow) -> None:
    program = followed(START + "$VEL.CP=0.4\nLIN_REL {Y 500,Z -300}")
    (trajectory,) = steps_of(program, planner)
    times = np.linspace(0.0, trajectory.duration, 2000)
    places = planner.scene("none").chain.tcp_poses(trajectory.sample(times).q)[:, :3, 3]
    path = places[-1] - places[0]
    assert path == pytest.approx([0.0, 0.5, -0.3], abs=1e-6)
    along = path / np.linalg.norm(path)
    off = (places - places[0]) - ((places - places[0]) @ along)[:, None] * along
    assert np.linalg.norm(off, axis=1).max() < 1e-5
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)
    assert speed.max() == pytest.approx(0.4, rel=2e-3)


def test_a_circ_is_round(planner: Planner, followed: Follow) -> None:
    (trajectory,) = steps_of(followed(START + "CIRC_REL {Y 200,Z 200},{Y 400,Z 0}"), planner)
    times = np.linspace(0.0, trajectory.duration, 800)
    places = planner.scene("none").chain.tcp_poses(trajectory.sample(times).q)[:, :3, 3]
    centre = places[0] + [0.0, 0.2, 0.0]
    assert np.linalg.norm(places - centre, axis=1) == pytest.approx(np.full(800, 0.2), abs=1e-5)
    assert places[:, 2].max() == pytest.approx(places[0, 2] + 0.2, abs=1e-4)


@pytest.mark.parametrize("angle", ["", ",CA 90", ",CA 360"])
def test_an_arc_in_a_spline_is_the_circle(planner: Planner, followed: Follow, angle: str) -> None:
    begin = START + "LIN {X 1500,Y 0,Z 1200,A 0,B 90,C 0}\n"
    arc = f"SCIRC {{X 1500,Y 100,Z 1300}},{{X 1500,Y 200,Z 1200}}{angle}"
    _, alone = steps_of(followed(begin + arc), planner)
    _, block = steps_of(followed(f"{begin}SPLINE\n{arc}\nENDSPLINE"), planner)
    assert block.duration == pytest.approx(alone.duration, rel=0.02)
    chain = planner.scene("none").chain
    places = chain.tcp_poses(block.sample(np.linspace(0.0, block.duration, 200)).q)[:, :3, 3]
    ends = [chain.tcp_poses(one.positions[-1:])[0, :3, 3] for one in (alone, block)]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)
    begins = chain.tcp_poses(alone.positions[:1])[0, :3, 3]
    others = chain.tcp_poses(alone.sample(np.linspace(0.0, alone.duration, 7)[1:4]).q)[:, :3, 3]
    centre = begins + np.array([0.0, 0.1, 0.0])
    for found in (places, others):
        np.testing.assert_allclose(np.linalg.norm(found - centre, axis=1), 0.1, atol=1e-5)


@given(st.integers(1, 100), st.integers(1, 100))
@settings(max_examples=8, deadline=None)
def test_the_axes_percentages_do_not_slow_a_lin(
    planner: Planner, velocity: int, acceleration: int
) -> None:
    """Law: $VEL_AXIS and $ACC_AXIS are of axis motions; LIN has $VEL.CP and $ACC.CP alone."""

    def seconds(axes: str) -> float:
        lines = f"{START}{axes}$VEL.CP=0.25\nLIN_REL {{X 100,Z -100}}"
        texts = [parse(f"DEF TEST( )\n{lines}\nEND\n", "test.src")]
        program = follow(texts, planner.cell.machine_home, tool_in_flange(planner.cell.tcp))
        (trajectory,) = steps_of(program, planner)
        return float(trajectory.duration)

    set_to = (f"$VEL_AXIS[{j}]={velocity}\n$ACC_AXIS[{j}]={acceleration}\n" for j in range(1, 7))
    assert seconds("".join(set_to)) == seconds("")


@pytest.mark.parametrize("angle", [45, 90, 270, -90])
@pytest.mark.parametrize("block", [False, True])
def test_the_orientation_of_an_scirc_with_an_angle_is_of_its_programmed_end(
    planner: Planner, followed: Follow, angle: int, block: bool
) -> None:
    """As $CIRC_MODE has it when nobody sets it: the turn goes on at its rate, 20 deg in 180."""
    begin = START + "PTP {X 1500,Y 0,Z 1200,A 0,B 90,C 0}\n"
    circle = f"SCIRC {{X 1500,Y 100,Z 1300}},{{X 1500,Y 200,Z 1200,A 20,B 90,C 0}},CA {angle}"
    text = f"SPLINE\n{circle}\nENDSPLINE" if block else circle
    trajectory = steps_of(followed(begin + text), planner)[-1]
    first, last = planner.scene("none").chain.tcp_poses(trajectory.positions[[0, -1]])[:, :3, :3]
    turned = np.degrees(np.arccos((np.trace(first.T @ last) - 1.0) / 2.0))
    assert turned == pytest.approx(abs(angle) / 9.0, abs=1e-3)


def test_an_scirc_that_would_turn_the_tool_too_far_is_refused(
    planner: Planner, followed: Follow
) -> None:
    begin = START + "PTP {X 1500,Y 0,Z 1200,A 0,B 90,C 0}\n"
    circle = "SCIRC {X 1500,Y 100,Z 1300},{X 1500,Y 200,Z 1200,A 100,B 90,C 0},CA 350"
    with pytest.raises(KrlMotionError, match="turns by 194 deg; at most 180"):
        steps_of(followed(begin + circle), planner)


def test_a_relative_motion_ignores_status_and_turn(planner: Planner, followed: Follow) -> None:
    (plain,) = steps_of(followed(START + "PTP_REL {Z 100}"), planner)
    (other,) = steps_of(followed(START + "PTP_REL {Z 100,S 6,T 21}"), planner)
    assert other.positions[-1] == pytest.approx(plain.positions[-1])


def test_ca_sets_the_angle_of_a_circ(planner: Planner, followed: Follow) -> None:
    (trajectory,) = steps_of(followed(START + "CIRC_REL {Y 200,Z 200},{Y 400,Z 0}, CA 90"), planner)
    ends = planner.scene("none").chain.tcp_poses(trajectory.positions[[0, -1]])[:, :3, 3]
    assert ends[1] - ends[0] == pytest.approx([0.0, 0.2, 0.2], abs=1e-5)


def test_a_relative_motion_in_the_tool(planner: Planner, followed: Follow) -> None:
    """The tool of the cell looks along its x axis; a step along it is one along the tool."""
    (trajectory,) = steps_of(followed(START + "LIN_REL {X 100} #TOOL"), planner)
    poses = planner.scene("none").chain.tcp_poses(trajectory.positions[[0, -1]])
    step = poses[0, :3, :3].T @ (poses[1, :3, 3] - poses[0, :3, 3])
    assert step == pytest.approx([0.1, 0.0, 0.0], abs=1e-6)


def test_a_base_moves_its_points(planner: Planner, followed: Follow, home: np.ndarray) -> None:
    arm = Arm(planner.scene("none"))
    goal = home + np.array([0.5, 0.1, -0.1, 0.6, 0.8, 0.6])
    text = frame_text(arm, goal)
    program = followed(START + "$BASE={X 0,Y 100,Z 0,A 0,B 0,C 0}\n" + f"PTP {text}\n")
    (trajectory,) = steps_of(program, planner)
    moved, taught = arm.scene.chain.tcp_poses(np.stack([trajectory.positions[-1], goal]))
    assert moved[:3, 3] - taught[:3, 3] == pytest.approx([0.0, 0.1, 0.0], abs=1e-6)


def test_approximation_is_faster_and_stays_near_the_corner(
    planner: Planner, followed: Follow
) -> None:
    lines = "PTP {{A1 20,A3 100}}{}\nPTP {{A1 40}}"
    stopping = steps_of(followed(START + lines.format("")), planner)
    blended = steps_of(followed(START + "$APO.CPTP=50\n" + lines.format(" C_PTP")), planner)
    assert len(stopping) == 2
    assert len(blended) == 1
    assert blended[0].duration < 0.97 * sum(one.duration for one in stopping)
    assert blended[0].positions[-1] == pytest.approx(stopping[-1].positions[-1], abs=1e-9)


def test_an_output_ends_an_approximation(planner: Planner, followed: Follow) -> None:
    lines = "$APO.CPTP=50\nPTP {A1 20} C_PTP\n$OUT[1]=TRUE\nPTP {A1 40}"
    assert len(steps_of(followed(START + lines), planner)) == 2


@given(st.integers(0, 10**9))
@settings(max_examples=5, deadline=None)
def test_what_is_driven_keeps_the_limits(planner: Planner, seed: int) -> None:
    """Law: what is driven keeps speed, acceleration, jerk and torque of every axis, blends
    included.
    """
    rng = np.random.default_rng(seed)
    turns = rng.uniform([-60, -110, 60, -60, 20, -60], [60, -60, 110, 60, 80, 60], (3, 6))
    points = [", ".join(f"A{j + 1} {angle:.3f}" for j, angle in enumerate(one)) for one in turns]
    speed = rng.uniform(30, 100)
    share = rng.uniform(0, 100)
    text = (
        f"DEF T( )\nPTP XHOME\n$VEL_AXIS[1]={speed:.1f}\n$APO.CPTP={share:.1f}\nPTP "
        f"{{{points[0]}}} C_PTP\n"
        f"PTP {{{points[1]}}} C_PTP\nPTP {{{points[2]}}}\nLIN_REL {{Z 60}}\nEND\n"
    )
    cell = planner.cell
    program = follow([parse(text, "t.src")], cell.machine_home, tool_in_flange(cell.tcp))
    found = evaluate_krl(planner, program, load="none")
    for step in found.steps:
        report = step.report
        for ratio in (
            report.velocity_ratio,
            report.acceleration_ratio,
            report.jerk_ratio,
            report.torque_ratio,
        ):
            assert ratio.max() <= 1.0 + 1e-6


REFUSED = {
    "out of reach": ("PTP {X 9000,Y 0,Z 0,A 0,B 0,C 0}", "is out of reach"),
    "past an axis limit": ("PTP {A2 20}", "A2 20 deg is not within -140 to -5 deg"),
    "no such configuration": ("PTP {X 1500,Y 0,Z 1500,A 0,B 90,C 0,S 1,T 63}", "has S 1, T 63"),
    "a line that leaves the reach": (
        "LIN_REL {X 3000}",
        "the path leaves the reach or an axis limit",
    ),
    "a circle of points on a line": ("CIRC_REL {X 10},{X 20}", "lie on a line"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_the_robot_cannot_do_is_named_with_its_place(
    name: str, planner: Planner, followed: Follow
) -> None:
    line, words = REFUSED[name]
    with pytest.raises(KrlMotionError) as refused:
        steps_of(followed(START + line), planner)
    assert str(refused.value).startswith("test.src:3:1: ")
    assert words in str(refused.value)


def test_the_first_motion_must_be_a_ptp(planner: Planner, followed: Follow) -> None:
    with pytest.raises(KrlMotionError, match="the first motion must be a PTP"):
        steps_of(followed("LIN_REL {X 10}"), planner)


def test_a_kept_orientation(planner: Planner, followed: Follow) -> None:
    program = followed(START + "$ORI_TYPE=#CONSTANT\nLIN_REL {Z -100,A 30}")
    (trajectory,) = steps_of(program, planner)
    first, last = planner.scene("none").chain.tcp_poses(trajectory.positions[[0, -1]])[:, :3, :3]
    assert first == pytest.approx(last, abs=1e-9)
    assert abs(np.trace(first.T @ rotation_from_abc([0, 0, 0])) - np.trace(first)) < 1e-9


SPLINES = {  # blocks whose time is said, or follows from the speeds
    "all parts timed": (
        "PTP_SPLINE\nTIME_BLOCK START\nSPTP {A1 10}\nTIME_BLOCK PART=60\nSPTP {A1 20,A3 80}\n"
        "TIME_BLOCK END=2.5\nENDSPLINE"
    ),
    "a time at the end": (
        "PTP_SPLINE\nTIME_BLOCK START\nSPTP {A1 10}\nSPTP {A1 20,A3 80}\nTIME_BLOCK END=4\n"
        "ENDSPLINE"
    ),
}


@pytest.mark.parametrize("name", SPLINES)
def test_a_time_block_is_as_slow_as_the_override(
    name: str, planner: Planner, followed: Follow
) -> None:
    """Law: what takes t at 100 % takes t / o at an override of o, whatever sets the time."""
    took = []
    for override in (100, 50, 20):
        program = followed(f"$OV_PRO={override}\nPTP XHOME\n{SPLINES[name]}")
        steps, _ = drive(program, planner.scene("none"), planner.cell.machine_home)
        took.append(sum(step.trajectory.duration for step in steps) * override / 100)
    assert took[1:] == pytest.approx(took[:1] * 2, rel=5e-3)


# A tool that stands in the cell: the frame is that of the tool in the workpiece at the flange

WORKPIECE = (-250.0, 120.0, 400.0, 20.0, -170.0, 10.0)
FIXED = (1200.0, 700.0, 600.0, 30.0, 5.0, -8.0)


def matrix(values: tuple[float, ...]) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3] = rotation_from_abc(values[3:])
    found[:3, 3] = 1e-3 * np.array(values[:3])
    return found


def spelled(values: Any) -> str:
    return ",".join(f"{n} {v:.9f}" for n, v in zip("XYZABC", values, strict=False))


def in_workpiece(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Where the fixed tool is, seen from the workpiece."""
    held = arm.flange(q[None])[0] @ matrix(WORKPIECE)
    return np.asarray(np.linalg.solve(held, matrix(FIXED)))


def taught(arm: Arm, q: np.ndarray) -> str:
    pose = in_workpiece(arm, q)
    values = (*(1e3 * pose[:3, 3]), *abc_from_rotation(pose[:3, :3]))
    status, turn = status_turn(arm.scene.chain, q)
    return f"{spelled(values)},S {status},T {turn}"


DIRECT = f"$TOOL={{{spelled(WORKPIECE)}}}\n$BASE={{{spelled(FIXED)}}}\n$IPO_MODE=#TCP\n"
INLINE = (
    f"TOOL_DATA[3]={{{spelled(WORKPIECE)}}}\nBASE_DATA[5]={{{spelled(FIXED)}}}\n"
    "FP1={TOOL_NO 3,BASE_NO 5,IPO_FRAME #TCP}\nFDAT_ACT=FP1\nBAS(#FRAMES)\n"
)


@pytest.mark.parametrize("frames", [DIRECT, INLINE])
def test_a_tool_that_stands_in_the_cell(
    frames: str, planner: Planner, followed: Follow, home: np.ndarray
) -> None:
    """Law: a taught point is reached, $POS_ACT shows it, a LIN is straight in the workpiece."""
    arm = Arm(planner.scene("none"))
    first, second = (home + np.array(one) for one in ([0.3, 0.2, 0.1, 0.2, 0.5, 0.1], [0.1] * 6))
    program = followed(
        f"{frames}PTP XHOME\nPTP {{{taught(arm, first)}}}\nPTP {{{taught(arm, second)}}}\n"
        "$VEL.CP=0.2\nLIN_REL {X 60,Y -90}\nHERE=$POS_ACT\nPTP XHOME\nPTP HERE",
        kinematics=arm,
    )
    one, two, line, _, again = steps_of(program, planner)
    assert np.abs(one.positions[-1] - first).max() < 1e-6
    assert np.abs(two.positions[-1] - second).max() < 1e-6
    times = np.linspace(0.0, line.duration, 400)
    places = np.array([in_workpiece(arm, q)[:3, 3] for q in line.sample(times).q])
    assert places[-1] - places[0] == pytest.approx([0.06, -0.09, 0.0], abs=1e-6)
    along = (places - places[0]) @ (places[-1] - places[0])
    straight = places[0] + np.outer(along, places[-1] - places[0]) / along[-1]
    assert np.linalg.norm(places - straight, axis=1).max() < 1e-5
    speed = np.linalg.norm(np.gradient(places, times, axis=0), axis=1)
    assert speed[100:300].max() == pytest.approx(0.2, rel=5e-3)
    assert np.abs(again.positions[-1] - line.positions[-1]).max() < 1e-6


SPLINE_LAWS = {
    "$JERK.CP=1": "SLIN_REL {Y 100}",
    "$JERK={CP 1.0,ORI 500.0}": "SPLINE\nSLIN_REL {Y 100}\nENDSPLINE",
    "$GEAR_JERK[1]=5": "SPTP {A1 20}",
}


@pytest.mark.parametrize("setting", SPLINE_LAWS)
def test_jerk_that_a_program_sets_slows_motions_of_the_spline_kind_alone(
    setting: str, followed: Follow, planner: Planner
) -> None:
    """Law: a bound of the jerk makes a spline motion longer, and leaves PTP and LIN as they are."""
    motion = SPLINE_LAWS[setting]
    old = {"SLIN_REL {Y 100}": "LIN_REL {Y 100}", "SPTP {A1 20}": "PTP {A1 20}"}

    def lasts(lines: str) -> float:
        return float(steps_of(followed(START + lines), planner)[-1].duration)

    assert lasts(f"{setting}\n{motion}") > 1.2 * lasts(motion)
    plain = old.get(motion, "LIN_REL {Y 100}")
    assert lasts(f"{setting}\n{plain}") == lasts(plain)


@pytest.mark.parametrize(
    ("first", "second", "moves"),
    [
        ("LIN_REL {Y 100} C_DIS", "SLIN_REL {Z 100}", 2),
        ("SLIN_REL {Y 100} C_SPL", "LIN_REL {Z 100}", 2),
        ("SPTP {A1 20} C_SPL", "PTP {A1 0}", 2),
        ("PTP {A1 20} C_PTP", "SPTP {A2 -80}", 2),
        ("LIN_REL {Y 100} C_DIS", "LIN_REL {Z 100}", 1),
        ("SLIN_REL {Y 100} C_SPL", "SLIN_REL {Z 100}", 1),
    ],
)
def test_a_corner_between_the_two_kinds_of_motions_is_an_exact_stop(
    first: str, second: str, moves: int, followed: Follow, planner: Planner
) -> None:
    program = followed(f"{START}$APO={{CPTP 50,CDIS 30.0}}\n{first}\n{second}")
    steps, notes = drive(program, planner.scene("none"), planner.cell.machine_home)
    assert sum(step.moves for step in steps) == moves
    assert any("stops exactly" in note.text for note in notes) == (moves == 2)


@given(st.floats(0.1, 4.0), st.floats(0.1, 4.0), st.sampled_from([100.0, 7.0]))
@settings(max_examples=5, deadline=None)
def test_parts_of_a_spline_last_as_long_as_their_time_block_asks(
    planner: Planner, first: float, second: float, whole: float
) -> None:
    """Law: between its marks a spline takes the asked shares of the block's time, or its own time
    where that is longer; outside it takes its own.
    """

    def passed(*block: str) -> np.ndarray:
        begin, part, last, end = block or ("",) * 4
        lines = ["SPTP {A1 10}", begin, "SPTP {A1 20}", part, "SPTP {A1 35}", last, end]
        body = "\n".join(["PTP_SPLINE", *lines, "SPTP {A1 45}", "ENDSPLINE"])
        cell = planner.cell
        text = f"DEF T( )\n{START}{body}\nEND\n"
        program = follow([parse(text, "t.src")], cell.machine_home, tool_in_flange(cell.tcp))
        driven = steps_of(program, planner)[-1]
        fine = np.linspace(0.0, driven.duration, 20_001)
        turned = np.degrees(driven.sample(fine).q[:, 0] - driven.positions[0, 0])
        return np.diff(np.interp([0, 10, 20, 35, 45], turned, fine))

    own = passed()
    share = whole * first / (first + second)
    timed = passed(
        "TIME_BLOCK START",
        f"TIME_BLOCK PART={share:.6f}",
        f"TIME_BLOCK PART={whole - share:.6f}",
        f"TIME_BLOCK END={first + second:.6f}",
    )
    wanted = [own[0], max(first, own[1]), max(second, own[2]), own[3]]
    assert timed == pytest.approx(wanted, abs=6e-3)


def test_a_time_block_that_no_robot_keeps_is_driven_as_fast_as_it_can_and_said(
    planner: Planner, followed: Follow
) -> None:
    lines = "SPTP {A1 10}\nTIME_BLOCK START\nSPTP {A1 40}\nTIME_BLOCK END=0.05"
    program = followed(f"{START}PTP_SPLINE\n{lines}\nENDSPLINE")
    steps, notes = drive(program, planner.scene("none"), planner.cell.machine_home)
    assert any("less than the robot needs" in note.text for note in notes)
    assert planner.scene("none").limits.velocity[0] >= np.abs(steps[-1].trajectory.velocities).max()
    whole = "TIME_BLOCK START\nSPTP {A1 40}\nTIME_BLOCK END=0.05"
    all_of_it = followed(f"{START}PTP_SPLINE\n{whole}\nENDSPLINE")
    assert not evaluate_krl(planner, all_of_it).certified


def test_a_tool_faster_than_the_machine_data_is_said(followed: Follow) -> None:
    notes = followed(f"{START}$VEL.CP=5\n$ACC.CP=50\nLIN_REL {{Y 100}}").notes
    assert sum("value invalid" in note.text for note in notes) == 2


def test_a_turn_that_was_rounded_to_the_other_sign_is_taken_and_said(
    followed: Follow, planner: Planner
) -> None:
    q = np.radians([10.0, -80.0, 90.0, 20.0, 50.0, 0.01])
    text = frame_text(Arm(planner.scene("none")), q)
    place, turn = text.rstrip("}").split(",T ")
    program = followed(f"{START}PTP {place},T {int(turn) ^ 32}}}")
    steps, notes = drive(program, planner.scene("none"), planner.cell.machine_home)
    assert np.allclose(steps[-1].trajectory.positions[-1], q, atol=1e-6)
    assert any("other sign of an axis" in note.text for note in notes)


def test_ptp_rel_leads_in_the_tool_where_asked(followed: Follow, planner: Planner) -> None:
    axis = steps_of(followed(f"{START}PTP_REL {{Z 100}} #TOOL"), planner)[-1]
    path = steps_of(followed(f"{START}LIN_REL {{Z 100}} #TOOL"), planner)[-1]
    assert np.allclose(axis.positions[-1], path.positions[-1], atol=1e-6)
