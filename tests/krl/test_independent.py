"""What is driven, against this file's own kinematics link by link, and the seven-phase law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ir_krl import Followed
from ir_planner import Planner
from ir_planner.krl.execution import drive

Follow = Callable[..., Followed]


def turned(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation about an axis by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return pose


def tool_in_foot(planner: Planner, q: np.ndarray) -> np.ndarray:
    """The tcp in the robot's foot, link by link."""
    robot = planner.cell.robot
    pose = np.eye(4)
    for origin, axis, angle in zip(robot.joint_origin, robot.joint_axis, q, strict=True):
        pose = pose @ origin @ turned(axis, angle)
    return pose @ planner.cell.tcp


def frame(x: float, y: float, z: float, a: float, b: float, c: float) -> np.ndarray:
    """X, Y, Z [mm], A about z, B about the new y, C about the new x [deg], as KUKA has them."""
    turns = zip(np.eye(3)[::-1], np.radians([a, b, c]), strict=True)
    pose = np.eye(4)
    pose[:3, 3] = np.array([x, y, z]) * 1e-3
    for axis, angle in turns:
        pose = pose @ turned(axis, angle)
    return pose


def least_time(distance: float, v: float, a: float, j: float) -> float:
    """Of a movement from rest to rest over a distance with bounds of speed, acceleration and
    jerk.
    """

    def ramp(peak: float) -> float:
        return peak / a + a / j if peak * j >= a * a else 2.0 * np.sqrt(peak / j)

    if v * ramp(v) <= distance:
        return ramp(v) + distance / v
    low = 0.0
    high = v
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle * ramp(middle) <= distance else (low, middle)
    return 2.0 * ramp(low)


def moves(program: Followed, planner: Planner) -> list:
    scene = planner.scene("none")
    return [
        one.trajectory for one in drive(program, scene, planner.cell.machine_home)[0] if one.moves
    ]


def test_frames_are_reached_by_kinematics_of_ones_own(planner: Planner, followed: Follow) -> None:
    rng = np.random.default_rng(4)
    low = [1400, -300, 1000, -15, 80, -15]
    high = [1600, 300, 1300, 15, 100, 15]
    lines = []
    targets = rng.uniform(low, high, (8, 6))
    for row in targets:
        values = (f"{name} {value:.6f}" for name, value in zip("XYZABC", row, strict=True))
        lines.append(f"PTP {{{','.join(values)}}}")
    driven = moves(
        followed("PTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}\n" + "\n".join(lines)), planner
    )
    for one, row in zip(driven, targets, strict=True):
        reached = tool_in_foot(planner, one.positions[-1])
        wanted = frame(*row)
        assert 1e3 * np.linalg.norm(reached[:3, 3] - wanted[:3, 3]) < 1e-3
        assert reached[:3, :3] == pytest.approx(wanted[:3, :3], abs=2e-6)  # 1e-4 deg


@pytest.mark.parametrize("share", [15, 40])
def test_a_ptp_takes_the_time_of_its_slowest_axis(
    planner: Planner, followed: Follow, share: int
) -> None:
    """Law: one seven-phase law for all axes, each within its share of speed, acceleration and
    jerk.
    """
    rng = np.random.default_rng(share)
    limits = planner.scene("none").limits
    goals = rng.uniform([-50, -115, 60, -50, 20, -50], [50, -65, 110, 50, 70, 50], (6, 6))
    shares = "\n".join(f"$VEL_AXIS[{k}]={share}\n$ACC_AXIS[{k}]={share}" for k in range(1, 7))
    lines = [
        "PTP {" + ",".join(f"A{k + 1} {v:.6f}" for k, v in enumerate(row)) + "}" for row in goals
    ]
    driven = moves(followed("\n".join([lines[0], shares, *lines[1:]])), planner)
    part = share / 100.0
    for one, before, after in zip(driven, goals[:-1], goals[1:], strict=True):
        distance = np.abs(np.radians(after - before))
        bounds = (limits.velocity, limits.acceleration, limits.jerk)
        v, a, j = (float(np.min(bound * part / distance)) for bound in bounds)
        assert one.duration == pytest.approx(least_time(1.0, v, a, j), rel=0.01, abs=0.005)


def test_a_line_keeps_the_tools_speed_and_acceleration(planner: Planner, followed: Follow) -> None:
    text = "PTP {A1 0,A2 -90,A3 100,A4 0,A5 50,A6 0}\n$VEL.CP=0.25\n$ACC.CP=1.0\nLIN_REL {Y 400}"
    (one,) = moves(followed(text), planner)
    times = np.linspace(0.0, one.duration, 400)
    places = np.array([tool_in_foot(planner, q)[:3, 3] for q in one.sample(times).q])
    assert places[-1] - places[0] == pytest.approx([0.0, 0.4, 0.0], abs=1e-6)
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)
    assert speed.max() == pytest.approx(0.25, rel=5e-3)
    assert one.duration == pytest.approx(least_time(0.4, 0.25, 1.0, 10.0), rel=0.01)
