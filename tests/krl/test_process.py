"""Which motions are a process: judged by the sentence that defines it, on generated sequences of
commands.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_krl import Followed, Motion, SourcePlace
from ir_krl.run import Command, SetOutput, Speeds, StandStill, Target
from ir_planner import Planner
from ir_planner.krl.execution import drive, process_motions

SPEEDS = Speeds((1.0,) * 6, (1.0,) * 6, 0.1, 1.0, 1.0, 1.0, 1.0)
TARGET = Target(None, {"X": 1.0}, None, None, True, False, np.eye(4), np.eye(4))
COMMANDS: dict[str, Command] = {
    "p": Motion("ptp", TARGET, SPEEDS, SourcePlace()),
    "l": Motion("lin", TARGET, SPEEDS, SourcePlace()),
    "w": StandStill(1.0, SourcePlace()),
    "A": SetOutput(1, True, SourcePlace()),
    "a": SetOutput(1, False, SourcePlace()),
    "B": SetOutput(2, True, SourcePlace(), on_path=True),
    "b": SetOutput(2, False, SourcePlace()),
    "P": SetOutput(1, True, SourcePlace(), pulse=0.5),
}


def defined(letters: str) -> set[int]:
    """By definition: between an output's on and its next off, without a PTP."""
    found: set[int] = set()
    for on, off in ("Aa", "Bb"):
        for i in (k for k, letter in enumerate(letters) if letter == on):
            j = letters.find(off, i)
            if j > i and "p" not in letters[i:j]:
                found |= {k for k in range(i, j) if letters[k] == "l"}
    return found


@settings(max_examples=40, deadline=None)
@given(st.text("pllwAaBbP", max_size=14))
def test_a_process_is_what_lies_between_on_and_off(letters: str) -> None:
    assert process_motions([COMMANDS[letter] for letter in letters]) == defined(letters)


def test_a_gripper_that_is_carried_by_a_ptp_is_no_process() -> None:
    assert defined("pAlplap") == set()
    assert defined("pAllap") == {2, 3}


ARC = "CIRC_REL {X 20,Y 20},{X 0,Y 40}"
SPLINE = "SPLINE\nSLIN_REL {X -20,Y 5}\nSLIN_REL {X -20,Z 10}\nENDSPLINE"


@pytest.mark.parametrize("motions", [f"LIN_REL {{X 30,A 3}}\n{ARC}\n{SPLINE}", f"{ARC},CA 400"])
def test_segments_draw_what_the_tool_draws(
    planner: Planner, followed: Callable[..., Followed], motions: str
) -> None:
    """Poses of the segments lie on the driven path, the speed is the one that the override
    leaves.
    """
    program = followed(f"PTP XHOME\nPTP {{A1 30,A5 30}}\n$VEL.CP=0.2\n$OV_PRO=50\n{motions}")
    scene = planner.scene("")
    steps, _ = drive(program, scene, planner.cell.machine_home)
    for step in steps[1:]:
        (drawn,) = step.tool
        assert drawn is not None
        times = np.linspace(0.0, step.trajectory.duration, 1001)
        tcp = scene.chain.tcp_poses(step.trajectory.sample(times).q)
        poses = np.array([drawn.start, *(pose for one in drawn.segments for pose in one.poses)])
        near = np.linalg.norm(tcp[None, :, :3, 3] - poses[:, None, :3, 3], axis=2)
        assert near.min(axis=1).max() < 2e-4
        for k, place in ((0, 0), (-1, -1)):
            assert tcp[k] == pytest.approx(poses[place], abs=1e-4)
        assert [one.tool_speed for one in drawn.segments] == pytest.approx(
            [0.1] * len(drawn.segments)
        )
