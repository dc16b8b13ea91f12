"""A largest speed and acceleration of the tcp, or of every point of the tool, in four cells of two
robots.

The judge is Pinocchio: speeds and accelerations of the tcp and of points on the tool's capsules at
samples 1 ms apart. The peer is a uniform scaling: the movement without a limit, stretched until the
judge finds it within the limits.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio
from _pinocchio_arm import pinocchio_arm
from _requests_rows import NOT_ASKED, Row

from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.timing import stretched
from ir_values.arrays import FloatArray

CELLS = ("open", "table_columns", "cnc_door", "kr6_bench")
SHARES = (0.15, 0.3, 0.6, 0.9)  # of what the movement without a limit has
SAMPLE_S = 1e-3
ROUNDING = 1e-6  # relative
OBJECTIVES = ("time", "time_and_energy")


@dataclass(frozen=True)
class Seen:
    """Largest speed [m/s] and acceleration [m/s^2]."""

    speed: float
    acceleration: float


class Judge:
    """How fast points of the tool are, by Pinocchio."""

    def __init__(self, planner: Planner) -> None:
        cell = planner.cell
        self._model = pinocchio_arm(cell.robot)
        self._data = self._model.createData()
        self._tcp = np.asarray(cell.tcp)[:3, 3][None]
        self._whole = np.concatenate([self._tcp, *_surfaces(planner)])

    def seen(self, trajectory: JointTrajectory, *, whole: bool) -> Seen:
        """Along a trajectory, at samples."""
        points = self._whole if whole else self._tcp
        count = int(trajectory.duration / SAMPLE_S) + 2
        motion = trajectory.sample(np.linspace(0.0, trajectory.duration, count))
        local = pinocchio.ReferenceFrame.LOCAL
        last = self._model.njoints - 1
        speed = 0.0
        gain = 0.0
        for q, qd, qdd in zip(motion.q, motion.qd, motion.qdd, strict=True):
            pinocchio.forwardKinematics(self._model, self._data, q, qd, qdd)
            v = pinocchio.getVelocity(self._model, self._data, last, local)
            a = pinocchio.getClassicalAcceleration(self._model, self._data, last, local)
            lift = np.cross(v.angular, points)
            swing = np.cross(a.angular, points) + np.cross(v.angular, lift)
            speed = max(speed, float(np.linalg.norm(v.linear + lift, axis=1).max()))
            gain = max(gain, float(np.linalg.norm(a.linear + swing, axis=1).max()))
        return Seen(speed, gain)


def _surfaces(planner: Planner) -> Iterator[FloatArray]:
    """Points on the spheres at the ends of the tool's capsules."""
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    for load in planner.scene().loads:
        for capsule in load.capsules:
            for end in (capsule.p0, capsule.p1):
                yield end + capsule.radius * directions


def drawn_states(planner: Planner, rng: np.random.Generator, count: int) -> list[FloatArray]:
    """Free configurations within a radian of home."""
    robot = planner.cell.robot
    home = np.array(planner.cell.machine_home)
    found: list[FloatArray] = []
    while len(found) < count:
        q = home + rng.uniform(-1.0, 1.0, len(home))
        inside = (q >= robot.position_min).all() and (q <= robot.position_max).all()
        if inside and planner.check_state(q).valid:
            found.append(q)
    return found


def cost(report: TrajectoryReport, planner: Planner) -> float:
    """J of a movement."""
    worth = planner.cell.robot.time_value
    return report.energy - report.base_energy + worth * report.duration


def rows(count: int) -> Iterator[Row]:
    """So many cases, a cell after the other."""
    planners = [Planner(cell) for cell in CELLS]
    judges = [Judge(planner) for planner in planners]
    for case in range(count):
        rng = np.random.default_rng([case, 10])
        planner = planners[case % len(CELLS)]
        judge = judges[case % len(CELLS)]
        start, goal = drawn_states(planner, rng, 2)
        whole = bool(rng.integers(2))
        share = SHARES[int(rng.integers(len(SHARES)))]
        objective = OBJECTIVES[int(rng.integers(len(OBJECTIVES)))]
        free = planner.plan_regional(start=start, goal=goal, objective=objective)
        name = f"{CELLS[case % len(CELLS)]}, {share:g} of the speed, case {case}"
        if free.trajectory is None:
            why = f"without a limit: {free.status.message.split(':')[0][:80]}"
            yield Row(name, why, False, (), 0.0)
            continue
        before = judge.seen(free.trajectory, whole=whole)
        speed = share * before.speed
        gain = share * share * before.acceleration
        began = time.process_time()
        plan = planner.plan_regional(
            start=start,
            goal=goal,
            objective=objective,
            tool_speed=speed,
            tool_acceleration=gain,
            whole_tool=whole,
        )
        seconds = time.process_time() - began
        factor = max(before.speed / speed, float(np.sqrt(before.acceleration / gain)))
        peer = planner.evaluate(stretched(free.trajectory, factor)).report
        if plan.trajectory is None:
            why = plan.status.message.split(":")[0][:80]
            yield Row(name, why, False, (), seconds, peer_only=peer.certified)
            continue
        after = judge.seen(plan.trajectory, whole=whole)
        report = plan.report
        wrong = []
        if after.speed > speed * (1.0 + ROUNDING):
            wrong.append("the tool is faster than asked")
        if after.acceleration > gain * (1.0 + ROUNDING):
            wrong.append("the tool changes its speed by more than asked")
        if after.speed > report.tool_speed * (1.0 + ROUNDING):
            wrong.append("the tool is faster than reported")
        if after.acceleration > report.tool_acceleration * (1.0 + ROUNDING):
            wrong.append("the tool changes its speed by more than reported")
        paid = cost(peer, planner) if peer.certified else NOT_ASKED
        yield Row(name, "", report.certified, tuple(wrong), seconds, cost(report, planner), paid)
