"""The law of stops: the table of docs/driver.md, walked and drawn against a second machine."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from ir_msgs_py.modes import READY, Mode
from ir_msgs_py.stop_numbers import before_first_stop
from ir_sim_driver.emergency_stop import StopState

sys.path.insert(0, str(Path(__file__).parent))  # benchmarks/hostile.py reads this file too
from stop_core import Core, same
from stop_reference import Reference

BITS = ("emergency_stop", "conf_mess", "drives_on", "drives_off", "ab", "hib")


class Pair:
    """The core and the reference, told the same."""

    def __init__(self, before: int = 0) -> None:
        self.core = Core(before)
        self.reference = Reference(before)

    def clone(self) -> Pair:
        new = same(self)
        new.core = self.core.clone()
        new.reference = reference = same(self.reference)
        reference.signals = {name: same(each) for name, each in reference.signals.items()}
        return new

    def write(self, levels: dict[str, bool]) -> None:
        self.core.write(levels)
        self.reference.write(levels)

    def fault(self) -> None:
        self.core.fault()
        self.reference.fault()

    def recover(self) -> None:
        if self.core.on_the_network:
            self.core.recover()
            self.reference.recover()

    def rest(self) -> None:
        """The program runner closes the brakes."""
        if self.core.on_the_network:
            self.core.rest()
            self.reference.write({"drives_off": True}, "program")

    def take_back(self) -> None:
        """The program runner takes its drives_off back."""
        if self.core.on_the_network:
            self.core.take_back()
            self.reference.take_back()

    def end_rest(self) -> None:
        """The program runner leaves a rest on brakes."""
        if self.core.on_the_network:
            self.core.end_rest()
            self.reference.end_rest()

    def wait(self, milliseconds: int) -> None:
        for _ in range(milliseconds):
            self.pass_time(1)

    def settle(self) -> None:
        """21 ms, in which all levels count that were written before: nothing happens between the
        first and the last one.
        """
        for milliseconds in (1, 19, 1):
            self.pass_time(milliseconds)

    def pass_time(self, milliseconds: int) -> None:
        """At once."""
        there = self.core.on_the_network
        woken = self.core.step(milliseconds * 1e-3)
        self.reference.now += milliseconds - 1
        self.reference.tick(there)
        if there and not self.core.on_the_network:
            self.reference.left_network()
        if woken:
            self.reference.woken()

    def difference(self) -> str:
        stop = self.core.plc.stop
        mine = (stop.state.value, stop.number)
        other = (self.reference.state, self.reference.number)
        if mine != other:
            return f"the driver is {mine}, the table says {other}"
        kept_off = self.core.control.latches.drives_off or self.core.plc.levels.drives_off
        if self.core.on_the_network and kept_off != self.reference.drives_kept_off:
            return f"drives_on is needed: {kept_off}, the table says {not kept_off}"
        if stop.stopped and self.core.moving is not None:
            return f"a goal runs in {stop.state.value}"
        if self.core.moving is not None and self.core.moving != stop.number:
            return "a goal of before the stop runs"
        return ""


def drawn(steps: int, seed: int) -> str:
    """A random sequence of a PLC, of its person and of time; the first difference, "": none."""
    generator = random.Random(seed)
    pair = Pair()
    ticket = 0

    def write() -> None:
        bits = generator.sample(BITS, generator.choice((1, 1, 1, 2, 3)))
        pair.write({bit: generator.random() < 0.5 for bit in bits})

    def send() -> None:
        nonlocal ticket
        ticket = pair.core.send("a") or ticket

    def wake() -> None:
        pair.core.control.latches.wake = pair.core.mode is Mode.HIBERNATION

    def leap() -> None:
        pair.wait(21)
        pair.pass_time(generator.choice((500, 1_000, 3_000, 25_000, 130_000)))

    program = (pair.rest, pair.take_back, pair.end_rest)
    actions = (write, pair.fault, pair.recover, send, *program, wake, leap)
    weights = (70, 3, 5, 6, 4, 3, 3, 7, 5)
    for step in range(steps):
        generator.choices(actions, weights)[0]()
        pair.wait(generator.choice((0, 1, 5, 19, 20, 21, 40)))
        if generator.random() < 0.06:
            pair.core.checked(ticket)
        difference = pair.difference()
        if difference:
            return f"seed {seed}, step {step}: {difference}"
    return ""


@pytest.mark.parametrize("seed", range(20))
def test_random_sequences_of_a_plc_are_what_the_table_says(seed: int) -> None:
    assert drawn(200, seed) == ""


@pytest.mark.parametrize("seed", range(20))
def test_what_follows_another_driver_process_moves_nothing(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Driver processes one after the other, each started a millisecond or more after the last, with
    any number of stops; programs of all of them go on whenever they like, each with the number of
    the stop that it knows.
    """
    generator = random.Random(seed)
    now_ms = 1_795_973_304_123
    programs: list[tuple[int, int]] = []
    for process in range(8):
        now_ms += generator.choice((1, 2, 1_000, 86_400_000))
        now_ns = now_ms * 1_000_000
        monkeypatch.setattr(time, "time_ns", lambda now_ns=now_ns: now_ns)
        pair = Pair(before_first_stop())
        for _ in range(20):
            for level in (True, False):
                pair.write({"emergency_stop": generator.random() < 0.5 and level})
                pair.settle()
            pair.recover()
            assert pair.difference() == ""
            programs.append((process, pair.core.plc.stop.number))
            for known, number in programs:
                moves = pair.core.start(number)
                last = number == pair.reference.number
                may = known == process and last and not pair.core.control.refusal()
                assert moves == may, (known, process, number)


