"""The time that a running program still takes by plan."""

from __future__ import annotations

import numpy as np

from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner.program import RunProgress


def move(start=0.0, end=0.0, **fields):
    positions = np.zeros((2, 6))
    positions[:, 1] = start, end
    trajectory = JointTrajectory(JOINT_NAMES, [0, 10**9], positions)
    return PlannedMovement(
        **{"kind": "regional", "trajectory": trajectory, "load": "gripper", **fields}
    )


def test_the_rest_of_a_program_is_what_is_planned():
    progress = RunProgress(
        "id", [move(duration=2.0), PlannedMovement(kind="pause", duration=10.0)], started=0.0
    )
    progress.begin(0)
    assert progress.remaining(6.0) == 12.0
    progress.step_started = 5.0
    assert progress.remaining(6.0) == 11.0
    assert progress.remaining(60.0) == 10.0
