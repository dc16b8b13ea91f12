"""The soft PLC: machines follow signals after their delay."""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.plc import Signal
from ir_program_runner.machines import Machines


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