# -- all interleavings


@dataclass
class World:
    """Core and reference with two clients, a runner, and what was sent before the last stop."""

    pair: Pair
    tickets: tuple[int, int] = (0, 0)
    program: int | None = None  # number of the stop that the running program knows

    def clone(self) -> World:
        return World(self.pair.clone(), self.tickets, self.program)

    def key(self) -> tuple[Any, ...]:
        core = self.pair.core
        number = core.plc.stop.number
        waiting = sorted(
            core.queue._waiting[t].number == number if t in core.queue else 2 for t in self.tickets
        )
        program = None if self.program is None else self.program == number
        return (*core.key(), tuple(waiting), program)


Event = Callable[[World], str]


def _toggle(bit: str) -> Event:
    def event(world: World) -> str:
        raw = world.pair.core.plc.raw
        world.pair.write({bit: not getattr(raw, bit)})
        return ""

    return event


def _send(client: int) -> Event:
    def event(world: World) -> str:
        ticket = world.pair.core.send(str(client))
        if ticket:
            first, second = world.tickets
            world.tickets = (ticket, second) if client == 0 else (first, ticket)
        return ""

    return event


def _checked(client: int) -> Event:
    def event(world: World) -> str:
        core = world.pair.core
        ticket = world.tickets[client]
        sent = core.queue._waiting[ticket].number if ticket in core.queue else -1
        if core.checked(ticket) and sent != world.pair.reference.number:
            return "a goal that was sent before a stop moves the robot after it"
        return ""

    return event


def _program_starts(world: World) -> str:
    if not world.pair.core.plc.stop.stopped:
        world.program = world.pair.core.plc.stop.number
    return ""


def _program_drives(world: World) -> str:
    if world.program is None:
        return ""
    if world.pair.core.start(world.program) and world.program != world.pair.reference.number:
        return "a program drives on after a stop"
    return ""


def _program_rests(world: World) -> str:
    if world.program == world.pair.core.plc.stop.number and not world.pair.core.plc.stop.stopped:
        world.pair.rest()
    return ""


def _program(what: Callable[[Pair], None]) -> Event:
    """What a program does at the end of its rest, also after a stop that ended it."""

    def event(world: World) -> str:
        before = world.pair.core.plc.stop.state
        if world.program is not None:
            what(world.pair)
        recovered = before is not StopState.RUN and not world.pair.core.plc.stop.stopped
        return "a program recovers" if recovered else ""

    return event


def _short(world: World) -> str:
    world.pair.settle()
    return ""


def _long(world: World) -> str:
    world.pair.settle()
    world.pair.pass_time(130_000)
    return ""


def _plain(what: Callable[[World], None]) -> Event:
    def event(world: World) -> str:
        what(world)
        return ""

    return event


def _wake(world: World) -> None:
    if world.pair.core.mode is Mode.HIBERNATION:
        world.pair.core.control.latches.wake = True


