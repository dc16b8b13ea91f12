"""A program that can't end well does not start, and the parts of the runner that stand alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from ir_msgs_py.errors import InvalidValueError, ParameterError
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner.checks import check_program, load_after
from ir_program_runner.errors import ProgramError
from ir_program_runner.machines import Machines
from ir_program_runner.progress import Progress
from ir_program_runner.settings import LinkSettings, ProgramSettings
from ir_program_runner.wake_on_lan import magic_packet


def move(start=0.0, end=0.0, **fields):
    positions = np.zeros((2, 6))
    positions[:, 1] = start, end
    trajectory = JointTrajectory(JOINT_NAMES, [0, 10**9], positions)
    return PlannedMovement(**{"kind": "regional", "trajectory": trajectory, "load": "gripper", **fields})


@pytest.mark.parametrize(
    ("movements", "sentence"),
    [
        ([], "the program has no movements"),
        ([move(trajectory=None, to_station="lathe")], r"step 1 of 1 \(regional lathe\) has no points"),
        (
            [move(0.0, 0.5), PlannedMovement(kind="pause"), move(0.2)],
            r"step 3 of 3 \(regional\) starts -0.3000 rad at joint_a2 from where the movement before ends",
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


def test_the_magic_packet_is_six_ff_and_the_mac_sixteen_times():
    packet = magic_packet("02:00:00:C4:02:10")
    assert len(packet) == 102
    assert packet == b"\xff" * 6 + bytes([2, 0, 0, 0xC4, 2, 0x10]) * 16


def test_settings_name_what_is_wrong():
    with pytest.raises(ParameterError, match=r"wake_margin is -1 s: it must be 0 \.\. 3600 s"):
        ProgramSettings(wake_margin=-1.0)
    with pytest.raises(ValueError, match="mac is '12': it must be six hex bytes"):
        LinkSettings(mac="12")


@dataclass(frozen=True)
class Described:
    name: str
    initial: bool = False
    follows: str = ""
    delay: float = 0.0


def test_a_machine_answers_after_its_delay():
    machines = Machines(
        [Described("door_open", follows="open_door", delay=1.5), Described("part_there", True)]
    )
    assert machines.holds([Signal("part_there", True), Signal("door_open", False)])
    machines.set(Signal("open_door", True), now=10.0)
    assert machines.take_answers(11.4) == ()
    assert machines.take_answers(11.5) == (Signal("door_open", True),)
    assert machines.take_answers(99.0) == ()


def test_a_later_order_replaces_the_answer_that_is_due():
    machines = Machines([Described("door_open", follows="open_door", delay=1.0)])
    machines.set(Signal("open_door", True), now=0.0)
    machines.set(Signal("open_door", False), now=0.5)
    assert machines.take_answers(9.0) == (Signal("door_open", False),)


def test_a_signal_that_was_never_set_is_zero():
    assert Machines().holds([Signal("nothing", False)])
    assert not Machines().holds([Signal("nothing", True)])


def test_the_rest_of_a_program_is_what_is_planned():
    progress = Progress("id", [move(duration=2.0), PlannedMovement(kind="pause", duration=10.0)], started=0.0)
    progress.begin(0)
    assert progress.remaining(6.0) == 12.0
    progress.step_started = 5.0
    assert progress.remaining(6.0) == 11.0
    assert progress.remaining(60.0) == 10.0
