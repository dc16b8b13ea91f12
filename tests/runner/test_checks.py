"""A program that can't end well does not start."""

from __future__ import annotations

import numpy as np
import pytest

from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner.errors import ProgramError
from ir_program_runner.program import check_program, check_request, load_after
from ir_values.errors import InvalidValueError


def move(start=0.0, end=0.0, **fields):
    positions = np.zeros((2, 6))
    positions[:, 1] = start, end
    trajectory = JointTrajectory(JOINT_NAMES, [0, 10**9], positions)
    return PlannedMovement(
        **{"kind": "regional", "trajectory": trajectory, "load": "gripper", **fields}
    )


@pytest.mark.parametrize(
    ("movements", "sentence"),
    [
        ([], "the program has no movements"),
        (
            [move(trajectory=None, to_station="lathe")],
            r"step 1 of 1 \(regional lathe\) has no points",
        ),
        (
            [move(0.0, 0.5), PlannedMovement(kind="pause"), move(0.2)],
            r"step 3 of 3 \(regional\) starts -0.3000 rad at joint_a2 from where the movement "
            r"before ends",
        ),
        ([move(wait_for=("door=2",))], 'signal "door=2" has level "2"'),
        ([move(set_signals=("",))], "name of a signal is ''"),
        ([move(attach="part", load="")], "part is attached or detached, but load is not given"),
        ([move(detach="part")], "part is detached, but attached is gripper"),
    ],
)
def test_a_program_that_cannot_end_well_is_named(movements, sentence):
    with pytest.raises(ProgramError, match=sentence):
        check_program(movements)


def test_a_small_gap_between_movements_is_the_drivers_tolerance():
    check_program([move(0.0, 0.5), move(0.509)])


@pytest.mark.parametrize(
    ("load", "attach", "detach", "after"),
    [
        ("gripper", "", "", "gripper"),
        ("gripper", "part", "", "gripper+part"),
        ("gripper+part", "", "part", "gripper"),
        ("none", "part", "", "part"),
        ("part", "", "part", "none"),
        ("gripper+a", "b", "a", "gripper+b"),
        ("", "", "", ""),
    ],
)
def test_the_load_after_a_step(load, attach, detach, after):
    assert load_after(move(load=load, attach=attach, detach=detach)) == after


def test_what_is_attached_cannot_be_attached_again():
    with pytest.raises(InvalidValueError, match="part is attached, but it is already"):
        load_after(move(load="gripper+part", attach="part"))


@pytest.mark.parametrize(
    ("program_id", "steps", "sentence"),
    [
        ("", 0, "either program_id or movements"),
        ("a", 1, "either program_id or movements"),
        ("x" * 257, 0, "257 characters: at most 256"),
        ("", 1001, "1001 movements: at most 1000"),
    ],
)
def test_a_request_beyond_its_bounds_is_refused_before_it_is_read(program_id, steps, sentence):
    with pytest.raises(ProgramError, match=sentence):
        check_request(program_id, steps)


def test_a_pause_lasts_a_week_at_most():
    with pytest.raises(ProgramError, match=r"takes 1e\+308 s: at most 604800 s"):
        check_program([PlannedMovement(kind="pause", duration=1e308, power_mode="HIBERNATION")])