EVENTS: dict[str, Event] = {
    **{bit: _toggle(bit) for bit in BITS},
    "client a sends": _send(0),
    "client b sends": _send(1),
    "goal a is checked": _checked(0),
    "goal b is checked": _checked(1),
    "program starts": _program_starts,
    "program drives": _program_drives,
    "program rests": _program_rests,
    "program takes it back": _program(Pair.take_back),
    "program ends its rest": _program(Pair.end_rest),
    "fault": _plain(lambda world: world.pair.fault()),
    "recover": _plain(lambda world: world.pair.recover()),
    "wake": _plain(_wake),
    "21 ms": _short,
    "130 s": _long,
}


def settled(*levels: dict[str, bool]) -> World:
    """A world in the mode that these levels lead to."""
    world = World(Pair())
    for each in levels:
        world.pair.write(each)
        _short(world)
        world.pair.pass_time(1_000)
    return world


STARTS: dict[str, Callable[[], World]] = {
    "on motors": lambda: settled(),
    "on brakes": lambda: _after(settled({"drives_off": True}), "130 s"),
    "in a program's rest": lambda: _after(settled(), "program starts", "program rests", "130 s"),
    "bus power off": lambda: _after(settled({"ab": True}), "130 s"),
    "on the way to bus power off": lambda: settled({"ab": True}),
    "on the way from it": lambda: _after(settled({"ab": True}), "130 s", "ab", "21 ms"),
    "on the way to hibernation": lambda: settled({"hib": True}),
    "hibernating": lambda: _after(settled({"hib": True}), "130 s"),
    "waking": lambda: _after(settled({"hib": True}), "130 s", "130 s", "wake", "21 ms"),
    "stopped": lambda: _after(settled(), "emergency_stop", "21 ms"),
}


def _after(world: World, *events: str) -> World:
    for name in events:
        assert EVENTS[name](world) == ""
    return world


def walked(
    start: str, depth: int, seen: dict[int, int] | None = None
) -> tuple[int, int, list[str]]:
    """All interleavings of EVENTS to this depth, each state once: states, steps, what is wrong.

    seen: of walks from other starts; a state that they reached in as few events is not walked on
    from again. Of a state its hash of 64 bits is remembered: among three million, two that differ
    share one with a probability of 3e-7.
    """
    seen = {} if seen is None else seen
    known = len(seen)
    first = STARTS[start]()
    seen[hash(first.key())] = 0
    front: list[tuple[World, tuple[str, ...]]] = [(first, ())]
    wrong: list[str] = []
    steps = 0
    for level in range(1, depth + 1):
        behind: list[tuple[World, tuple[str, ...]]] = []
        for world, path in front:
            for name, event in EVENTS.items():
                after = world.clone()
                steps += 1
                found = event(after) or after.pair.difference() or _moves_by_itself(world, after)
                if found:
                    wrong.append(f"{start}: {', '.join((*path, name))}: {found}")
                    continue
                key = hash(after.key())
                if level < seen.get(key, depth + 1):
                    seen[key] = level
                    if level < depth:
                        behind.append((after, (*path, name)))
        front = behind
    return len(seen) - known, steps, wrong


def _moves_by_itself(before: World, after: World) -> str:
    """A stop that is over with the motors on again, without what the table asks for."""
    core = after.pair.core
    stopped = core.plc.stop.stopped
    on = core.mode in READY
    return "motors are on while a stop is latched" if stopped and on else ""


@pytest.mark.parametrize("start", STARTS)
def test_no_interleaving_moves_the_robot_without_a_recovery(start: str) -> None:
    states, _, wrong = walked(start, 4)
    assert states > 1000
    assert wrong == []


# -- what happened


def acknowledged(*before: dict[str, bool]) -> Pair:
    """conf_mess at some time before, then these messages, one every 25 ms."""
    pair = Pair()
    for levels in ({"conf_mess": True}, {"conf_mess": False}, *before):
        pair.write(levels)
        pair.wait(25)
    return pair


@pytest.mark.parametrize("bit", ["ab", "hib"])
def test_an_old_acknowledgement_and_a_pulse_of_drives_on_recover_nothing(bit: str) -> None:
    pair = acknowledged({bit: True})
    pair.pass_time(3_100 if bit == "ab" else 59_000)
    for levels in (
        {"emergency_stop": True},
        {"emergency_stop": False},
        {"drives_on": True},
        {"drives_on": False},
        {bit: False},
    ):
        pair.write(levels)
        pair.wait(25)
    pair.core.control.latches.wake = True
    for _ in range(3):
        pair.pass_time(130_000)
        pair.core.control.latches.wake = pair.core.mode is Mode.HIBERNATION
    assert pair.core.plc.stop.stopped
    assert pair.core.mode is Mode.EMERGENCY_STOP
    assert not pair.core.start(pair.core.plc.stop.number)


