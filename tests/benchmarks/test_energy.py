"""What movements are judged by: the baseline keeps the limits, and two implementations agree on
joules.
"""

from __future__ import annotations

import numpy as np
import pytest
from _baseline import TORQUE_SHARE, baseline, fastest_baseline, phases, s_curve
from _drives import Drives

from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner
from ir_planner.checks.energy import movement_energy
from ir_planner.timing.jerk_limited_laws import GRID_S
from ir_planner.timing.ptp import free_law


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


def test_phases_last_as_long_as_those_of_the_planner() -> None:
    """Another derivation of the same law, whose phases the planner rounds up to its grid."""
    rng = np.random.default_rng(0)
    for v, a, j in 10.0 ** rng.uniform(-1.0, 2.0, (200, 3)):
        mine = float(phases(v, a, j).sum())
        theirs = GRID_S * free_law((v, a, j)).total
        assert mine <= theirs * (1.0 + 1e-9)
        assert theirs <= 1.02 * mine + 0.02


@pytest.mark.long
def test_the_baseline_keeps_the_limits_and_its_duration(planner: Planner) -> None:
    scene = planner.scene()
    drives = Drives(scene)
    limits = scene.limits
    for task in planner.cell.tasks:
        q0 = np.array(task.start)
        q1 = np.array(task.goal)
        least = fastest_baseline(q0, q1, scene, drives)
        assert least >= s_curve(q0, q1, scene).duration
        trajectory = baseline(q0, q1, scene, 1.3 * least)
        assert trajectory.duration == pytest.approx(1.3 * least, abs=1e-6)
        fastest = baseline(q0, q1, scene, least)
        at = fastest.sample(np.linspace(0.0, fastest.duration, 3000))
        assert np.abs(at.q[0] - q0).max() < 1e-12
        assert np.abs(at.q[-1] - q1).max() < 1e-9
        for motion, bound in (
            (at.qd, limits.velocity),
            (at.qdd, limits.acceleration),
            (at.qddd, limits.jerk),
        ):
            assert (np.abs(motion) <= bound * (1.0 + 1e-6)).all()
        use = np.abs(drives.torque(at.q, at.qd, at.qdd)) / drives.envelope(at.qd)
        assert use.max() <= TORQUE_SHARE * 1.001


@pytest.mark.parametrize("load", ["", "none"])
def test_two_implementations_agree_on_the_energy(planner: Planner, load: str) -> None:
    scene = planner.scene(load)
    drives = Drives(scene)
    for task in planner.cell.tasks[:3]:
        goal = Goal(configuration=np.array(task.goal))
        options = PlanOptions(load=load, max_iterations=500, planning_time=60.0)
        plan = planner.plan_regional(start=np.array(task.start), goal=goal, options=options)
        assert plan.trajectory is not None
        found = movement_energy(plan.trajectory, scene)
        assert drives.energy(plan.trajectory) == pytest.approx(found.total - found.base, rel=1e-9)
