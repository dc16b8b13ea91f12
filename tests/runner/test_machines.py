"""The soft PLC: machines follow signals after their delay."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from ir_msgs_py.plc import Signal
from ir_program_runner.machines import MOST_SIGNALS, Machines
from ir_values.errors import InvalidValueError


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


def test_signals_of_invented_names_are_bounded() -> None:
    machines = Machines()
    for k in range(MOST_SIGNALS):
        machines.hear(Signal(f"s{k}", True), 0.0)
    with pytest.raises(InvalidValueError, match="10000 signals already: another is one too many"):
        machines.hear(Signal("another", True), 0.0)
    machines.hear(Signal("s0", False), 0.0)
    assert machines.holds([Signal("s0", False), Signal("s1", True)])