def test_levels_of_one_message_don_t_follow_each_other() -> None:
    pair = Pair()
    pair.write({"emergency_stop": True})
    pair.wait(25)
    pair.write({"emergency_stop": False, "conf_mess": True, "drives_on": True})
    pair.wait(100)
    assert pair.core.plc.stop.state is StopState.RELEASED


def test_a_program_s_wish_to_leave_its_rest_never_recovers() -> None:
    pair = Pair()
    for levels in (
        {"drives_off": True},
        {"emergency_stop": True},
        {"emergency_stop": False},
        {"conf_mess": True},
        {"drives_off": False},
    ):
        pair.write(levels)
        pair.wait(25)
    pair.core.end_rest()
    pair.wait(1000)
    assert pair.core.plc.stop.state is StopState.ACKNOWLEDGED
    assert pair.core.mode is Mode.EMERGENCY_STOP


def test_what_a_program_has_taken_back_hinders_no_recovery() -> None:
    world = _after(STARTS["in a program's rest"](), "program ends its rest", "21 ms")
    for name in ("emergency_stop", "emergency_stop", "conf_mess", "drives_on", "21 ms"):
        assert EVENTS[name](world) == ""
        assert world.pair.difference() == ""
    assert world.pair.core.plc.stop.state is StopState.RUN


@pytest.mark.parametrize("when", ["before", "while it is latched", "after"])
@pytest.mark.parametrize("also_plc", [False, True])
def test_a_stop_in_a_program_s_rest_leaves_no_drives_off_but_the_plc_s(
    when: str, also_plc: bool
) -> None:
    """What the program takes back keeps no goal off after the recovery, and opens no brakes before
    it; a pulse of the PLC does.
    """
    pair = Pair()
    pair.rest()
    pair.wait(25)
    if also_plc:
        pair.write({"drives_off": True})
    pair.wait(500)
    if also_plc:
        pair.write({"drives_off": False})
    if when == "before":
        pair.core.end_rest()
    pair.write({"emergency_stop": True})
    if when == "while it is latched":
        pair.core.take_back()
    pair.wait(25)
    pair.write({"emergency_stop": False})
    pair.wait(50)
    assert pair.core.mode is Mode.EMERGENCY_STOP
    assert pair.core.plc.stop.state is StopState.RELEASED
    pair.recover()
    if when == "after":
        pair.core.take_back()
    pair.wait(1000)
    assert pair.core.start(pair.core.plc.stop.number) == (not also_plc)


def test_bits_that_are_1_at_waking_into_a_stop_are_as_at_any_waking() -> None:
    """drives_off counts, and stays latched when it falls; AB is ignored until it has been 0."""
    world = STARTS["waking"]()
    _after(world, "emergency_stop", "drives_off", "ab", "130 s", "drives_off", "21 ms")
    pair = world.pair
    assert pair.core.mode is Mode.EMERGENCY_STOP
    assert pair.core.control.latches.drives_off
    assert pair.core.plc.rest is None
    pair.write({"emergency_stop": False})
    pair.wait(25)
    pair.recover()
    pair.wait(1000)
    assert pair.core.plc.rest is None
    assert not pair.core.start(pair.core.plc.stop.number)


def test_a_wish_to_leave_a_rest_is_void_after_a_stop() -> None:
    """The program has asked for open brakes before the stop: nothing asks for them after it."""
    pair = Pair()
    pair.rest()
    pair.wait(25)
    pair.core.end_rest()  # counts when drives_off has been 0 for the debounce
    pair.write({"emergency_stop": True})
    pair.wait(25)
    assert pair.core.control.latches.end_rest is None
    assert not pair.core.control.pauses.wants_motors


def test_drives_on_in_the_message_of_its_acknowledgement_recovers_nothing() -> None:
    pair = Pair()
    for levels in (
        {"emergency_stop": True},
        {"emergency_stop": False},
        {"conf_mess": True, "drives_on": True},
    ):
        pair.write(levels)
        pair.wait(25)
    assert pair.core.plc.stop.state is StopState.ACKNOWLEDGED
