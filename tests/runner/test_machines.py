"""The soft PLC: machines follow signals after their delay."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_description import load_cell
from ir_description.cell import ProcessTimes
from ir_msgs_py.plc import Signal
from ir_program_runner.machines import MOST_SIGNALS, Machines, MachineTime
from ir_values.errors import InvalidValueError


@dataclass(frozen=True)
class Described:
    name: str
    initial: bool = False
    follows: str = ""
    delay: float = 0.0
    process: str = ""


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


LATHE = (Described("start"), Described("done", follows="start", process="lathe"))


@given(
    orders=st.lists(st.tuples(st.floats(0.01, 60.0), st.booleans()), max_size=12),
    seconds=st.floats(0.5, 30.0),
)
def test_a_part_is_done_its_process_after_the_last_start_unless_it_was_taken(
    orders: list[tuple[float, bool]], seconds: float
) -> None:
    """However often it is started and cleared, a machine says what a stopwatch says."""
    machines = Machines(LATHE, {"lathe": ProcessTimes(seconds, seconds)})
    now = 0.0
    begun = None
    for wait, level in [*orders, (60.0, True)]:
        now += wait
        for answer in machines.take_answers(now):
            machines.hear(answer, now)
        finished = begun is not None and now >= begun + seconds
        assert machines.holds([Signal("done", finished)])
        machines.set(Signal("start", level), now)
        begun = now if level else None
        assert machines.holds([Signal("done", False)])


@given(
    waits=st.lists(st.floats(0.01, 20.0), min_size=1, max_size=12),
    seconds=st.floats(0.5, 30.0),
    capacity=st.integers(1, 3),
)
def test_a_machine_works_on_as_many_parts_as_it_can_and_others_wait_in_their_order(
    waits: list[float], seconds: float, capacity: int
) -> None:
    """Each part in a slot of its own; part k begins when it is there and part k - capacity is
    finished.
    """
    slots = [
        described
        for k in range(len(waits))
        for described in (
            Described(f"start{k}"),
            Described(f"done{k}", follows=f"start{k}", process="lathe"),
        )
    ]
    times = {"lathe": ProcessTimes(seconds, seconds)}
    machines = Machines(slots, times, capacities={"lathe": capacity})
    now = 0.0
    ends: list[float] = []
    for k, wait in enumerate(waits):
        now += wait
        for answer in machines.take_answers(now):
            machines.hear(answer, now)
        machines.set(Signal(f"start{k}", True), now)
        free = ends[k - capacity] if k >= capacity else now
        ends.append(max(now, free) + seconds)
        for j, end in enumerate(ends):
            assert machines.holds([Signal(f"done{j}", end <= now)])


def test_times_that_vary_are_drawn_from_their_samples_and_again_with_their_seed() -> None:
    def times(seed: int) -> list[float]:
        machines = Machines(LATHE, {"lathe": ProcessTimes.of([3.0, 4.0, 9.0])}, seed)
        found = []
        for part in range(20):
            machines.set(Signal("start", True), 100.0 * part)
            found.append(round(machines.next_answer - 100.0 * part, 9))
            machines.take_answers(100.0 * part + 50.0)
            machines.hear(Signal("done", True), 100.0 * part + 50.0)
            machines.set(Signal("start", False), 100.0 * part + 60.0)
            machines.take_answers(100.0 * part + 70.0)
        return found

    assert set(times(1)) == {3.0, 4.0, 9.0}
    assert times(1) == times(1) != times(2)


def test_the_machines_of_a_cell_that_reports_no_process_answer_as_before() -> None:
    machines = Machines.of(load_cell("demo"))
    assert machines.next_answer == float("inf")


@given(st.lists(st.tuples(st.none() | st.floats(0.0, 1e4), st.floats(0.0, 5.0)), min_size=1))
def test_machines_take_the_time_of_the_plant_that_is_heard(
    readings: list[tuple[float | None, float]],
) -> None:
    """It never goes back, and passes as in the plant between two readings of it, else as on the
    clock.
    """
    plant: float | None = None
    node = 0.0
    time = MachineTime(lambda: plant, lambda: node)
    before = time()
    for reading, passed in readings:
        last = plant
        plant = reading
        node += passed
        advance = passed if reading is None or last is None else max(reading - last, 0.0)
        now = time()
        assert now - before == pytest.approx(advance, abs=1e-6)
        assert now >= before
        before = now
